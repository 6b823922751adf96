"""Bags of logs, read back by rosbags with the definitions that travel in them."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from wayproof.harness.cli.main import main
from wayproof.harness.decision import path_of
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.ros_bag import occupancy_of_costs
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.costmap.nav2_costs import costs_of

LOG = Path(__file__).parents[1] / "logs/small.mcap"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    out = tmp_path_factory.mktemp("bag") / "out"
    assert main(["export", str(LOG), "--bag", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def messages(bag):
    """Messages by topic, decoded by the definitions in the bag alone."""
    found = {}
    with AnyReader([bag]) as reader:
        for connection, stamp, data in reader.messages():
            decoded = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, decoded))
    return found


def test_every_topic_is_there(messages):
    robot = {"/tf", "/tf_static", "/odom", "/lidar", "/lidar/no_return", "/lidar/limits"}
    assert set(messages) == robot | {"/map", "/costmap", "/costmap_raw", "/plan", "/trajectory"}


def test_the_grids_of_the_last_decision_are_its_costmap(messages):
    for moment in moments(open_log(LOG)):
        costmap = moment.costmap
    stamp, grid = messages["/map"][-1]
    assert stamp == moment.time_ns
    info = grid.info
    assert (info.width, info.height) == costmap.shape[:2]
    assert info.resolution == np.float32(costmap.resolution)
    assert [info.origin.position.x, info.origin.position.y] == costmap.origin[:2].tolist()
    cells = grid.data.reshape(info.height, info.width).T
    states = costmap.state[:, :, 0]
    for state, value in ((UNKNOWN, -1), (FREE, 0), (OCCUPIED, 100)):
        assert np.array_equal(cells == value, states == state)
    costs = messages["/costmap_raw"][-1][1]
    expected = costs_of(costmap, 0, moment.decision.collision_distance_sq)
    assert np.array_equal(costs.data.reshape(info.height, info.width).T, expected)
    shown = messages["/costmap"][-1][1].data.reshape(info.height, info.width).T
    assert np.array_equal(shown, occupancy_of_costs()[expected])


def test_costs_are_on_the_scale_of_nav2():
    for moment in moments(open_log(LOG)):
        costmap, limit = moment.costmap, moment.decision.collision_distance_sq
    costs, states = costs_of(costmap, 0, limit), costmap.state[:, :, 0]
    distances = costmap.obstacle_clearance[:, :, 0]
    assert (costs[states == UNKNOWN] == 255).all()
    assert (costs[states == OCCUPIED] == 254).all()
    free = states == FREE
    assert (costs[free & (distances <= limit)] == 253).all()
    beyond = free & (distances > limit)
    assert costs[beyond].max() <= 252
    metres = np.sqrt(distances[beyond]) * costmap.resolution - costmap.inflation_radius
    law = 252.0 * np.exp(-costmap.config.cost_scaling_factor * np.maximum(metres, 0.0))
    in_reach = distances[beyond] < costmap.truncation
    assert np.abs(costs[beyond][in_reach] - np.floor(law[in_reach])).max() <= 1
    assert occupancy_of_costs()[[0, 1, 252, 253, 254, 255]].tolist() == [0, 1, 98, 99, 100, -1]


def test_paths_are_those_of_the_decisions(messages):
    decisions = list(open_log(LOG).decisions())
    for topic, part in (
        ("/plan", lambda one: path_of(one.global_path)),
        ("/trajectory", lambda one: path_of(one.trajectory.path)),
    ):
        assert len(messages[topic]) == len(decisions)
        for (_, message), decision in zip(messages[topic], decisions, strict=True):
            places = [pose.pose.position for pose in message.poses]
            points = np.array([[place.x, place.y, place.z] for place in places]).reshape(-1, 3)
            assert np.array_equal(points, part(decision))


def test_the_recording_is_that_of_the_log(bag):
    from tests.harness.recordings.bags.test_writing import check_same

    check_same(open_recording(LOG), open_recording(bag))


def test_a_recording_is_converted_by_the_verb(tmp_path, capsys):
    scans = Path(__file__).parents[3] / "examples/recordings/fr079/fr079-200.clf.bz2"
    out = tmp_path / "fr079.bag"
    assert main(["export", str(scans), "--bag", str(out)]) == 0
    assert "messages 601" in capsys.readouterr().out
    assert len(list(open_recording(out).sweeps())) == 200
    again = tmp_path / "again"
    arguments = ["--storage", "sqlite", "--sensor", "FLASER", "--pose", "odom"]
    assert main(["export", str(out), "--bag", str(again), *arguments]) == 0
    options = RecordingOptions(sensors=("FLASER",))
    assert len(list(open_recording(again, options=options).sweeps())) == 200


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--bag", "x.mcap"], "--bag: got 'x.mcap', expected a FILE.bag, or the name of a folder"),
        (["--bag", "."], "exists already"),
        (["--bag", "x", "--sensor", "y"], "unknown sensor of the recording 'y'"),
    ],
)
def test_names_that_cannot_be_written_are_refused(options, said, capsys):
    assert main(["export", str(LOG), *options]) == 2
    assert said in capsys.readouterr().err
