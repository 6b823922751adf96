"""Lidar odometry in place of the recorded poses."""

import numpy as np
import pytest

from tests.harness.shadow.conftest import FR079, shadowed
from wayproof.harness.errors import InputError
from wayproof.harness.estimators.lidar_odometry import PLANAR_NAME
from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.inputs import Pose, SweepInput
from wayproof.harness.listed_beams import read_list
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.batches import batches
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.inputs import InputWriter
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import prepare

LIDAR = ["estimate.kind=lidar"]


@pytest.fixture(scope="module")
def log(robot, tmp_path_factory):
    """Fifteen seconds of a robot in an office."""
    path = tmp_path_factory.mktemp("odometry") / "log.mcap"
    return shadowed(FR079, robot, path, LIDAR, end=15.0)


def test_the_pose_is_the_odometrys_and_the_log_replays(log):
    poses = [one for one in read_messages(log) if isinstance(one, pb.Pose)]
    motions = open_log(log).motions()
    pairs = zip(poses, motions, strict=True)
    off = np.array([np.subtract(one.position, other.position) for one, other in pairs])
    assert {one.estimator for one in poses} == {PLANAR_NAME}
    assert 0.05 < np.abs(off[:, :2]).max() < 0.5  # from the wheels
    assert np.abs(off[:, 2]).max() < 0.01  # a planar laser measures no height
    assert np.mean([len(one.unheld) < 9 for one in poses]) > 0.9  # registered
    assert all(min(one.information) < 0.05 for one in poses)
    assert replay(log).identical


def test_an_office_is_drawn_sharper_than_by_its_wheels(robot):
    """By the former rule a fifth of the scans was registered, and 1 % of the whole run."""
    recording = open_recording(FR079)
    prepared = prepare(recording, find_body(str(robot)), LIDAR)
    writer = InputWriter(prepared, RecordedPerturbation(prepared.config, prepared.infos))
    beams = {info.name: beams_from_info(info) for info in prepared.infos}
    period = round(prepared.recorded.decision_period * 1e9)
    wheels, odometry, registered = [], [], []
    for sequence, batch in enumerate(batches(recording.sweeps(), period)):
        given = writer.write(batch, sequence)
        registered.append(len(given.pose.unheld) < 9)
        for message in given.sweeps:
            sweep = SweepInput(message.sensor, decode_ranges(message), None, read_list(message))
            for drawn, at in ((wheels, given.motion), (odometry, given.pose)):
                pose = Pose(np.array(at.position), np.array(at.quaternion), 0.0)
                points = beams[message.sensor].place(sweep, pose, sequence).points
                near = np.linalg.norm(points - pose.position, axis=1) < 6.0
                drawn.append(np.floor(points[near, :2] / 0.05).astype(int))
    cells = [len(np.unique(np.concatenate(one), axis=0)) for one in (wheels, odometry)]
    assert np.mean(registered) > 0.9
    assert cells[1] < 0.7 * cells[0]


def test_the_same_recording_gives_the_same_poses_twice(log, robot, tmp_path):
    again = shadowed(FR079, robot, tmp_path / "again.mcap", LIDAR, end=15.0)
    assert open_log(again).result["chain"] == open_log(log).result["chain"]


def test_ranges_that_are_off_change_the_pose(robot, tmp_path):
    noise = perturbation_from("depth_noise:3")
    path = shadowed(FR079, robot, tmp_path / "n.mcap", LIDAR, end=1.0, perturbation=noise)
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
        shadowed(FR079, robot, tmp_path / "no.mcap", settings, end=1.0, perturbation=off)
