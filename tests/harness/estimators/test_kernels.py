"""Kernels of lidar odometry: compiled, interpreted and written naively they agree."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayproof.harness.estimators import alignment, matrices, scan_search, voxels
from wayproof.harness.estimators.alignment import SCALE, align, count_on_planes
from wayproof.harness.estimators.matrices import diagonalize, solve
from wayproof.harness.estimators.surface_map import SurfaceMap, not_aligned, thinned
from wayproof.harness.estimators.voxels import add_points, fit_plane, slot_of, voxel_key


@pytest.fixture
def python_versions(monkeypatch):
    """Let every kernel of the modules call the interpreted ones; the hash may overflow."""
    with np.errstate(over="ignore"):
        yield lambda: replace_all(monkeypatch)


def replace_all(monkeypatch):
    for module in (matrices, voxels, alignment, scan_search):
        for name, value in list(vars(module).items()):
            if hasattr(value, "py_func"):
                monkeypatch.setattr(module, name, value.py_func)


def room(count=3000, seed=1, noise=0.005):
    """Points on the walls and the floor of a room of 6 x 4 x 2.5 m around the origin."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-3.0, -2.0, -0.5), (3.0, 2.0, 2.0), (count, 3))
    wall = rng.integers(0, 5, count)
    for side, (axis, value) in enumerate([(0, -3.0), (0, 3.0), (1, -2.0), (1, 2.0), (2, -0.5)]):
        points[wall == side, axis] = value
    return points + noise * rng.standard_normal((count, 3))


def test_eigenvectors_are_numpys():
    rng = np.random.default_rng(0)
    for _ in range(50):
        root = rng.standard_normal((3, 3))
        matrix, vectors = root @ root.T, np.empty((3, 3))
        diagonal = matrix.copy()
        diagonalize(diagonal, vectors)
        np.testing.assert_allclose(
            np.sort(np.diag(diagonal)), np.linalg.eigvalsh(matrix), rtol=1e-9, atol=1e-12
        )
        np.testing.assert_allclose(
            vectors @ np.diag(np.diag(diagonal)) @ vectors.T, matrix, atol=1e-12
        )


def test_cholesky_solves_as_numpy_does():
    rng = np.random.default_rng(0)
    for _ in range(20):
        root = rng.standard_normal((4, 6))
        matrix, right = root @ root.T, rng.standard_normal(4)
        expected = np.linalg.solve(matrix, right)
        solve(matrix, right)
        np.testing.assert_allclose(right, expected, rtol=1e-8)


def in_order(points, spacing, scratch=np.zeros):
    """Points that `spread_out` chooses of those of an array in their order."""
    slots = 1 << (2 * len(points)).bit_length()
    keys, heads = scratch(slots, np.int64), scratch(slots, np.int64)
    following, chosen = scratch(len(points), np.int64), scratch(len(points), np.int64)
    count = voxels.spread_out(points, spacing, keys, heads, following, chosen)
    return points[chosen[:count]]


def test_each_point_in_turn_is_kept_that_no_kept_one_is_near():
    points = room()
    naive = [points[0]]
    for point in points[1:]:
        if (((np.array(naive) - point) ** 2).sum(axis=1) >= 0.2 * 0.2).all():
            naive.append(point)
    assert (in_order(points, 0.2) == np.array(naive)).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 100, 987, 3000])
def test_thinned_points_are_apart_and_near_all_others(count):
    points = room(count)
    kept = thinned(points, 0.2)
    gaps = np.linalg.norm(points[:, None] - kept[None], axis=2)
    assert ((gaps < 0.2).sum(axis=1) >= 1).all()
    assert ((gaps == 0.0).sum(axis=0) == 1).all()  # each is one of the points
    apart = np.linalg.norm(kept[:, None] - kept[None], axis=2)
    assert (apart[~np.eye(len(kept), dtype=bool)] >= 0.2).all()


def test_noise_does_not_lower_a_floor_that_is_listed_outwards():
    """Rings on a floor 1 m below, with noise along the beams: in order, those far out were kept."""
    rng = np.random.default_rng(6)
    down, around = np.meshgrid(np.linspace(0.9, 0.2, 60), np.linspace(0, 6.28, 300), indexing="ij")
    out = np.stack([np.cos(around) * np.cos(down), np.sin(around) * np.cos(down), -np.sin(down)], 2)
    ranges = 1.0 / np.sin(down) + rng.normal(0.0, 0.03, down.shape)
    points = (ranges[..., None] * out).reshape(-1, 3)
    heights = thinned(points, 0.2)[:, 2] + 1.0
    listed = in_order(points, 0.2)[:, 2] + 1.0
    assert abs(heights.mean()) < 0.5 * abs(listed.mean())


@pytest.mark.parametrize("place", [1.8, 1.9, 1.95, 2.0])
def test_noise_does_not_move_a_thinned_wall(place):
    """A point for each cell of a grid put walls on a face of it millimetres off."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-2.0, 2.0, (20_000, 3))
    points[:, 0] = place + rng.normal(0.0, 0.015, len(points))
    kept = thinned(points, 0.2)
    assert len(kept) > 200
    assert kept[:, 0].mean() == pytest.approx(place, abs=3.0 * 0.015 / np.sqrt(len(kept)))


def test_a_voxel_holds_mean_and_covariance_of_its_points():
    surfaces, points = SurfaceMap(0.5, held=0.04, registered_share=0.0), room(400)
    surfaces.add(points, np.zeros(3))
    table = surfaces.voxels
    by_key = {}
    for point in points:
        by_key.setdefault(int(voxel_key(*point, 1.0 / 0.5)), []).append(point)
    assert surfaces.count == len(by_key) == (table.keys != voxels.EMPTY).sum()
    for slot in np.flatnonzero(table.keys != voxels.EMPTY):
        own = np.array(by_key[int(table.keys[slot])])[: voxels.MOST_POINTS]
        assert table.counts[slot] == len(own)
        np.testing.assert_allclose(table.means[slot], own.mean(axis=0), atol=1e-9)
        away = own - own.mean(axis=0)
        expected = (away.T @ away)[np.triu_indices(3)]
        np.testing.assert_allclose(table.squares[slot], expected, atol=1e-9)


def test_a_floor_at_zero_with_noise_lies_in_one_layer_of_voxels():
    """On a face between two layers, a quarter of a sweep's error of 5 mm stayed."""
    rng, up = np.random.default_rng(4), np.array([0.0, 0.0, 1.0])

    def floor(height):
        points = rng.uniform(-3.0, 3.0, (4000, 3)) * (1.0, 1.0, 0.0)
        return points + (height + rng.normal(0.0, 0.01, (4000, 1))) * up

    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.0)
    surfaces.add(floor(0.0), up)
    found = surfaces.register(floor(0.005), up)
    assert found.correction[2] == pytest.approx(-0.005, abs=8e-4)


def test_a_plane_is_told_from_a_line_and_a_ball():
    rng = np.random.default_rng(3)
    normal = np.array([1.0, 2.0, 2.0]) / 3.0
    ball = 0.1 * rng.standard_normal((40, 3))
    flat = ball - 0.97 * (ball @ normal)[:, None] * normal
    line = np.outer(0.1 * rng.standard_normal(40), [1.0, 0.0, 0.0])
    line += 0.001 * rng.standard_normal((40, 3))
    verdicts = []
    for points in (flat, ball, line):
        away = points - points.mean(axis=0)
        plane = np.zeros(4)
        fit_plane((away.T @ away)[np.triu_indices(3)], len(points), plane)
        verdicts.append(plane[3])
        if points is flat:
            assert abs(plane[:3] @ normal) > 0.999
    assert verdicts == [1.0, 0.0, 0.0]


def test_the_table_grows_and_keeps_what_it_has():
    small = SurfaceMap(0.05, held=0.04, registered_share=0.0)
    cloud = np.random.default_rng(2).uniform(-20.0, 20.0, (20_000, 3))
    for part in np.split(cloud, 4):
        small.add(part, np.zeros(3))
    keys = [int(voxel_key(*point, 1.0 / 0.05)) for point in cloud]
    assert small.count == len(set(keys))
    assert set(small.voxels.keys.tolist()) == {*keys, voxels.EMPTY}


def test_points_are_counted_by_what_is_known_of_their_voxels(python_versions):
    surfaces = SurfaceMap(0.5, held=0.04, registered_share=0.0)
    surfaces.add(room(3000), np.zeros(3))
    rng = np.random.default_rng(6)
    sweep = np.concatenate([room(300, seed=5), rng.uniform(-6.0, 6.0, (300, 3))])
    near = known = 0
    for point in sweep:
        slot = slot_of(surfaces.voxels.keys, voxel_key(*point, 2.0))
        if surfaces.voxels.counts[slot] < voxels.LEAST_POINTS:
            continue
        normal, mean = surfaces.voxels.planes[slot], surfaces.voxels.means[slot]
        if normal[3] == 1.0 and normal[:3] @ -mean < 0.0:
            continue  # seen from behind
        known += 1
        near += normal[3] == 1.0 and abs(normal[:3] @ (point - mean)) <= alignment.NEAR
    assert 50 < near < known < len(sweep)
    arguments = sweep, np.zeros(3), surfaces.voxels, voxels.LEAST_POINTS
    assert count_on_planes(*arguments)[::2] == (near, known)
    python_versions()
    assert alignment.count_on_planes(*arguments)[::2] == (near, known)


def test_a_sweep_is_registered_by_the_part_of_it_that_the_map_knows():
    """Half of the second sweep was below a share of all points, and mapped where predicted."""
    surfaces, predicted = SurfaceMap(0.3, held=0.04, registered_share=0.5), np.zeros(3)
    whole = room(20_000)
    surfaces.add(whole[whole[:, 0] < -0.8], np.zeros(3))
    shift = np.array([0.02, -0.01, 0.01])
    sweep = room(4000, seed=9) + shift
    found = surfaces.register(sweep, predicted)
    assert found.inliers < 0.45 * len(sweep)
    assert np.abs(found.correction[:3] + shift).max() < 0.003


def test_a_sweep_contradicts_the_map_by_the_voxels_that_it_knows():
    surfaces, origin = SurfaceMap(0.3, held=0.04, registered_share=0.5), np.zeros(3)
    assert not surfaces.contradicts(room(4000), origin)  # an empty map
    surfaces.add(room(20_000), origin)
    assert not surfaces.contradicts(room(4000, seed=9), origin)
    assert not surfaces.contradicts(room(4000, seed=9) + 50.0, origin)  # nothing known there
    scattered = room(4000, seed=9) + np.random.default_rng(3).normal(0.0, 0.5, (4000, 3))
    assert surfaces.contradicts(scattered, origin)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0, 0.0), (0.05, -0.04, 0.03, 0.02)])
def test_a_displaced_sweep_is_moved_back(shift):
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.0)
    surfaces.add(room(20_000), np.zeros(3))
    x, y, z, turn = shift
    moved = Rotation.from_euler("z", turn).apply(room(4000, seed=9)) + np.array([x, y, z])
    found = surfaces.register(moved, np.array([x, y, z]))
    expected = -np.array(shift)
    assert np.abs(found.correction - expected).max() < 0.002
    assert found.inliers > 1000
    assert len(found.unheld) == 0
    assert found.information.sum() == pytest.approx(1.0)


def test_compiled_and_interpreted_alignment_give_the_same_bits(python_versions):
    surfaces = SurfaceMap(0.5, held=0.04, registered_share=0.0)
    surfaces.add(room(3000), np.zeros(3))
    predicted = np.array([0.03, 0.02, 0.0])
    sweep = room(300, seed=5) + predicted
    prior = np.diag([0.1, 0.2, 0.3, 0.4])
    compiled, again = not_aligned(), not_aligned()
    counts = align(sweep - predicted, predicted, 0.04, prior, surfaces.voxels, compiled)
    python_versions()
    assert counts == alignment.align(
        sweep - predicted, predicted, 0.04, prior, surfaces.voxels, again
    )
    for one, other in zip(compiled, again, strict=True):
        np.testing.assert_array_equal(one, other)


def test_compiled_and_interpreted_maps_hold_the_same_bits(python_versions):
    compiled, again = (
        SurfaceMap(0.5, held=0.04, registered_share=0.0),
        SurfaceMap(0.5, held=0.04, registered_share=0.0),
    )
    points = room(500)
    assert add_points(points, np.zeros(3), compiled.voxels, 3) > 0
    python_versions()
    voxels.add_points(points, np.zeros(3), again.voxels, 3)
    for one, other in zip(compiled.voxels, again.voxels, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_prediction_counts_by_its_information():
    """About half of a shift remains where the prediction counts as much as the points do."""
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.0)
    surfaces.add(room(20_000, noise=0.002), np.zeros(3))
    moved = room(8000, seed=9, noise=0.002) + np.array([0.01, 0.0, 0.0])
    free = surfaces.register(moved, np.array([0.01, 0.0, 0.0]))
    prior = np.diag([free.moment[0, 0], 0.0, 0.0, 1.0])
    held = surfaces.register(moved, np.array([0.01, 0.0, 0.0]), prior)
    assert free.correction[0] == pytest.approx(-0.01, abs=5e-4)
    assert held.correction[0] == pytest.approx(-0.005, rel=0.2)


def test_a_registration_states_its_distances_and_whose_voxels_held_it():
    """Each sweep has mapped one half of a room, so that it holds what lies in it."""
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.0)
    points = room(20_000, noise=0.01)
    left = points[:, 0] < 0.0
    surfaces.add(points[left], np.zeros(3))
    surfaces.add(points[~left], np.zeros(3))
    sweep = room(4000, seed=9, noise=0.01)
    found = surfaces.register(sweep, np.zeros(3))
    assert found.deviation == pytest.approx(0.01, rel=0.15)
    np.testing.assert_allclose(found.anchors.sum(axis=0), 1.0)
    np.testing.assert_allclose(found.anchors, 0.5, atol=0.1)
    walls = np.array([0.4, 0.4, 0.2])  # share of points that measure x, y, z
    np.testing.assert_allclose(np.diag(found.moment)[:3], walls, rtol=0.2)
    noise = np.random.default_rng(0).normal(0.0, 0.01, 100_000)
    weights = 1.0 / (1.0 + (noise / SCALE) ** 2)
    square = np.mean((weights * noise) ** 2) / np.mean(weights) ** 2
    np.testing.assert_allclose(np.diag(found.scatter), square * np.diag(found.moment), rtol=0.3)
    other = surfaces.register(sweep[sweep[:, 0] > 0.5], np.zeros(3))
    assert other.anchors[0].max() == 0.0


def test_compiled_and_interpreted_examination_give_the_same_bits(python_versions):
    surfaces = SurfaceMap(0.5, held=0.04, registered_share=0.0)
    surfaces.add(room(3000), np.zeros(3))
    sweep, correction = room(300, seed=5), np.array([0.01, 0.0, -0.01, 0.002])

    def examined(kernel):
        results = [np.zeros(300), np.empty((4, 4)), np.empty((4, 4)), np.zeros((1, 4))]
        count = kernel(sweep, np.zeros(3), correction, surfaces.voxels, *results)
        return count, *results

    compiled = examined(alignment.examine)
    assert compiled[0] > 100
    python_versions()
    for one, other in zip(compiled, examined(alignment.examine), strict=True):
        np.testing.assert_array_equal(one, other)


def test_compiled_and_interpreted_thinning_choose_the_same_points(python_versions):
    compiled = in_order(room(300), 0.5)
    assert 20 < len(compiled) < 300
    python_versions()
    assert (in_order(room(300), 0.5) == compiled).all()
