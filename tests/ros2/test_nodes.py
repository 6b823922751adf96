"""Nodes of rclpy on trial: the examples through an office, and one broken in each way."""

import subprocess
from pathlib import Path

import pytest

from tests.ros2.conftest import EXAMPLES, HERE, PYTHON, started
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.trace import read_trace


def test_both_examples_drive_in_an_office_and_at_either_pace_the_chain_is_the_same(trial):
    brief = "episode.time_limit=4"
    with started(EXAMPLES / "gap_follower.py"):
        lockstep = trial("pace=lockstep", brief, world="office", name="lockstep")
    with started(EXAMPLES / "timer_controller.py"):
        timed = trial("pace=auto", brief, world="office", name="timed")
    assert (lockstep.outcome, lockstep.collisions) == ("timeout", 0)
    assert lockstep.path_length_m > 1.5
    assert lockstep.chain == timed.chain
    again = replay(Path(timed.log))
    assert again.identical, (again.differences, again.contradictions)


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("answers", ()),
        ("sensor_data", ()),
        # 1.2 MB to a reader of best effort
        ("cloud", ("sensors.lidar=ideal-lidar-dense", "episode.time_limit=0.2")),
    ],
)
def test_a_node_drives_by_any_quality_of_service(trial, kind, settings):
    with started(HERE / "node.py", kind):
        result = trial("pace=lockstep", "episode.time_limit=1", *settings)
    assert (result.outcome, result.decisions) == ("timeout", 3 if kind == "cloud" else 11)
    assert kind == "cloud" or result.path_length_m > 0.15


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("dies", "the publisher of /cmd_vel is gone"),
        ("restarts", "the publisher of /cmd_vel is gone"),
        ("two", "from two publishers"),
        ("latched_scan", "/scan is subscribed with transient local durability"),
    ],
)
def test_a_broken_node_ends_the_episode_in_one_line(trial, monkeypatch, kind, line):
    """A node that dies without a word is given up after the lease of its profile."""
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(HERE / "short_lease.xml"))
    with started(HERE / "node.py", kind):
        result = trial("pace=lockstep", "episode.time_limit=1")
    assert (result.outcome, result.cause) == ("error", "plugin_failed")
    assert line in result.reason
    assert "\n" not in result.reason


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("wrong_type", "/cmd_vel is published as geometry_msgs/msg/PoseStamped, expected"),
        ("best_effort_command", "/cmd_vel is published with best effort reliability"),
    ],
)
def test_commands_that_cannot_be_heard_are_refused_before_the_episode(trial, kind, line):
    with started(HERE / "node.py", kind), pytest.raises(InputError) as error:
        trial("pace=lockstep", "episode.time_limit=1")
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_a_node_that_ignores_stamps_is_stale_and_one_that_heeds_them_is_not(trial):
    stopped = 'perturbation={"kind": "sensor_stop", "severity": 3, "window": [1.0, 3.0]}'
    verdicts = {}
    for kind in ("ignores", "heeds"):
        with started(HERE / "node.py", kind):
            result = trial("pace=controller", "episode.time_limit=3", stopped, name=kind)
        assert result.outcome == "timeout"
        verdicts[kind] = read_trace(open_log(Path(result.log))).verdicts
    assert set(verdicts["ignores"][:10]) == set(verdicts["heeds"]) == {"admitted"}
    assert verdicts["ignores"].count("stale") >= 10


def test_the_parameters_for_nav2_are_read_by_ros():
    reader = (
        "import rclpy, sys; rclpy.init(args=['--ros-args', '--params-file', sys.argv[1]]);"
        "make = lambda name, namespace='': rclpy.create_node(name, namespace=namespace,"
        "  automatically_declare_parameters_from_overrides=True);"
        "print(make('controller_server').get_parameter('FollowPath.motion_model').value,"
        "  make('global_costmap', 'global_costmap').get_parameter('width').value)"
    )
    file = EXAMPLES.parent / "nav2/quadruped.yaml"
    words = [PYTHON, "-c", reader, str(file)]
    assert subprocess.run(words, capture_output=True, text=True).stdout.split() == ["Omni", "50"]
