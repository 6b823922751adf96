import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import OCCUPIED, MapConfig, VoxelMap
from wayproof.maps.grid import centres
from wayproof.maps.kernels import labels as kernels
from wayproof.maps.semantic import UNLABELLED, SemanticLayer

CONFIG = MapConfig(half_life=0.0, memory_mib=16)


def label(layer, point, *labels):
    points = np.tile(point, (len(labels), 1))
    layer.integrate(points, np.array(labels, np.uint8))


def test_the_most_votes_win_and_of_equal_ones_the_least_class():
    layer = SemanticLayer(0.1, 4)
    label(layer, (0.05, 0.05, 0.0), 3, 1, 3)
    label(layer, (0.15, 0.05, 0.0), 2, 1)
    points = [[0.09, 0.01, -0.07], [0.19, 0.09, 0.02], [0.25, 0.05, 0.0]]
    np.testing.assert_array_equal(layer.label_at(points), [3, 1, UNLABELLED])
    np.testing.assert_array_equal(layer.votes_at(points), [[0, 1, 0, 2], [0, 1, 1, 0], [0] * 4])


def test_votes_do_not_fade_and_a_new_thing_has_to_outvote_the_old_one():
    layer = SemanticLayer(0.1, 2)
    label(layer, (1.0, 1.0, 1.0), 0, 0, 0)
    labels_seen = []
    for _ in range(4):
        label(layer, (1.0, 1.0, 1.0), 1)
        labels_seen.append(int(layer.label_at([(1.0, 1.0, 1.0)])[0]))
    assert labels_seen == [0, 0, 0, 1]


def test_a_point_is_in_the_cell_that_the_map_has_it_in():
    layer = SemanticLayer(0.1, 2)
    label(layer, (-0.05, -0.05, 0.02), 1)  # z: floor(0.2 + 0.75) = 0, up to 0.025
    points = [[-0.01, -0.09, -0.07], [0.01, -0.05, 0.02], [-0.05, -0.05, 0.03]]
    np.testing.assert_array_equal(layer.label_at(points), [1, UNLABELLED, UNLABELLED])


def test_many_votes_equal_counting_in_a_dictionary():
    rng = np.random.default_rng(5)
    layer, counted = SemanticLayer(0.2, 7), {}
    for _ in range(5):
        points = rng.normal(scale=2.0, size=(2000, 3)) + rng.choice([0.0, -9e5], 3)
        labels = rng.integers(0, 7, 2000).astype(np.uint8)
        layer.integrate(points, labels)
        for point, name in zip(points, labels, strict=True):
            cell = tuple(np.floor(point / 0.2 + [0.0, 0.0, 0.75]).astype(int))
            counted.setdefault(cell, np.zeros(7, int))[name] += 1
    middles = (np.array(list(counted)) + np.array([0.5, 0.5, -0.25])) * 0.2
    np.testing.assert_array_equal(layer.votes_at(middles), list(counted.values()))
    assert layer.lost == 0


def test_equal_votes_have_equal_versions_in_any_order():
    rng = np.random.default_rng(6)
    points, labels = rng.normal(size=(300, 3)), rng.integers(0, 3, 300).astype(np.uint8)
    there, back, other = (SemanticLayer(0.1, 3) for _ in range(3))
    there.integrate(points, labels)
    back.integrate(points[::-1], labels[::-1])
    other.integrate(points[1:], labels[1:])
    versions = {layer.version() for layer in (there, other, SemanticLayer(0.1, 3))}
    assert there.version() == back.version()
    assert len(versions) == 3
    assert len(SemanticLayer(0.1, 3).version()) == 32


def test_a_full_layer_keeps_what_it_has_and_counts_what_it_loses():
    layer = SemanticLayer(0.5, 200, memory_mib=1)
    assert 500 < layer.capacity < 2000
    assert layer.memory_bytes() <= 1 << 20
    more = layer.capacity + 50
    points = np.stack([0.5 * np.arange(more) + 0.25, np.zeros(more), np.zeros(more)], axis=1)
    layer.integrate(points, np.full(more, 9, np.uint8))
    assert layer.lost == 50
    label(layer, points[0], 5, 5)
    assert layer.lost == 50
    labels_seen = layer.label_at(points)
    assert labels_seen[0] == 5
    assert (labels_seen[1 : layer.capacity] == 9).all()
    assert (labels_seen[layer.capacity :] == UNLABELLED).all()


def test_a_full_count_stays():
    layer = SemanticLayer(0.1, 2)
    label(layer, (0.0, 0.0, 0.0), 1)
    layer._votes[0, 1] = 2**32 - 2
    label(layer, (0.0, 0.0, 0.0), 1, 1, 1)
    assert layer.votes_at([(0.0, 0.0, 0.0)]).tolist() == [[0, 2**32 - 1]]


def random_sweep(seed, moments=1, count=400):
    rng = np.random.default_rng(seed)
    directions, ranges_mm = scattered(rng, count, 200, 3500)
    ranges_mm[::7], ranges_mm[1::7] = 0, 65535
    labels = rng.integers(0, 4, count).astype(np.uint8)
    labels[::5] = UNLABELLED
    moment = rng.integers(0, moments, count).astype(np.int32)
    return rng.uniform(-0.3, 0.3, (moments, 3)), directions, ranges_mm, labels, moment


@pytest.mark.parametrize("run", [kernels.list_ballots, kernels.list_ballots.py_func])
def test_a_sweep_votes_in_the_cells_that_its_map_takes_for_occupied(run, monkeypatch):
    monkeypatch.setattr(kernels, "list_ballots", run)
    for moments in (1, 3):
        layer, by_points, voxel_map = SemanticLayer(0.1, 4), SemanticLayer(0.1, 4), VoxelMap(CONFIG)
        origins, directions, ranges_mm, labels, moment = random_sweep(moments, moments)
        of_each = None if moments == 1 else moment
        layer.integrate_sweep(origins, directions, ranges_mm, (0.3, 3.0), labels, of_each)
        voxel_map.integrate(origins, directions, ranges_mm, 3.0, 0, of_each)
        counted = (ranges_mm >= 300) & (ranges_mm <= 3000) & (labels != UNLABELLED)
        points = origins[moment] + directions * (ranges_mm / 1000)[:, None]
        by_points.integrate(points[counted], labels[counted])
        assert layer.version() == by_points.version()
        cells, winners = layer.labelled(np.ones(4, bool))
        assert len(cells) > 150
        middles = centres(cells, 0.1)
        assert (voxel_map.state_at(middles) == OCCUPIED).all()
        np.testing.assert_array_equal(winners, layer.votes_at(middles).argmax(axis=1))
        assert set(map(tuple, layer.labelled(np.arange(4) == 2)[0].tolist())) == set(
            map(tuple, cells[winners == 2].tolist())
        )


def test_a_bad_sweep_is_refused_and_what_is_not_finite_is_no_vote():
    layer = SemanticLayer(0.1, 3)
    beam, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([1000], np.uint16)
    for labels, message in (
        (np.array([3], np.uint8), "labels: got 3, expected 0 to 2"),
        (np.array([1, 1], np.uint8), r"labels: got uint8 \(2,\) for 1 directions"),
        (np.array([1]), r"labels: got int64"),
    ):
        with pytest.raises(ValueError, match=message):
            layer.integrate_sweep((0, 0, 0), beam, ranges_mm, (0.3, 3.0), labels)
    one = np.ones(1, np.uint8)
    with pytest.raises(ValueError, match="moments: got"):
        layer.integrate_sweep((0, 0, 0), beam, ranges_mm, (0.3, 3.0), one, np.ones(1, np.int32))
    layer.integrate_sweep((np.nan, 0, 0), beam, ranges_mm, (0.3, 3.0), one)
    assert layer.version() == SemanticLayer(0.1, 3).version()


def test_changes_of_labels_are_logged():
    layer = SemanticLayer(0.1, 3)
    label(layer, (0.05, 0.05, 0.0), 1, 1)
    boxes, now = layer.changed(0)
    assert (boxes.tolist(), now) == ([[0, 0, 0, 1, 1, 1]], 1)
    label(layer, (0.05, 0.05, 0.0), 2)
    assert layer.changed(now) == (pytest.approx(np.empty((0, 6))), 1)
    label(layer, (0.05, 0.05, 0.0), 2, 2)
    label(layer, (-0.05, 0.35, 0.2), 0)
    assert layer.changed(now)[0].tolist() == [[0, 0, 0, 1, 1, 1], [-1, 3, 2, 0, 4, 3]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, 3), r"^resolution: got 0, expected 0\.01 to 0\.5 m$"),
        ((0.1, 0), r"^classes: got 0, expected 1 to 255$"),
        ((0.1, 256), r"^classes: got 256, expected 1 to 255$"),
        ((0.1, 3, 0), r"^memory_mib: got 0, expected 1 to 65536 MiB$"),
    ],
)
def test_a_bad_setting_is_refused_in_one_line(arguments, message):
    with pytest.raises(ValueError, match=message):
        SemanticLayer(*arguments)


@pytest.mark.parametrize(
    ("points", "labels", "message"),
    [
        ([[0.0, 0.0]], np.zeros(1, np.uint8), r"^points: got shape \(1, 2\), expected \(n, 3\)$"),
        ([[0.0, 0.0, np.nan]], np.zeros(1, np.uint8), r"^points: got .*, expected finite"),
        ([[0.0, 0.0, 0.0]], np.zeros(2, np.uint8), r"^labels: got uint8 \(2,\), expected uint8"),
        ([[0.0, 0.0, 0.0]], np.zeros(1, np.int64), r"^labels: got int64 \(1,\), expected uint8"),
        ([[0.0, 0.0, 0.0]], np.full(1, 3, np.uint8), r"^labels: got 3, expected 0 to 2"),
    ],
)
def test_bad_votes_are_refused_and_none_is_counted(points, labels, message):
    layer = SemanticLayer(0.1, 3)
    with pytest.raises(ValueError, match=message):
        layer.integrate(points, labels)
    assert layer.version() == SemanticLayer(0.1, 3).version()
