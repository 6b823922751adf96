"""Kernels of lidar odometry: compiled, interpreted and written naively they agree."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayproof.harness.estimators import alignment, matrices, scan_search, voxels
from wayproof.harness.estimators.alignment import SCALE, count_on_planes
from wayproof.harness.estimators.matrices import diagonalize, solve
from wayproof.harness.estimators.surface_map import SurfaceMap, not_aligned, thinned
from wayproof.harness.estimators.voxels import fit_plane, slot_of, voxel_key


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


def mapped(points):
    surfaces = SurfaceMap(0.5, held=0.04, registered_share=0.0)
    count = voxels.add_points(points, np.zeros(3), surfaces.voxels, 3)
    return count, *surfaces.voxels


def aligned(surfaces):
    predicted, result = np.array([0.03, 0.02, 0.0]), not_aligned()
    prior = np.diag([0.1, 0.2, 0.3, 0.4])
    counts = alignment.align(room(300, seed=5), predicted, 0.04, prior, surfaces.voxels, result)
    return *counts, *result


def examined(surfaces):
    results = [np.zeros(300), np.empty((4, 4)), np.empty((4, 4)), np.zeros((1, 4))]
    correction = np.array([0.01, 0.0, -0.01, 0.002])
    sweep = room(300, seed=5)
    count = alignment.examine(sweep, np.zeros(3), correction, surfaces.voxels, *results)
    return count, *results


def test_compiled_and_interpreted_kernels_give_the_same_bits(python_versions):
    surfaces = SurfaceMap(0.5, held=0.04, registered_share=0.0)
    surfaces.add(room(3000), np.zeros(3))

    def results():
        return [
            *mapped(room(500)),
            *aligned(surfaces),
            *examined(surfaces),
            in_order(room(300), 0.5),
        ]

    compiled = results()
    assert compiled[0] > 0
    assert 20 < len(compiled[-1]) < 300
    assert len(compiled) > 12
    python_versions()
    for one, other in zip(compiled, results(), strict=True):
        np.testing.assert_array_equal(one, other)
