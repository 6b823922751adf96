"""Beams that leave from poses of their own, compiled and as Python."""

import mujoco
import numpy as np
import pytest

from tests.models.interpreting import interpret_kernels
from tests.models.rays.cast import (
    ALL,
    LIDAR,
    X,
    by_mj_ray,
    camera,
    directions_of,
    pattern_of,
    posed,
    random_directions,
    random_geoms,
    random_rotation,
)
from wayproof.models.rays import TileCaster, cut_grid, cut_scattered
from wayproof.models.sensors.beams import rotate


def rolling_poses(rng, m):
    """A sensor that flies a bend of a metre while it turns by a radian."""
    part = np.linspace(0.0, 1.0, m)
    origins = rng.uniform(-1.0, 1.0, 3) + part[:, None] * [1.0, 0.4, -0.2] * part[:, None]
    start, axis, rotations = random_rotation(rng), rng.normal(size=3), np.empty((m, 9))
    for R, angle in zip(rotations, part, strict=True):
        quaternion = np.empty(4)
        mujoco.mju_axisAngle2Quat(quaternion, axis / np.linalg.norm(axis), angle)
        mujoco.mju_quat2Mat(R, quaternion)
    return origins, rotations.reshape(m, 3, 3) @ start


def by_mj_ray_rolling(model, data, origins, rotations, directions, indices, limit):
    found = [
        by_mj_ray(model, data, origins[k], rotate(rotations[k], direction[None]), limit)
        for k, direction in zip(indices, directions, strict=True)
    ]
    return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])


@pytest.mark.parametrize("order", ["columns", "scattered"])
def test_each_beam_of_a_rolling_sweep_leaves_from_its_own_pose(order):
    """A lidar that fires column by column, and beams of any direction at any indices."""
    differ = 0
    for seed in range(6):
        rng = np.random.default_rng([7, seed])
        model, data = posed(random_geoms(rng, 60))
        if order == "columns":
            m, directions = 130, directions_of(LIDAR)
            indices = np.tile(np.arange(m, dtype=np.int32), 21)
            pattern = pattern_of(LIDAR, indices)
        else:
            m, directions = 40, random_directions(rng, 2000)
            indices = rng.integers(m, size=2000, dtype=np.int32)
            pattern = cut_scattered(directions, indices)
        origins, rotations = rolling_poses(rng, m)
        caster = TileCaster(model, ALL, range=8.0)
        found, ids = caster.cast(data, pattern, origins, rotations)
        expected, expected_ids = by_mj_ray_rolling(
            model, data, origins, rotations, directions, indices, 8.0
        )
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(ids, expected_ids)
        still, _ = caster.cast(data, pattern, origins[0], rotations[0])
        differ += (np.abs(found - still) > 0.1).sum()
    assert differ > 4000


def test_a_rolling_sweep_by_hand():
    """Four beams along x towards a wall, from a sensor that comes nearer by 0.5 m a beam."""
    model, data = posed('<geom type="box" size="1 9 9" pos="6 0 0"/>')
    pattern = cut_grid(np.repeat(X, 4, axis=0), 1, 4, np.array([0, 1, 2, 3], np.int32))
    origins = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0], [1.5, 0, 0]])
    found, _ = TileCaster(model, ALL, range=9.0).cast(data, pattern, origins, np.eye(3))
    np.testing.assert_array_equal(found, [5.0, 4.5, 4.0, 3.5])
    turned = np.stack([np.eye(3), np.diag([-1.0, -1, 1]), np.eye(3), np.eye(3)])
    found, _ = TileCaster(model, ALL, range=9.0).cast(data, pattern, np.zeros(3), turned)
    np.testing.assert_array_equal(found, [5.0, -1.0, 5.0, 5.0])


@pytest.mark.parametrize("poses", [1, 3])
def test_compiled_kernels_equal_their_python(poses, monkeypatch):
    """The interpreter runs the same source, callees included, beam by beam."""
    rng = np.random.default_rng(5)
    model, data = posed(random_geoms(rng, 12, spread=2.0))
    sensor = camera(5, 9, 2.0, 1.0, range=5.0)
    origins = [0.3, -0.2, 0.1] + 0.05 * rng.normal(size=(poses, 3))
    rotations = np.stack([random_rotation(rng)] * poses)

    def everything():
        pattern = cut_scattered(directions_of(sensor), np.arange(45, dtype=np.int32) % poses)
        hits = TileCaster(model, ALL, sensor.range).cast(data, pattern, origins, rotations)
        return [array.tobytes() for array in (*pattern, *hits)]

    compiled = everything()
    interpret_kernels(monkeypatch, "wayproof.models.rays")
    with np.errstate(all="ignore"):
        assert everything() == compiled


@pytest.mark.parametrize(
    ("origins", "rotations", "said"),
    [
        (np.zeros(2), np.eye(3), r"origins: got shape \(2,\)"),
        (np.zeros((1, 1, 3)), np.eye(3), "origins: got shape"),
        (np.zeros((0, 3)), np.eye(3), "origins: got shape"),
        (np.zeros(3), np.eye(2), "R_world_sensor: got shape"),
        (np.zeros((2, 3)), np.zeros((3, 3, 3)), "poses: got 2 origins, 3 rotations"),
        (np.zeros((2, 3)), np.eye(3), "pose_indices: got up to 2, expected less than 2"),
    ],
)
def test_poses_that_do_not_fit_are_refused(origins, rotations, said):
    model, data = posed('<geom type="sphere" size="1"/>')
    with pytest.raises(ValueError, match=said):
        TileCaster(model, ALL, 1.0).cast(data, cut_scattered(X, [2]), origins, rotations)
