"""Lidar odometry on rooms and corridors whose truth is known, and in whole episodes."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.attribution.case import read_case
from wayproof.harness.counterfactual.remedies import go_on, nothing, true_pose
from wayproof.harness.errors import InputError
from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.lidar_odometry import NAME, LidarOdometry
from wayproof.harness.estimators.motion_filter import MotionFilter
from wayproof.harness.estimators.motion_sensors import Motion
from wayproof.harness.estimators.stated_covariance import (
    SYSTEMATIC,
    StatedCovariance,
    spread_of,
)
from wayproof.harness.estimators.surface_map import Registration, SurfaceMap, unregistered
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb

SHORT = ("estimate.kind=lidar", "episode.time_limit=1.5")


def corridor(centre, seed, half=(14.0, 1.1, 1.25), reach=12.0):
    """Returns within reach of a place in a bare corridor along x, relative to it."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (30_000, 3)) * half
    wall = rng.integers(0, 4, len(points))
    for side, (axis, sign) in enumerate([(1, 1), (1, -1), (2, 1), (2, -1)]):
        points[wall == side, axis] = sign * half[axis]
    points = points[np.abs(points[:, 0] - centre[0]) < reach] - centre
    return points + 0.01 * rng.standard_normal(points.shape)


def test_a_bare_corridor_does_not_hold_the_axis_along_it():
    surfaces, origin = SurfaceMap(0.3, held=0.04, registered_share=0.25), np.zeros(3)
    surfaces.add(corridor(origin, 0), np.zeros(3))
    predicted = np.array([0.2, 0.03, 0.0])
    found = surfaces.register(corridor(np.array([0.2, 0.0, 0.0]), 1) + predicted, predicted)
    (axis,) = found.unheld
    assert abs(axis[0]) > 0.999
    assert min(found.information) < 0.03
    assert abs(found.correction[0]) < 1e-3  # the prediction stays
    assert found.correction[1] == pytest.approx(-0.03, abs=3e-3)


def wall(x, seed):
    """Returns from a wall across the corridor."""
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (4000, 3)) * (0.0, 1.1, 1.25)
    return points + np.array([x, 0.0, 0.0])


def test_the_far_face_of_a_thin_wall_is_not_its_near_one():
    """The pose jumped by the thickness of a wall when the robot had come around it."""
    surfaces, before = SurfaceMap(0.3, held=0.04, registered_share=0.25), np.zeros(3)
    surfaces.add(np.concatenate([corridor(before, 0), wall(2.0, 2)]), before)
    beyond = np.array([3.5, 0.0, 0.0])
    sweep = np.concatenate([corridor(beyond, 1) + beyond, wall(2.1, 3)])
    found = surfaces.register(sweep, beyond)
    assert abs(found.correction[0]) < 1e-3
    assert len(found.unheld) == 1  # no face that it sees holds it along the corridor
    surfaces.add(sweep, beyond)
    near = surfaces.register(np.concatenate([corridor(before, 4), wall(2.0, 5)]), before)
    assert abs(near.correction[0]) < 3e-3
    assert len(near.unheld) == 0  # and the near one is as it was


def test_without_returns_nothing_is_held():
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.25)
    surfaces.add(corridor(np.zeros(3), 0), np.zeros(3))
    found = surfaces.register(np.zeros((0, 3)), np.zeros(3))
    assert (found.correction == 0.0).all()
    assert np.array_equal(found.unheld, np.eye(3))
    assert (found.information == 0.0).all()


def test_a_sweep_that_is_noise_holds_nothing():
    """A quarter of its points near planes by chance moved the pose by half a metre, unsaid."""
    surfaces = SurfaceMap(0.3, 0.04, EstimateConfig().registered_share)
    surfaces.add(corridor(np.zeros(3), 0), np.zeros(3))
    noisy = corridor(np.zeros(3), 1) + 0.4 * np.random.default_rng(2).standard_normal((1, 3))
    scattered = noisy + np.random.default_rng(3).normal(0.0, 0.5, noisy.shape)
    found = surfaces.register(scattered, np.zeros(3))
    assert found.inliers > 20
    assert (found.correction == 0.0).all()
    assert np.array_equal(found.unheld, np.eye(3))


def registered(*axes, anchors=((1.0, 1.0, 1.0, 1.0),), scatter=0.01):
    """A sweep of which an eighth is along each axis, by voxels of the sweeps `anchors`."""
    unheld = np.array(axes, float).reshape(-1, 3)
    held = np.eye(3) - unheld.T @ unheld
    information = np.full(3, 1 / 3)
    anchors = np.array(anchors)
    moment = np.diag([*(0.125 * np.diag(held)), 1.0])
    squares = scatter**2 * moment
    return Registration(np.zeros(4), information, unheld, 1000, scatter, moment, squares, anchors)


class Floorless(EstimateConfig):
    position_floor = heading_floor = surface_roughness = 0.0


class Unwalked(Floorless):
    motion_walk = 0.0


class SteadyGyro(Unwalked):
    gyro_bias, gyro_noise = 1e-3, 0.0


class Biased(EstimateConfig):
    accelerometer_bias, gyro_bias, gyro_noise = 0.1, 0.01, 0.0


EXACT_MAP = Unwalked(map_error_share=0.0, motion_share=0.1)
"""Registrations without any error."""


def test_the_covariance_grows_with_all_motion_that_nothing_held():
    covariance = StatedCovariance(EXACT_MAP)
    covariance.add_to_map(np.zeros(3), np.zeros((4, 4)))
    along, place = np.array([1.0, 0.0, 0.0]), np.zeros(3)
    for _ in range(100):
        covariance.predict(0.1 * along, 0.1, inertial=None)
        place = place + 0.1 * along
        covariance.correct(registered(along), place)
    assert covariance.position[0, 0] == pytest.approx(1.0)
    assert covariance.position[1, 1] == 0.0
    covariance.add_to_map(place, covariance.pose)
    lost = registered(anchors=[np.zeros(4), np.ones(4)])  # by what was mapped while it was lost
    covariance.correct(lost, place)
    assert covariance.position[0, 0] == pytest.approx(1.0)
    covariance.correct(registered(), place)  # by what was mapped at the start
    assert covariance.position[0, 0] == 0.0


def test_before_the_first_registration_nothing_is_held():
    covariance = StatedCovariance(EXACT_MAP)
    covariance.add_to_map(np.zeros(3), np.zeros((4, 4)))
    covariance.predict(np.array([0.3, 0.0, 0.4]), 0.1, inertial=None)
    assert covariance.position == pytest.approx(0.01 * np.outer([0.3, 0.0, 0.4], [0.3, 0.0, 0.4]))
    covariance.correct(registered(), np.zeros(3))
    assert not covariance.position.any()


def test_steps_along_what_nothing_holds_walk_to_the_side():
    """By hand: 16 m of steps at 12 mm for the root of a metre, by feet and not by inertia."""
    covariance = StatedCovariance(Floorless(map_error_share=0.0, motion_share=0.1))
    covariance.add_to_map(np.zeros(3), np.zeros((4, 4)))
    side = np.array([0.0, 1.0, 0.0])
    covariance.correct(registered(side), np.zeros(3))
    for _ in range(160):
        covariance.predict(np.array([0.1, 0.0, 0.0]), 0.1, inertial=None)
    assert math.sqrt(covariance.position[1, 1]) == pytest.approx(0.048)
    before = covariance.position[1, 1]
    covariance.predict(np.array([0.1, 0.0, 0.0]), 0.1, inertial=np.diag([2e-6, 1e-6, 0.0]))
    assert covariance.position[1, 1] - before == pytest.approx(1e-6)


def test_a_registration_is_as_uncertain_as_its_part_of_the_map():
    """By hand: 3 mm of its own beside 4 mm of the map, and a heading that was off over 5 m."""
    config = Floorless(map_error_share=0.5)
    covariance = StatedCovariance(config)
    covariance.add_to_map(np.zeros(3), np.diag([4e-3, 4e-3, 4e-3, 0.0]) ** 2)
    scatter = 3e-3 / (0.5 * math.sqrt((0.125 + SYSTEMATIC / 3.0) / 0.125**2))
    covariance.correct(registered(scatter=scatter), np.array([5.0, 0.0, 0.0]))
    assert np.sqrt(np.diag(covariance.position)) == pytest.approx([5e-3] * 3)
    covariance.add_to_map(np.zeros(3), np.diag([0.0, 0.0, 0.0, 1e-3]) ** 2)
    turned = registered(scatter=0.0, anchors=[np.zeros(4), np.ones(4)])
    covariance.correct(turned, np.array([5.0, 0.0, 0.0]))
    assert np.sqrt(np.diag(covariance.position)) == pytest.approx([0.0, 5e-3, 0.0])
    half = registered(scatter=0.0, anchors=np.full((2, 4), 0.5))
    covariance.correct(half, np.zeros(3))
    assert np.sqrt(np.diag(covariance.position)) == pytest.approx([4e-3 * math.sqrt(0.5)] * 3)


def test_a_floor_alone_does_not_hold_the_heading():
    config = SteadyGyro(map_error_share=0.0, motion_share=0.1)
    x, y, _ = np.eye(3)

    def after(lever):
        covariance = StatedCovariance(config)
        covariance.add_to_map(np.zeros(3), covariance.pose)
        floor = registered(x, y, scatter=0.0)
        floor.moment[3, 3] = lever
        for _ in range(100):
            covariance.predict(0.1 * x, 0.1, None)
            covariance.correct(floor, np.zeros(3))
        return math.sqrt(covariance.heading)

    assert after(1e-4) == pytest.approx(1e-3 * 10.0, rel=1e-3)
    assert after(1.0) < 1e-6


def test_an_axis_that_rough_surfaces_measure_is_less_certain():
    """By hand: what measures x is off ten times as far as what measures y and z."""
    even = registered(scatter=1e-3)
    rough = replace(even, scatter=even.scatter * np.array([100.0, 1.0, 1.0, 1.0]))
    expected = np.diag(spread_of(even, 0.0)) * (100.0, 1.0, 1.0, 1.0)
    np.testing.assert_allclose(np.diag(spread_of(rough, 0.0)), expected)
    planes = np.diag(spread_of(replace(even, scatter=np.zeros((4, 4))), 1e-3))
    np.testing.assert_allclose(planes, np.diag(spread_of(even, 0.0)))


def test_a_drone_that_stands_still_without_returns_drifts_by_its_accelerometer():
    """A position that nothing holds is off by half the bias times the square of the time."""
    config = Biased()
    covariance, motion = StatedCovariance(config), MotionFilter(config)
    covariance.add_to_map(np.zeros(3), covariance.pose)
    covariance.correct(unregistered(), np.zeros(3))
    for _ in range(100):
        grown = motion.predict(np.zeros(3), 0.1, np.eye(3))
        covariance.predict(np.zeros(3), 0.1, grown)
    for axis in range(3):
        sigma = math.sqrt(covariance.position[axis, axis])
        assert sigma == pytest.approx(0.5 * 0.1 * 10.0**2, rel=0.05)
    assert math.sqrt(covariance.heading) == pytest.approx(0.01 * 10.0, rel=1e-3)
    covariance.correct(registered(), np.zeros(3))
    for axis in range(3):  # held by the map again
        assert math.sqrt(covariance.position[axis, axis]) < 0.1


def test_a_position_that_is_regained_says_nothing_of_the_velocity():
    """It is that of a map that the same prediction may have placed."""

    def after(config, directions):
        motion = MotionFilter(config)
        for _ in range(100):
            motion.predict(np.zeros(3), 0.1, np.eye(3))
        before = motion.covariance
        motion.decorrelate(np.array(directions).reshape(-1, 3))
        change = motion.update(1e6 * np.eye(4), np.array([0.1, 0.1, 0.1]), np.zeros((0, 3)))
        return before, motion.covariance, change

    config = Biased()
    before, now, change = after(config, [])
    assert (np.abs(change) > 1e-3).all()
    assert (np.diag(now)[3:6] < 0.1 * np.diag(before)[3:6]).all()
    before, now, change = after(config, [[1.0, 0.0, 0.0]])
    assert abs(change[0]) < 1e-9 < abs(change[1])
    assert now[3, 3] == pytest.approx(before[3, 3])
    assert now[4, 4] < 0.1 * before[4, 4]
    assert math.sqrt(now[0, 0]) == pytest.approx(1e-3, rel=0.01)  # the position is the sweep's
    assert np.linalg.eigvalsh(now).min() > -1e-12


class Still:
    """Sensors of motion of a body at rest, whose accelerometer is off by 0.1 m/s^2 along x."""

    period = 0.1

    def measure(self, turn):
        fall = np.array([0.1, 0.0, 0.0]) * self.period
        return Motion(fall, turn, None, axes=np.eye(3))

    def state(self):
        return {}

    def restore(self, state):
        pass


def test_sweeps_that_contradict_the_map_are_not_mapped():
    """Mapped where they were predicted, they confirmed a prediction that went off by metres."""
    odometry = LidarOdometry(EstimateConfig(), np.zeros(3), 0.0, Still())
    rng, walls = np.random.default_rng(0), corridor(np.zeros(3), 0)
    odometry.correct(walls)
    odometry.add_to_map(walls, np.zeros(3), odometry.covariance.pose)
    for _ in range(30):
        odometry.advance(np.zeros(3), 0.0)
        noisy = corridor(np.zeros(3), 1) + rng.normal(0.0, 0.4, (1, 3))
        noisy = noisy + rng.normal(0.0, 0.4, noisy.shape)
        at = np.array(odometry.error.shift)
        assert odometry.correct(noisy + at).shift == (0.0, 0.0, 0.0)
        odometry.add_to_map(noisy + at, at, odometry.covariance.pose)
    assert odometry.error.shift[0] == pytest.approx(0.5 * 0.1 * 3.0**2, rel=0.01)
    moved = odometry.correct(corridor(np.zeros(3), 2) + np.array(odometry.error.shift))
    assert moved.shift[1] == pytest.approx(0.0, abs=5e-3)
    assert len(odometry.covariance.axes) == 1  # registered, with the corridor of the start


@pytest.mark.large
def test_the_check_of_a_cause_goes_on_from_the_same_map(tmp_path):
    """The control of a counterfactual ends as the log does, and the true pose is the truth."""
    path = tmp_path / "log.mcap"
    config = override(Config("office", "drone", 2), SHORT)
    run_episode(build(config), path)
    log = open_log(path)
    case = read_case(log)
    control = go_on(log, case, nothing(log, case), at=8, limit_s=1.5)
    assert control.chain == log.result["chain"]
    assert true_pose(log, case).config.estimate.kind == "truth"


def test_a_perturbation_of_sweeps_declares_that_it_changes_the_lidars_pose(tmp_path):
    declared = {}
    for kind in ("model", "lidar"):
        settings = [
            'perturbation={"kind": "depth_noise", "severity": 1}',
            f"estimate.kind={kind}",
            "episode.time_limit=0.3",
        ]
        path = tmp_path / f"{kind}.mcap"
        run_episode(build(override(Config("office", "drone", 2), settings)), path)
        records = [one for one in read_messages(path) if isinstance(one, pb.Perturbation)]
        declared[kind] = "pose" in records[0].streams
    assert declared == {"model": False, "lidar": True}


def errors_of(path):
    """Estimated minus true position of each decision, (n, 3) m, and the logged poses."""
    messages = list(read_messages(Path(path)))
    poses = {one.sequence: one for one in messages if isinstance(one, pb.Pose)}
    truths = {one.sequence: one for one in messages if isinstance(one, pb.Truth)}
    off = [np.subtract(poses[k].position, truths[k].position) for k in truths]
    return np.array(off), [poses[k] for k in truths]


@pytest.fixture(scope="module", params=["quadruped", "drone"])
def episode(request, tmp_path_factory):
    """A second and a half of an office, whose pose is the lidar's."""
    path = tmp_path_factory.mktemp("lidar") / f"{request.param}.mcap"
    return run_episode(build(override(Config("office", request.param, 2), SHORT)), path)


@pytest.mark.few(1)
def test_the_estimate_is_millimetres_off_and_says_so(episode):
    off, poses = errors_of(episode.log)
    assert np.abs(off[-1]).max() < 0.01
    assert np.abs(off).max() > 0.0  # it is no truth
    covariance = np.array(poses[-1].covariance).reshape(4, 4)
    assert poses[-1].estimator == NAME
    assert poses[-1].position_sigma == pytest.approx(
        math.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])
    )
    assert sum(poses[-1].information) == pytest.approx(1.0)


@pytest.mark.few(1)
def test_it_replays_is_simulated_again_and_forked_to_the_same_chain(episode, tmp_path):
    path = Path(episode.log)
    assert replay(path).identical
    assert simulate_again(path).identical
    forked = fork(path, 8, [], tmp_path / "fork.mcap")
    assert forked.chain == episode.chain


def test_a_rolling_sweep_is_straightened_by_the_estimates_own_motion(tmp_path):
    settings = [*SHORT, "sensors.lidar=ouster-os1-64"]
    config = override(Config("office", "quadruped", 2), settings)
    result = run_episode(build(config), tmp_path / "rolling.mcap")
    off, poses = errors_of(result.log)
    assert np.abs(off[-1]).max() < 0.03
    assert len(poses[-1].history_positions) > 3
    assert replay(Path(result.log)).identical


def test_the_truth_is_the_truth(tmp_path):
    config = override(
        Config("empty", "drone", 1), ["estimate.kind=truth", "episode.time_limit=0.5"]
    )
    result = run_episode(build(config), tmp_path / "truth.mcap")
    off, poses = errors_of(result.log)
    assert (off == 0.0).all()
    assert poses[-1].position_sigma == 0.0
    assert open_log(Path(result.log)).config.estimate.kind == "truth"


def test_a_perturbed_pose_needs_the_model():
    with pytest.raises(InputError, match=r"estimate.kind: got 'lidar' with a perturbation"):
        override(
            Config("empty", "drone", 1),
            ['perturbation={"kind": "pose_drift", "severity": 1}', "estimate.kind=lidar"],
        )


def test_wheels_do_not_leave_the_ground():
    step, none = np.array([0.3, 0.0, 0.0]), (np.zeros(2), np.zeros(2))
    config = Floorless(map_error_share=0.0, motion_share=0.1)
    feet, wheels = StatedCovariance(config), StatedCovariance(config)
    height = float(wheels.pose[2, 2])
    for _ in range(100):
        feet.predict(step, 0.1, None)
        wheels.predict(step, 0.1, None, astray=none)
    assert wheels.pose[2, 2] == height
    assert feet.pose[2, 2] > height
    assert wheels.pose[:2, :2].tobytes() == feet.pose[:2, :2].tobytes()
