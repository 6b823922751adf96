"""World and robot in one model: what the sensors see, and what is true."""

import dataclasses

import mujoco
import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from tests.models.watching import watch
from wayproof.models.poses import Trail
from wayproof.models.robots import ROBOTS, Setpoint
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.scene import compose, mount_devices, resolve
from wayproof.models.sensors.beams import NO_RETURN, directions, pose_indices
from wayproof.models.sensors.caster import ROBOT_GROUP, SweepCaster
from wayproof.models.sensors.devices import DEVICES, Mount, SensorConfig
from wayproof.models.truth import Truth


@pytest.fixture(params=sorted(ROBOTS))
def placed(request):
    """A scene of warehouse 0 with the robot at its start, and its data."""
    world, robot = drawn("warehouse", 0), ROBOTS[request.param]
    scene = compose(world, robot)
    data = mujoco.MjData(scene.model)
    start = np.array([*world.start[:2], robot.spec.rest_height])
    scene.controller.reset(data, start, world.start_heading)
    mujoco.mj_kinematics(scene.model, data)
    return scene, data


def at_rest(scene, data):
    return Trail(data.xpos[scene.base][None].copy(), data.xquat[scene.base][None].copy(), 0.002)


def test_every_beam_is_what_mj_ray_says(placed):
    scene, data = placed
    groups = np.ones(mujoco.mjNGROUP, np.uint8)
    groups[ROBOT_GROUP] = 0
    geom = np.zeros(1, np.int32)
    for caster in scene.casters:
        ranges = caster.cast(data, at_rest(scene, data), 0, 0)
        position, R_base_sensor = caster.mounting
        beams = directions(caster.table, 0)
        R_world_base = data.xmat[scene.base].reshape(3, 3)
        origin = data.xpos[scene.base] + R_world_base @ position
        for beam in range(0, len(ranges), max(len(ranges) // 200, 1)):
            ray = R_world_base @ R_base_sensor @ beams[beam]
            args = (scene.model, data, origin, ray, groups, 1, -1, geom)
            distance = mujoco.mj_ray(*args)
            if distance < 0 or distance > caster.mount.device.range:
                assert ranges[beam] == NO_RETURN
            else:
                assert abs(int(ranges[beam]) - 1000 * distance) <= 0.5 + 1e-6


def rolling_trail(scene, data):
    """A tenth of a second at 2 m/s and 1.5 rad/s that ends where the robot is."""
    times = np.arange(-50, 1) * 0.002
    turned = np.stack([np.cos(0.75 * times), *(2 * [0.0 * times]), np.sin(0.75 * times)], axis=1)
    quaternions = np.empty((51, 4))
    for quaternion, turn in zip(quaternions, turned, strict=True):
        mujoco.mju_mulQuat(quaternion, turn, data.xquat[scene.base])
    along = np.array([2.0, 0.5, 0.1])
    return Trail(data.xpos[scene.base] + times[:, None] * along, quaternions, 0.002)


@pytest.mark.parametrize("engine", ["tile", "mujoco"])
def test_a_rolling_shutter_sees_from_where_the_sensor_was(placed, engine):
    """Each beam against mj_ray from its own scan pose, found here by hand."""
    scene, data = placed
    device = dataclasses.replace(DEVICES["ideal-lidar-floor"], azimuths=40, scan_poses=40)
    mount = Mount("lidar", "lidar", device)
    config = SensorConfig(engine=engine)
    caster = SweepCaster(scene.model, mount, scene.base, ROBOT_PREFIX, config)
    trail = rolling_trail(scene, data)
    ranges = caster.cast(data, trail, 0, 0)
    position, R_base_sensor = caster.mounting
    groups = np.ones(mujoco.mjNGROUP, np.uint8)
    groups[ROBOT_GROUP] = 0
    beams, when, geom, R = (
        directions(caster.table, 0),
        pose_indices(caster.table),
        np.zeros(1, np.int32),
        np.empty(9),
    )
    differs = 0
    for beam in range(0, len(ranges), 7):
        pose = 50 - 50 * (39 - when[beam]) / 40  # of the trail's 51
        early, late = int(np.floor(pose)), int(np.ceil(pose))
        share = pose - early
        at = (1 - share) * trail.positions[early] + share * trail.positions[late]
        quaternion = (1 - share) * trail.quaternions[early] + share * trail.quaternions[late]
        mujoco.mju_quat2Mat(R, quaternion / np.linalg.norm(quaternion))
        R_world_base = R.reshape(3, 3)
        origin, ray = at + R_world_base @ position, R_world_base @ R_base_sensor @ beams[beam]
        distance = mujoco.mj_ray(scene.model, data, origin, ray, groups, 1, -1, geom)
        if distance < 0 or distance > device.range:
            assert ranges[beam] == NO_RETURN
            continue
        assert abs(int(ranges[beam]) - 1000 * distance) <= 0.5 + 1e-6
        frozen = data.xpos[scene.base] + data.xmat[scene.base].reshape(3, 3) @ position
        still = mujoco.mj_ray(scene.model, data, frozen, ray, groups, 1, -1, geom)
        differs += abs(still - distance) > 0.01
    assert differs > 20  # the motion is no matter of millimetres


def test_devices_are_mounted_by_name():
    mounts = ROBOTS["drone"].spec.mounts
    fitted = mount_devices(mounts, SensorConfig(lidar="ouster-os1-64"))
    assert [mount.name for mount in fitted] == [mount.name for mount in mounts]
    assert fitted[0].device is DEVICES["ouster-os1-64"]
    assert fitted[1:] == mounts[1:]
    resolved = resolve(mounts, SensorConfig(lidar="ouster-os1-64"))
    assert (resolved.lidar, resolved.depth) == ("ouster-os1-64", "ideal-depth-camera")


@pytest.mark.parametrize(
    ("robot", "config", "said"),
    [
        ("quadruped", SensorConfig(depth="intel-realsense-d435"), "no mount 'depth'"),
        ("drone", SensorConfig(lidar="benewake-tfmini-s"), "expected a lidar or a camera"),
        ("drone", SensorConfig(lidar="radar"), "got 'radar', expected a lidar or a camera"),
    ],
)
def test_devices_that_do_not_fit_are_refused(robot, config, said):
    with pytest.raises(ValueError, match=said):
        mount_devices(ROBOTS[robot].spec.mounts, config)


def test_clearance_is_the_least_over_all_pairs(placed):
    scene, data = placed
    model = scene.model
    robot = np.flatnonzero(model.geom_group == ROBOT_GROUP)
    world = [geom for geom in np.flatnonzero(model.geom_group == 0) if geom not in scene.floor]
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
    world = drawn("warehouse", 0)
    into_the_wall = np.array([-1.0, world.start[1], data.xpos[scene.base, 2]])
    start = data.xpos[scene.base].copy()
    for tick in range(2500):
        share = min(tick / 2000, 1.0)
        position = start + share * (into_the_wall - start)
        velocity = (into_the_wall - start) / 4.0
        setpoint = Setpoint(tuple(position), tuple(velocity), np.pi, 0.0)
        scene.controller.follow(data, setpoint)
        mujoco.mj_step(scene.model, data)
        watch(truth, data, scene.base)
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
