"""ROS 2 stacks on trial, end to end: two processes, Cyclone DDS in both, no ROS."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.ros2_latency import measure
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.errors import InputError
from wayproof.harness.interface.command_messages import costmap_of, planned_path_of
from wayproof.harness.interface.connect import connect
from wayproof.harness.replay.answers import compare_answers
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import stack_pb2 as sb

CLIENT = Path(__file__).with_name("client.py")
DOMAIN = 100 + os.getpid() % 100


@contextlib.contextmanager
def node(*kinds):
    """Processes of the client, which end with the block."""
    children = [
        subprocess.Popen([sys.executable, str(CLIENT), str(DOMAIN), kind]) for kind in kinds
    ]
    try:
        yield
    finally:
        for child in children:
            child.kill()
            child.wait()


def trial(folder, options, *settings, name="a"):
    stack = f"stack.name=ros2:domain={DOMAIN},{options}"
    quick = ("episode.time_limit=1.0", "plugins.wall_s=30")
    config = override(Config("empty", "quadruped", 1), [*quick, *settings, stack])
    return run_episode(build(config), folder / f"{name}.mcap")


def answers(result):
    log = open_log(Path(result.log))
    return [sb.Command.FromString(one.answer.command) for one in log.records()]


@pytest.fixture(scope="module")
def lockstep(tmp_path_factory):
    """An episode of a node in lockstep."""
    with node("Client"):
        return trial(tmp_path_factory.mktemp("lockstep"), "pace=lockstep")


def test_a_node_in_lockstep_drives_and_the_log_replays_without_it(lockstep):
    assert lockstep.outcome == "timeout"
    assert lockstep.path_length_m > 0.15
    again = replay(Path(lockstep.log))
    assert again.identical, (again.differences, again.contradictions)


def test_what_was_received_and_when_is_in_the_log(lockstep):
    received = [dict(one.scalars) for one in answers(lockstep)]
    times = [round(0.1 * k, 6) for k in range(len(received))]
    assert [round(one["ros2.received_s"], 6) for one in received] == times
    assert [round(one["ros2.stamp_s"], 6) for one in received] == times
    assert answers(lockstep)[0].velocity.forward == 0.3


def test_a_second_run_gives_the_same_chain_though_the_first_sweep_came_twice(lockstep, tmp_path):
    with node("Repeats"):
        assert trial(tmp_path, "pace=lockstep").chain == lockstep.chain


def test_the_node_asked_again_on_the_log_answers_alike(lockstep):
    with node("Client"):
        comparison = compare_answers(Path(lockstep.log), f"ros2:domain={DOMAIN},pace=lockstep")
    assert comparison.identical
    assert comparison.answers == lockstep.decisions


def test_a_node_with_a_timer_is_found_out_and_slow_or_not_gives_the_same_chain(tmp_path):
    with node("Timer"):
        quick = trial(tmp_path, "pace=auto", name="quick")
    with node("SlowTimer"):
        slow = trial(tmp_path, "pace=controller", name="slow")
    assert quick.outcome == slow.outcome == "timeout"
    assert quick.chain == slow.chain
    received = [one.scalars["ros2.received_s"] for one in answers(slow)]
    assert received == pytest.approx([0.1 * k + 0.05 for k in range(len(received))])


def test_a_plan_and_a_costmap_go_into_the_log(tmp_path):
    with node("Plans"):
        result = trial(tmp_path, "pace=lockstep", "episode.time_limit=0.5")
    last = answers(result)[-1]
    assert planned_path_of(last).tolist() == [[1.0, 0.5, 0.0], [2.0, 0.5, 0.0], [3.0, 0.5, 0.0]]
    costmap = costmap_of(last)
    assert costmap.cells.tolist() == [[0, 50, 100], [-1, -1, 99]]
    assert (costmap.origin.tolist(), costmap.resolution) == ([-1.0, -2.0], 0.5)
    assert replay(Path(result.log)).identical


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("kind", "options", "line"),
    [
        ("Dies", "pace=lockstep", "ended: the publisher of /cmd_vel is gone"),
        ("Restarts", "pace=lockstep", "/cmd_vel"),
        ("Two", "pace=lockstep", "sent /cmd_vel from two publishers"),
        ("OwnTime", "pace=lockstep", "the pace is ros2:pace=controller"),
        ("PlainTwist", "pace=lockstep", "answered with a Twist, which has no stamp"),
        ("NotANumber", "pace=lockstep", "expected finite numbers"),
        ("WrongFrame", "pace=lockstep", "in frame 'map', expected 'base_link'"),
        ("Silent", "pace=lockstep", "had not answered the sweep of 1.000000000 s"),
        ("Silent", "pace=controller", "had sent no command after 2 s"),
        ("Timer", "controller_frequency=40", "in a controller period of 0.025 s"),
    ],
)
def test_a_broken_node_ends_the_episode_in_one_line(tmp_path, kind, options, line):
    with node(kind):
        waits = "plugins.wall_s=2" if kind in ("Silent", "Timer") else "plugins.wall_s=30"
        result = trial(tmp_path, options, waits)
    assert result.outcome == "error"
    assert line in result.reason
    assert "\n" not in result.reason
    assert result.cause == "plugin_failed"
    assert result.decisions == 0 or replay(Path(result.log)).identical


def test_periods_may_pass_in_silence_where_that_is_set_and_a_twist_needs_no_stamp(tmp_path):
    with node("OnceInAWhile"):
        result = trial(tmp_path, "pace=controller,silence=0.1")
    assert result.outcome == "timeout"
    silent = [one.scalars["ros2.silent"] for one in answers(result) if one.scalars["ros2.silent"]]
    assert 0 < len(silent) < result.decisions
    assert "ros2.stamp_s" not in answers(result)[0].scalars
    assert replay(Path(result.log)).identical


def test_a_node_that_never_comes_is_refused_in_one_line():
    with pytest.raises(InputError, match="nothing published /cmd_vel") as error:
        connect_within(0.3, "ros2:pace=lockstep")
    assert "\n" not in str(error.value)


@pytest.mark.large
def test_a_node_that_joins_late_is_waited_for(tmp_path):
    script = f"sleep 3; exec {sys.executable} {CLIENT} {DOMAIN} Client"
    with subprocess.Popen(["sh", "-c", script]) as child:
        try:
            assert trial(tmp_path, "pace=lockstep").outcome == "timeout"
        finally:
            child.kill()


def test_a_publisher_of_another_type_is_named():
    with node("WrongType"), pytest.raises(InputError) as error:
        connect_within(20.0, "ros2")
    assert "/cmd_vel is published as geometry_msgs/msg/PoseStamped" in str(error.value)


def test_a_command_that_takes_effect_before_it_is_made_is_refused(tmp_path):
    with node("Timer"), pytest.raises(InputError) as error:
        trial(tmp_path, "pace=controller,controller_frequency=10")
    assert "a command is made up to 0.1 s after its sweep" in str(error.value)
    assert not list(tmp_path.iterdir())


def test_round_trips_are_measured():
    with node("Client"):
        latencies = measure(f"ros2:domain={DOMAIN},pace=lockstep", "own", 5)
    assert len(latencies) == 5
    assert (latencies > 0.0).all()


def connect_within(starting_s, name):
    from wayproof.harness.interface.ros2.stack import Ros2Stack

    name = name if ":" in name else f"{name}:"
    Ros2Stack(f"{name}{',' if name[-1] != ':' else ''}domain={DOMAIN}", 1.0, starting_s)


def test_the_extra_is_named_where_it_is_missing(monkeypatch):
    for module in [one for one in sys.modules if one.startswith("wayproof.harness.interface.ros2")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    with pytest.raises(InputError, match=r"pip install cyclonedds"):
        connect("ros2", 1.0)
