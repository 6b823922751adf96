"""Both ray engines give the same sweeps, and compile nothing after their warm-up."""

import mujoco
import numpy as np
import pytest

from tests.models.rays.cast import (
    ALL,
    LIDAR,
    directions_of,
    pattern_of,
    posed,
    random_geoms,
)
from wayproof.models import rays
from wayproof.models.poses import Trail
from wayproof.models.rays import TileCaster, bounds, cut_grid, cut_scattered, tile_kernels, tiles
from wayproof.models.robots import ROBOTS
from wayproof.models.scene import compose
from wayproof.models.sensors.caster import RangefinderCaster
from wayproof.models.sensors.devices import SensorConfig
from wayproof.models.worlds import WORLDS


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_both_engines_give_the_same_warehouse(robot):
    world, robot = WORLDS["warehouse"](4), ROBOTS[robot]
    sweeps = []
    for engine in ("tile", "mujoco"):
        scene = compose(world, robot, SensorConfig(engine=engine))
        data = mujoco.MjData(scene.model)
        start = np.array([*world.start[:2], robot.spec.rest_height])
        scene.controller.reset(data, start, world.start_heading)
        for quaternion in ([1, 0, 0, 0], [0.9, 0.1, -0.05, 0.3]):
            data.qpos[:3] += (0.1234, -0.0567, 0.031)
            data.qpos[3:7] = np.array(quaternion) / np.linalg.norm(quaternion)
            mujoco.mj_kinematics(scene.model, data)
            casters = [c for c in scene.casters if not isinstance(c, RangefinderCaster)]
            trail = Trail(data.qpos[None, :3].copy(), data.qpos[None, 3:7].copy(), 0.002)
            sweeps.append((engine, [caster.cast(data, trail, 0, 0) for caster in casters]))
    for (_, tile), (_, own) in zip(sweeps[:2], sweeps[2:], strict=True):
        for one, other in zip(tile, own, strict=True):
            np.testing.assert_array_equal(one, other)
            assert (one < 60000).mean() > 0.3


def test_nothing_is_compiled_after_the_warm_up():
    rays.warm_up()
    everything = {
        name: kernel
        for module in (bounds, tile_kernels, tiles)
        for name, kernel in vars(module).items()
        if name in ("view_geoms", "cast_blocks", "fit_cones", "turn_cones", "number_cells")
    }
    assert len(everything) == 5
    before = {name: len(kernel.signatures) for name, kernel in everything.items()}
    assert set(before.values()) <= {1, 2}  # with triangles too where another test met some
    model, data = posed(random_geoms(np.random.default_rng(2), 10))
    caster = TileCaster(model, ALL, LIDAR.range)
    R = data.geom_xmat[0].reshape(3, 3)
    caster.cast(data, pattern_of(LIDAR), data.geom_xpos[0], R)
    directions = np.asfortranarray(directions_of(LIDAR))
    directions.flags.writeable = False
    indices = (np.arange(len(directions)) % 7)[::-1]
    caster.cast(data, cut_scattered(directions, indices), data.geom_xpos[:7], R)
    caster.cast(data, cut_grid(directions[::-2][:9], 3, 3), data.geom_xpos[0], R.T)
    assert before == {name: len(kernel.signatures) for name, kernel in everything.items()}


def test_nothing_is_compiled_after_a_caster_of_triangles_is_made():
    head = '<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
    model, data = posed('<geom type="mesh" mesh="wedge"/>', head)
    caster = TileCaster(model, ALL, LIDAR.range)
    before = len(tile_kernels.cast_blocks.signatures)
    assert before > 0
    directions = directions_of(LIDAR)
    caster.cast(data, pattern_of(LIDAR), np.ones(3), np.eye(3))
    scattered = cut_scattered(directions, np.arange(len(directions)) % 7)
    caster.cast(data, scattered, np.ones((7, 3)), np.broadcast_to(np.eye(3), (7, 3, 3)))
    assert len(tile_kernels.cast_blocks.signatures) == before
