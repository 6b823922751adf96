"""World and robot in one model: what the sensors see, and what is true."""

import mujoco
import numpy as np
import pytest

from models.beams import NO_RETURN
from models.robots import ROBOTS, Setpoint
from models.scene import compose
from models.sensors import ROBOT_GROUP
from models.truth import Truth
from models.worlds import WORLDS


@pytest.fixture(params=sorted(ROBOTS))
def placed(request):
    """A scene of warehouse 0 with the robot at its start, and its data."""
    world, robot = WORLDS["warehouse"](0), ROBOTS[request.param]
    scene = compose(world, robot)
    data = mujoco.MjData(scene.model)
    start = np.array([*world.start[:2], robot.spec.rest_height])
    scene.controller.reset(data, start, world.start_heading)
    mujoco.mj_kinematics(scene.model, data)
    return scene, data


def test_every_beam_is_what_mj_ray_says(placed):
    scene, data = placed
    groups = np.ones(mujoco.mjNGROUP, np.uint8)
    groups[ROBOT_GROUP] = 0
    geom = np.zeros(1, np.int32)
    for caster in scene.casters:
        ranges = caster.cast(data)
        position, R_base_sensor = caster.mounting(scene.base)
        R_world_base = data.xmat[scene.base].reshape(3, 3)
        origin = data.xpos[scene.base] + R_world_base @ position
        for beam in range(0, len(ranges), max(len(ranges) // 200, 1)):
            ray = R_world_base @ R_base_sensor @ caster.directions[beam]
            args = (scene.model, data, origin, ray, groups, 1, -1, geom)
            distance = mujoco.mj_ray(*args)
            if distance < 0 or distance > caster.sensor.range:
                assert ranges[beam] == NO_RETURN
            else:
                assert abs(int(ranges[beam]) - 1000 * distance) <= 0.5 + 1e-6


def test_a_moved_robot_sees_from_where_it_is_now(placed):
    """Raised by 5 cm, a beam 45 degrees down to the floor grows by 5 cm times the root of 2."""
    scene, data = placed
    caster = scene.casters[0]
    before = caster.cast(data)
    data.qpos[2] += 0.05
    mujoco.mj_kinematics(scene.model, data)
    growth = caster.cast(data).astype(int) - before
    assert abs(growth[0] - 50.0 * np.sqrt(2.0)) <= 1.0


def test_clearance_is_the_least_over_all_pairs(placed):
    scene, data = placed
    model = scene.model
    robot = np.flatnonzero(model.geom_group == ROBOT_GROUP)
    world = [geom for geom in np.flatnonzero(model.geom_group == 0) if geom != scene.floor]
    fromto = np.zeros(6)
    least = min(
        mujoco.mj_geomDistance(model, data, int(a), int(b), 5.0, fromto)
        for a in robot
        for b in world
    )
    truth = Truth(model, scene.base, scene.floor)
    assert truth.clearance(data, limit=5.0) == pytest.approx(least, abs=1e-9)
    assert truth.clearance(data, limit=0.01) == 0.01


def test_driving_into_a_wall_is_one_collision(placed):
    scene, data = placed
    truth = Truth(scene.model, scene.base, scene.floor)
    world = WORLDS["warehouse"](0)
    into_the_wall = np.array([-1.0, world.start[1], data.xpos[scene.base, 2]])
    start = data.xpos[scene.base].copy()
    for tick in range(2500):
        share = min(tick / 2000, 1.0)
        position = start + share * (into_the_wall - start)
        setpoint = Setpoint(position, (into_the_wall - start) / 4.0, np.pi, 0.0)
        scene.controller.follow(data, setpoint)
        mujoco.mj_step(scene.model, data)
        truth.count_contacts(data)
        if truth.collisions:
            break
    assert truth.collisions == 1
    assert truth.clearance(data) <= 1e-3


def test_the_flattened_scene_compiles_to_the_same_model(placed):
    scene, _ = placed
    again = mujoco.MjModel.from_xml_string(scene.mjcf)
    assert (again.nq, again.nv, again.nu, again.ngeom) == (
        scene.model.nq,
        scene.model.nv,
        scene.model.nu,
        scene.model.ngeom,
    )
    np.testing.assert_allclose(again.body_mass, scene.model.body_mass)
