"""Sweeps of the robots' own sensors as scans, clouds and images; poses as transforms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wayproof import Config, build, override
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.inputs import Inputs, Pose, SweepInput
from wayproof.harness.interface.observations import ObservationBuilder, task_of
from wayproof.harness.interface.ros2.messages import Time
from wayproof.harness.interface.ros2.options import Options
from wayproof.harness.interface.ros2.sensors import publications_of
from wayproof.harness.interface.ros2.transforms import (
    goal_pose,
    moving_transforms,
    odometry,
)
from wayproof.harness.scenario.scenario import sensor_info
from wayproof.models.poses import rotation_matrices
from wayproof.planners import hold

STAMP = Time(2, 500)


class Robot:
    """A robot in an empty world, whose sensors all report one range."""

    def __init__(self, robot, *settings):
        self.config = override(Config("empty", robot, 1), settings)
        scenario = build(self.config)
        infos = [sensor_info(caster) for caster in scenario.scene.casters]
        self.infos = {info.name: info for info in infos}
        self.task = task_of(self.config, scenario.mission, self.infos)
        self.publications = publications_of(self.task)

    def observation(self, millimetres, position=(1.0, 2.0, 0.3), heading=0.0):
        beams = {name: beams_from_info(info) for name, info in self.infos.items()}
        sweeps = tuple(
            SweepInput(name, np.full(info.beams, millimetres, np.uint16), None)
            for name, info in self.infos.items()
        )
        quaternion = np.array([math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)])
        pose = Pose(np.array(position), quaternion, 0.1, None, 0.02)
        builder = ObservationBuilder(self.config, self.task.mission, beams)
        followed = hold(np.array(position), 0, heading)
        builder.build(Inputs(0, 0, pose, sweeps, ""), followed, None)
        moved = Pose(np.array(position) + np.array([0.1, 0.0, 0.0]), quaternion, 0.1, None, 0.02)
        return builder.build(Inputs(100_000_000, 1, moved, sweeps, ""), followed, None)

    def messages(self, name, millimetres):
        (sweep,) = [one for one in self.observation(millimetres).sweeps if one.sensor == name]
        return dict(self.publications[name].messages(sweep, 1, STAMP))


@pytest.fixture(scope="module")
def quadruped():
    return Robot("quadruped")


@pytest.fixture(scope="module")
def drone():
    return Robot("drone")


def test_a_scan_is_the_flattest_row_counter_clockwise(quadruped):
    scan = quadruped.messages("lidar", 2000)["scan"]
    assert (scan.header.frame_id, scan.header.stamp) == ("lidar", STAMP)
    assert len(scan.ranges) == 625
    assert scan.angle_min == pytest.approx(-math.pi)
    assert scan.angle_max == pytest.approx(scan.angle_min + 624 * scan.angle_increment)
    assert scan.angle_increment == pytest.approx(2.0 * math.pi / 625)
    assert scan.ranges.tolist() == pytest.approx([2.0] * 625)
    assert (scan.range_max, scan.scan_time) == (12.0, 0.1)


@pytest.mark.parametrize(("millimetres", "there"), [(65535, np.isposinf), (0, np.isnan)])
def test_no_return_is_infinite_and_a_dropped_beam_is_not_a_number(quadruped, millimetres, there):
    messages = quadruped.messages("lidar", millimetres)
    assert there(messages["scan"].ranges).all()
    assert messages["points"].width == 0


def test_a_depth_image_is_along_the_axis_and_its_pinhole_fits(drone):
    messages = drone.messages("depth", 2000)
    image, info = messages["depth/image"], messages["depth/camera_info"]
    assert (image.encoding, image.height, image.width, image.step) == ("32FC1", 48, 64, 256)
    depth = image.data.view("<f4").reshape(48, 64)
    fx, _, cx, _, fy, cy, *_ = info.k.tolist()
    rows, columns = np.mgrid[0:48, 0:64]
    optical = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones((48, 64))], axis=-1)
    assert np.allclose(np.linalg.norm(optical * depth[..., None], axis=-1), 2.0, atol=1e-5)
    beams = drone.task.sensors["depth"].directions().reshape(48, 64, 3)
    x, y, z = np.moveaxis(optical / np.linalg.norm(optical, axis=-1, keepdims=True), -1, 0)
    assert np.allclose(np.stack([z, -x, -y], axis=-1), beams)
    assert image.header.frame_id == info.header.frame_id == "depth_optical"


def test_two_lidars_have_topics_of_their_own(quadruped):
    task = quadruped.task
    rear = {"lidar": task.sensors["lidar"], "rear": task.sensors["lidar"]}
    topics = [
        topic
        for one in publications_of(type(task)(**{**vars(task), "sensors": rear})).values()
        for topic in one.topics()
    ]
    first = ["points", "scan", "points/ranges"]
    assert topics == [*first, *(f"rear/{topic}" for topic in first)]


def test_a_lidar_without_rows_that_never_repeats_a_sweep_has_points_alone():
    solid = Robot("quadruped", "sensors.lidar=livox-mid360")
    assert list(solid.publications["lidar"].topics()) == ["points"]


def test_odometry_is_the_estimate_and_its_velocity_the_bodys(quadruped):
    observation = quadruped.observation(2000, heading=math.pi / 2)
    made = odometry(observation, Options(), STAMP)
    assert (made.header.frame_id, made.child_frame_id) == ("odom", "base_link")
    position, twist = made.pose.pose.position, made.twist.twist
    assert (position.x, position.y, position.z) == pytest.approx((1.1, 2.0, 0.3))
    assert (twist.linear.x, twist.linear.y) == pytest.approx((0.0, -1.0))
    covariance = made.pose.covariance.reshape(6, 6)
    assert np.diag(covariance) == pytest.approx([0.01, 0.01, 0.01, 0.0, 0.0, 0.0004])
    transform = moving_transforms(quadruped.task, observation, Options(), STAMP).transforms[0]
    assert transform.transform.translation.x == pytest.approx(1.1)
    assert transform.transform.rotation.z == pytest.approx(math.sin(math.pi / 4))


def test_odometry_has_the_covariance_that_an_estimator_states(quadruped):
    stated = np.diag([0.25, 0.01, 0.04, 0.09])
    stated[0, 1] = stated[1, 0] = 0.03
    observation = replace(quadruped.observation(2000), covariance=stated)
    covariance = odometry(observation, Options(), STAMP).pose.covariance.reshape(6, 6)
    assert np.diag(covariance) == pytest.approx([0.25, 0.01, 0.04, 0.0, 0.0, 0.09])
    assert covariance[0, 1] == covariance[1, 0] == 0.03


def test_the_footprint_is_below_a_tilted_body_and_keeps_its_heading(quadruped, drone):
    roll, heading = 0.3, 1.0
    tilted = replace(
        quadruped.observation(2000),
        quaternion=np.array(
            [
                math.cos(heading / 2) * math.cos(roll / 2),
                math.cos(heading / 2) * math.sin(roll / 2),
                math.sin(heading / 2) * math.sin(roll / 2),
                math.sin(heading / 2) * math.cos(roll / 2),
            ]
        ),
    )
    _base, footprint = moving_transforms(quadruped.task, tilted, Options(), STAMP).transforms
    assert (footprint.header.frame_id, footprint.child_frame_id) == ("base_link", "base_footprint")
    offset, rotation = footprint.transform.translation, footprint.transform.rotation
    q = [rotation.w, rotation.x, rotation.y, rotation.z]
    R_world_base = rotation_matrices(tilted.quaternion[None])[0]
    R_world_footprint = R_world_base @ rotation_matrices(np.array([q]))[0]
    c, s = math.cos(heading), math.sin(heading)
    assert R_world_footprint == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    at = tilted.position + R_world_base @ [offset.x, offset.y, offset.z]
    assert at == pytest.approx([*tilted.position[:2], 0.0])
    flying = drone.observation(2000)
    assert len(moving_transforms(drone.task, flying, Options(), STAMP).transforms) == 1


def test_the_next_goal_is_headed_away_from_the_one_before(quadruped):
    mission = replace(quadruped.task.mission, waypoints=((4.0, 3.0, 0.3), (4.0, 5.0, 0.3)))
    task = replace(quadruped.task, mission=mission)
    poses = [goal_pose(task, Options(), STAMP, reached).pose for reached in range(3)]
    assert [(one.position.x, one.position.y) for one in poses] == [
        *((4.0, 3.0), (4.0, 5.0)),
        mission.goal[:2],
    ]
    assert (poses[1].orientation.z, poses[1].orientation.w) == pytest.approx(
        (math.sin(math.pi / 4), math.cos(math.pi / 4))
    )
