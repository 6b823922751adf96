"""OctoMap behind VoxelMap's interface: the same sweeps, the same answers, but for what it lacks."""

import importlib

import numpy as np
import pytest

from tests.maps.sweeps import unit_vectors
from wayproof.maps import FREE, MAPS, OCCUPIED, MapConfig
from wayproof.maps.grid import centres
from wayproof.maps.others.octomap import HALF_TREE, TREE_DEPTH, find_leaves

FIRST, SHAPE = (-5, -5, -2), (70, 60, 38)  # a window of cells about the room
WALLS = np.array([[0.03, 0.04, 0.0], [6.04, 5.03, 3.0]])  # within cells, not between
CONFIG = MapConfig(half_life=0.0)
BEAMS = 10_000


def sweeps(count, moments=1):
    """Beams from random places in a room to its walls, in whole millimetres; m places a sweep."""
    rng = np.random.default_rng(5)
    for _ in range(count):
        origins = rng.uniform(WALLS[0] + 0.5, WALLS[1] - 0.5, (moments, 3))
        moment = (np.arange(BEAMS) * moments // BEAMS).astype(np.int32)
        directions = unit_vectors(rng, BEAMS)
        start = origins[moment]
        to_wall = np.where(directions > 0, WALLS[1] - start, WALLS[0] - start) / directions
        ranges_mm = np.rint(to_wall.min(axis=1) * 1000).astype(np.uint16)
        ranges_mm[:3] = 0, 100, 65535  # dropped, too near, no return
        yield origins, directions, ranges_mm, moment


def octomap(config=CONFIG):
    return MAPS["octomap"](config)


def window():
    """Centres of the window's cells, m, world."""
    cells = np.stack(np.indices(SHAPE), axis=-1).reshape(-1, 3) + FIRST
    return centres(cells, CONFIG.resolution)


def states(octo):
    return octo.state_at(window()).reshape(SHAPE)


@pytest.fixture(scope="module")
def both():
    ours, peer = MAPS["voxel"](CONFIG), octomap()
    statistics = []
    for time, (origins, directions, ranges_mm, _) in enumerate(sweeps(6)):
        arguments = origins, directions, ranges_mm, 8.0, time
        statistics.append((ours.integrate(*arguments), peer.integrate(*arguments)))
    return ours, peer, statistics


def test_states_agree_but_where_the_floor_is_guarded(both):
    ours, peer, _ = both
    points = window()
    a, b = ours.state_at(points), peer.state_at(points)
    above = points[:, 2] > 0.5 * CONFIG.resolution  # all but the layer of the floor and below
    assert (b[above] == OCCUPIED).sum() > 2000
    assert (b[above] == FREE).sum() > 50_000
    assert (a == b)[above].mean() >= 0.9999
    floor = np.abs(points[:, 2] + 0.25 * CONFIG.resolution) < 1e-6
    erased = (a[floor] == OCCUPIED) & (b[floor] == FREE)
    assert erased.sum() >= 10  # what the guard is for
    assert (a[floor] == b[floor])[~erased].mean() > 0.97


def test_probabilities_agree(both):
    ours, peer, _ = both
    points = window()[::7]
    same = ours.state_at(points) == peer.state_at(points)
    difference = np.abs(ours.probability_at(points) - peer.probability_at(points))
    assert np.median(difference[same]) < 2e-3
    assert (difference[same] < 0.01).mean() > 0.98


def test_three_hits_and_then_seven_misses_by_hand():
    peer = octomap()
    wall, beyond = np.array([1000], np.uint16), np.array([65535], np.uint16)
    origin, beam = np.array([1.05, 1.05, 1.05]), np.array([[1.0, 0.0, 0.0]])
    end = [[2.05, 1.05, 1.05]]
    seen = []
    for time, ranges_mm in enumerate([wall] * 3 + [beyond] * 7):
        peer.integrate(origin, beam, ranges_mm, 3.0, time)
        seen.append(float(peer.probability_at(end)[0]))
    # Log-odds 0.9, 1.8, 2.7, then 0.4 less each time.
    assert seen[:5] == pytest.approx([0.711, 0.858, 0.937, 0.909, 0.870], abs=1e-3)
    assert peer.state_at(end)[0] == FREE  # 2.7 - 2.8


def test_clamps_hold():
    peer = octomap()
    origin, beam = np.array([1.05, 1.05, 1.05]), np.array([[1.0, 0.0, 0.0]])
    for time in range(20):
        peer.integrate(origin, beam, np.array([1000], np.uint16), 3.0, time)
    got = peer.probability_at([[2.05, 1.05, 1.05], [1.55, 1.05, 1.05]])
    assert got == pytest.approx([0.97, 0.12], abs=2e-3)


def test_a_change_lies_within_the_boxes():
    peer = octomap()
    _, stamp = peer.changed(0)
    before = states(peer)
    origins, directions, ranges_mm, _ = next(sweeps(1))
    peer.integrate(origins, directions, ranges_mm, 8.0, 0)
    boxes, now = peer.changed(stamp)
    assert (len(boxes), now) == (1, stamp + 1)
    cells = np.argwhere(states(peer) != before) + FIRST
    assert len(cells) > 10_000
    assert (cells >= boxes[0, :3]).all()
    assert (cells < boxes[0, 3:]).all()
    assert len(peer.changed(now)[0]) == 0


def test_a_rolling_sweep_is_one_sweep_from_each_origin():
    rolling, parts = octomap(), octomap()
    origins, directions, ranges_mm, moment = next(sweeps(1, moments=3))
    rolling.integrate(origins, directions, ranges_mm, 8.0, 0, moment)
    for i, origin in enumerate(origins):
        parts.integrate(origin, directions[moment == i], ranges_mm[moment == i], 8.0, 0)
    assert rolling.version() == parts.version()


def test_the_leaves_of_a_written_tree():
    """By hand: two leaves, the one at the corner of the tree and the one at its middle."""
    inner = [bytes([0, 0, 0, 0, 1])] * (TREE_DEPTH - 1)
    leaf = bytes([1, 2, 3, 4, 0])
    tree = b"".join([bytes([0, 0, 0, 0, 0b1000_0001]), *inner, leaf, *inner, leaf])
    nodes = np.frombuffer(tree, np.uint8).copy()
    for find in (find_leaves, find_leaves.py_func):
        names, places = np.zeros(40, np.int64), np.zeros(40, np.int64)
        assert find(nodes, names, places) == 2
        assert names[:2].tolist() == [0, HALF_TREE << 32 | HALF_TREE << 16 | HALF_TREE]
        assert places[:2].tolist() == [5 * TREE_DEPTH, 10 * TREE_DEPTH]
        assert find(nodes[:0], names, places) == 0


def test_without_pyoctomap_one_line_says_what_to_install(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(
        ValueError, match="expected pyoctomap to be installed \\(the extra 'dev'\\)"
    ):
        octomap()


def test_beams_that_leave_the_tree_are_refused():
    peer = octomap()
    with pytest.raises(ValueError, match=r"^origin: got one beyond 3270.7 m, where OctoMap's tree"):
        peer.integrate((5000.0, 0.0, 0.0), np.eye(3)[:1], np.array([1000], np.uint16), 3.0, 0)
    assert peer.counts()["occupied"] == 0
