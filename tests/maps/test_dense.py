"""A map on `DenseMap`, registered by one line as CONTRIBUTING says."""

import numpy as np
import pytest

from tests.maps.counting_map import CountingMap, HalvingMap
from tests.maps.sweeps import unit_vectors
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.replay.replay import replay
from wayproof.maps import MAPS, MapConfig, VoxelMap, states_in
from wayproof.maps.dense import DenseMap

BOX = (-5.0, -5.0, -3.0), (5.0, 5.0, 3.0)
TENTH = 100_000_000  # ns
SETTINGS = ["map.half_life=0", "episode.time_limit=1.2"]


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(MAPS, "counting", CountingMap)


def sweep(seed, count=400):
    rng = np.random.default_rng(seed)
    directions = unit_vectors(rng, count)
    origin = rng.uniform(-1.0, 1.0, 3)
    return origin, directions, rng.integers(300, 4200, count).astype(np.uint16), 4.0, seed * TENTH


@pytest.mark.parametrize("region", [(None, None), ((-2.0, -1.0, -0.4), (3.0, 2.5, 1.7))])
def test_it_has_the_states_of_the_voxel_map_cell_by_cell(region):
    config = MapConfig(half_life=0.0)
    ours, theirs = CountingMap(config, *region), VoxelMap(config, *region)
    for a_map in (ours, theirs):
        a_map.mark_free_sphere((0.0, 0.0, 0.5), 0.6, 0)
        a_map.mark_floor((-1.0, -1.0), (1.0, 1.0), 0)
    now, versions = [0, 0], set()
    for seed in range(6):
        statistics = [a_map.integrate(*sweep(seed)) for a_map in (ours, theirs)]
        assert statistics[0] == statistics[1]
        boxes, now[0] = ours.changed(now[0])
        peers, now[1] = theirs.changed(now[1])
        assert sorted(boxes.tolist()) == sorted(peers.tolist())
        versions.add(ours.version())
    assert len(versions) == 6
    states = states_in(ours, *BOX)
    np.testing.assert_array_equal(states, states_in(theirs, *BOX))
    assert ours.counts() == theirs.counts()
    assert min(ours.counts().values()) > 500
    points = np.random.default_rng(9).uniform(*BOX, (3000, 3))
    for query in ("state_at", "observed_ns_at", "probability_at"):
        np.testing.assert_allclose(getattr(ours, query)(points), getattr(theirs, query)(points))


def test_decay_leaves_what_was_updated_since_the_last_tick():
    a_map = HalvingMap(MapConfig(half_life=5.0, decay_period=1.0))
    ahead, back = np.array([[1.0, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    hit = np.array([1000], np.uint16)
    a_map.integrate((0.05, 0.05, 0.5), ahead, hit, 2.0, 0)
    a_map.advance(10 * TENTH)
    a_map.integrate((0.05, 0.05, 0.5), back, hit, 2.0, 11 * TENTH)
    a_map.advance(20 * TENTH)
    odds = -np.log(1.0 / a_map.probability_at([[1.05, 0.05, 0.5], [-0.95, 0.05, 0.5]]) - 1.0)
    np.testing.assert_allclose(odds * 30.0, [13.0, 27.0])


def test_a_map_without_decay_refuses_a_half_life():
    with pytest.raises(ValueError, match=r"^map\.half_life: got 30, expected 0 with map\.kind "):
        CountingMap(MapConfig())
    assert (CountingMap.decays, HalvingMap.decays) == (False, True)


def test_by_default_a_probability_is_the_clamping_one_of_the_state():
    class Plain(CountingMap):
        probabilities = DenseMap.probabilities

    a_map = Plain(MapConfig(half_life=0.0))
    a_map.mark_free((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0)
    a_map.mark_floor((2.0, 2.0), (3.0, 3.0), 0)
    at = [[0.55, 0.55, 0.5], [2.55, 2.55, 0.0], [9.0, 9.0, 9.0]]
    assert a_map.probability_at(at).tolist() == [0.12, 0.97, 0.5]


def test_an_episode_runs_on_it_and_replays_bit_for_bit(registered, tmp_path):
    config = override(Config("warehouse", "quadruped", seed=4), SETTINGS)
    decisions = {}
    for kind in ("counting", "voxel"):
        path = tmp_path / f"{kind}.mcap"
        run_episode(build(override(config, [f"map.kind={kind}"])), path)
        assert replay(path).identical
        decisions[kind] = list(open_log(path).decisions())
        assert {decision.representation for decision in decisions[kind]} == {kind}
        for decision in decisions[kind]:
            for name in ("representation", "map_version", "chain", "stages"):
                decision.ClearField(name)
    assert len(decisions["counting"]) > 10
    assert decisions["counting"] == decisions["voxel"]  # as the states of all cells are the same
