"""Patterns of beams: tiles, their cones and bounds, and beams in no order."""

import numpy as np
import pytest

from tests.models.rays.cast import (
    ALL,
    X,
    by_mj_ray,
    directions_of,
    lidar,
    own_hits,
    pattern_of,
    posed,
    random_directions,
    random_geoms,
    random_rotation,
)
from wayproof.models.rays import TileCaster, cut_grid, cut_scattered
from wayproof.models.sensors.beams import rotate


@pytest.mark.parametrize("count", [1, 63, 64, 65, 5000])
def test_scattered_beams_are_all_cast_whatever_their_order(count):
    rng = np.random.default_rng(count)
    model, data = posed(random_geoms(rng, 60))
    directions, shuffle = random_directions(rng, count), rng.permutation(count)
    caster, R = TileCaster(model, ALL, range=8.0), random_rotation(rng)
    found, ids = caster.cast(data, cut_scattered(directions), np.zeros(3), R)
    expected, expected_ids = by_mj_ray(model, data, np.zeros(3), rotate(R, directions), 8.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(ids, expected_ids)
    shuffled = caster.cast(data, cut_scattered(directions[shuffle]), np.zeros(3), R)
    assert shuffled[0].tobytes() == found[shuffle].tobytes()


@pytest.mark.parametrize("pattern", ["grid", "scattered"])
def test_no_bound_rules_out_a_hit(pattern):
    """Splinters, plates and balls of any size, many to a tile: all bits as of `mj_multiRay`."""
    dense = lidar(40, 200, -0.5, 0.5, range=30.0)
    for seed in range(8):
        rng = np.random.default_rng([31, seed])
        model, data = posed(random_geoms(rng, 300, spread=10.0, sizes=(0.003, 3.0)))
        directions = directions_of(dense) if pattern == "grid" else random_directions(rng, 8000)
        cut = pattern_of(dense) if pattern == "grid" else cut_scattered(directions)
        origin, R = rng.uniform(-5.0, 5.0, 3), random_rotation(rng)
        distance, ids = TileCaster(model, ALL, dense.range).cast(data, cut, origin, R)
        own, own_ids = own_hits(model, data, directions, dense.range, origin, R)
        beyond = own > dense.range
        np.testing.assert_array_equal(distance, np.where(beyond, -1.0, own))
        np.testing.assert_array_equal(ids, np.where(beyond, -1, own_ids))


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        (lambda: cut_grid(np.zeros((2, 3)), 1, 2), "beam 0: got length 0, expected 1"),
        (lambda: cut_scattered(X * [[1.0], [2.0]]), "beam 1: got length 2, expected 1"),
        (lambda: cut_grid(np.zeros((0, 3)), 0, 2), "beams: got 0 rows"),
        (lambda: cut_grid(X, 1, 2), "beams: got 1, expected 1 rows x 2 columns"),
        (lambda: cut_scattered(np.zeros((0, 3))), "beams: got 0"),
        (lambda: cut_scattered(X, np.array([0, 1])), r"pose_indices: got shape \(2,\)"),
        (lambda: cut_scattered(X, np.array([-1])), "pose_indices: got -1"),
    ],
)
def test_what_is_no_pattern_is_refused(cut, said):
    with pytest.raises(ValueError, match=said):
        cut()
