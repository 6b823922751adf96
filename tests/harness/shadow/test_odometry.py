"""Lidar odometry in place of the recorded poses."""

import numpy as np
import pytest

from tests.harness.shadow.conftest import FR079, shadowed
from wayproof.harness.errors import InputError
from wayproof.harness.estimators.lidar_odometry import NAME
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb

LIDAR = ["estimate.kind=lidar"]


@pytest.fixture(scope="module")
def log(robot, tmp_path_factory):
    """Fifteen seconds of a robot in an office."""
    path = tmp_path_factory.mktemp("odometry") / "log.mcap"
    return shadowed(FR079, robot, path, LIDAR, end_s=15.0)


def test_the_pose_is_the_odometrys_and_the_log_replays(log):
    poses = [one for one in read_messages(log) if isinstance(one, pb.Pose)]
    motions = open_log(log).motions()
    pairs = zip(poses, motions, strict=True)
    off = np.array([np.subtract(one.position, other.position) for one, other in pairs])
    assert {one.estimator for one in poses} == {NAME}
    assert 0.0 < np.abs(off[:, :2]).max() < 0.1
    assert np.abs(off[:, 2]).max() < 0.01  # a planar laser measures no height
    covariance = np.array(poses[-1].covariance).reshape(4, 4)
    deviations = np.sqrt(np.diag(covariance)[:2])
    assert (np.abs(off[-1, :2]) < 4.0 * deviations).all()
    assert 0.02 < deviations.max() < 0.15
    assert all(min(one.information) < 0.05 for one in poses)
    assert replay(log).identical


def test_the_same_recording_gives_the_same_poses_twice(log, robot, tmp_path):
    again = shadowed(FR079, robot, tmp_path / "again.mcap", LIDAR, end_s=15.0)
    assert open_log(again).result["chain"] == open_log(log).result["chain"]


def test_ranges_that_are_off_change_the_pose(robot, tmp_path):
    noise = perturbation_from("depth_noise:3")
    path = shadowed(FR079, robot, tmp_path / "n.mcap", LIDAR, end_s=1.0, perturbation=noise)
    done = [one for one in read_messages(path) if isinstance(one, pb.Perturbation)]
    assert set(done[0].streams) == {"sensor/FLASER", "pose"}


@pytest.mark.parametrize(
    ("settings", "perturbation", "said"),
    [
        (["estimate.kind=truth"], None, "of a simulated episode; expected 'model'"),
        (LIDAR, "imu_bias:3", "changes inertial sensors, which the odometry of a recording"),
        (LIDAR, "pose_drift:3", "got 'lidar' with a perturbation of the pose"),
    ],
)
def test_what_a_recording_does_not_have_is_refused(settings, perturbation, said, robot, tmp_path):
    off = None if perturbation is None else perturbation_from(perturbation)
    with pytest.raises(InputError, match=said):
        shadowed(FR079, robot, tmp_path / "no.mcap", settings, end_s=1.0, perturbation=off)
