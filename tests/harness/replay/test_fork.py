"""Forks: an episode resumed with other settings."""

import json
from pathlib import Path

import pytest

from tests.harness.replay.episodes import SHORT
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.copy import thin
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.answers import restarted_stack
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb


@pytest.mark.parametrize(("robot", "at"), [("drone", 0), ("quadruped", 13)])
def test_a_fork_without_a_change_ends_alike(recorded, tmp_path, robot, at):
    result = recorded(*SHORT[robot])
    forked = fork(Path(result.log), at, (), tmp_path / "fork.mcap")
    assert forked.chain == result.chain
    assert packets(Path(forked.log)) == packets(Path(result.log))
    assert replay(Path(forked.log)).identical


def test_a_fork_among_movers_ends_alike(recorded, tmp_path):
    result = recorded("ghosts", "quadruped", 4, "episode.time_limit=2")
    assert any(one.movers for one in open_log(Path(result.log)).truth())
    forked = fork(Path(result.log), 15, (), tmp_path / "fork.mcap")
    assert forked.chain == result.chain
    assert packets(Path(forked.log)) == packets(Path(result.log))


def packets(path):
    """Every message but those of the sensors' tables and the measured times, in file order."""
    found = []
    for item in walk(path):
        if not isinstance(item, Packet) or item.topic.endswith("/info") or "before" in item.topic:
            continue
        data = item.data
        if item.topic == "/decision":
            decision = pb.Decision.FromString(data)
            decision.ClearField("stages")
            data = decision.SerializeToString(deterministic=True)
        found.append((item.topic, item.time_ns, data))
    return found


def test_a_fork_with_a_change_keeps_the_past_and_replays(recorded, tmp_path):
    result = recorded(*SHORT["quadruped"])
    forked = fork(Path(result.log), 12, ["planner.name=rrtconnect"], tmp_path / "fork.mcap")
    assert packets(Path(forked.log))[:40] == packets(Path(result.log))[:40]
    log = open_log(Path(forked.log))
    assert log.config.start == open_log(Path(result.log)).config.start
    assert (log.fork.at, log.fork.config.map.resolution) == (12, 0.1)
    assert replay(Path(forked.log)).identical
    assert forked.chain != result.chain


def test_a_fork_can_save_the_robot(tmp_path, capsys):
    """A stack too slow for its deadline never moves; in time from decision 3 on, it arrives."""
    slow = ["--set", "latency.plan=0.5", "--set", "latency.deadline=0.1"]
    run = ["run", "empty", "--robot", "drone", "--seed", "1", *slow]
    assert main([*run, "--set", "episode.time_limit=1", "--log", f"{tmp_path}/a.mcap"]) == 1
    change = ["--set", "latency.plan=0.02", "--set", "episode.time_limit=30"]
    capsys.readouterr()
    code = main(["replay", "fork", f"{tmp_path}/a.mcap", "3", *change, "--json"])
    document = json.loads(capsys.readouterr().out)
    assert (code, document["recorded_outcome"], document["outcome"]) == (0, "timeout", "success")
    assert Path(document["log"]).name.startswith("a-from-3-")
    assert replay(Path(document["log"])).identical


@pytest.mark.few(1)
@pytest.mark.parametrize("at", [8, 15])
def test_a_fork_can_be_forked_again(recorded, tmp_path, at):
    """Before and after the first fork; other cells, then another lidar, then neither."""
    result = recorded(*SHORT["quadruped"])
    first = fork(Path(result.log), 12, ["map.resolution=0.08"], tmp_path / "first.mcap")
    same = fork(Path(first.log), at, (), tmp_path / "same.mcap")
    assert same.chain == (result.chain if at < 12 else first.chain)
    assert replay(Path(same.log)).identical
    settings = ["sensors.lidar=velodyne-vlp16", "episode.time_limit=1.8"]
    second = fork(Path(first.log), at, settings, tmp_path / "second.mcap")
    log = open_log(Path(second.log))
    assert [one.at for one in log.forks] == ([at] if at < 12 else [12, at])
    assert log.config.map.resolution == (0.1 if at < 12 else 0.08)
    assert log.forks[-1].beams["lidar"].table.beams != log.beams["lidar"].table.beams
    assert replay(Path(second.log)).identical


def test_a_fork_is_read_with_the_settings_and_the_goal_of_each_decision(recorded, tmp_path):
    change = ["map.resolution=0.08", "costmap.localization_margin=0.2", "goal=[9.0,3.0]"]
    path = Path(fork(Path(recorded(*SHORT["quadruped"]).log), 12, change, tmp_path / "f.mcap").log)
    assert replay(path).identical
    found = audit(path)
    assert found.decisions == 21
    assert found.swept > 5
    assert found.violations == ()
    thin(path)
    assert [one.at for one in open_log(path).forks] == [12]


BLIND = ("cylinders", "drone", 6, "stack.name=blind")


def test_a_fork_of_a_stack_on_trial_goes_on_with_the_stack(recorded, tmp_path):
    result = recorded(*BLIND)
    path, target = Path(result.log), tmp_path / "fork.mcap"
    with pytest.raises(InputError, match="stack 'blind' was on trial, and a log cannot say how"):
        fork(path, 10, (), target)
    log = open_log(path)
    with restarted_stack(log, "blind") as restarted:
        same = fork(path, 10, (), target, restarted=restarted)
    assert (restarted.answers, restarted.differing) == (10, 0)
    assert same.chain == result.chain
    assert packets(target) == packets(path)
    with restarted_stack(log, "blind") as restarted:
        kept = fork(
            path, 9, ("stack.guard=true", "episode.stuck_after=2"), target, restarted=restarted
        )
    assert (kept.outcome, kept.collisions) == ("stuck", 0)
    assert replay(target).identical
    assert simulate_again(target).identical
    assert audit(target).violations == ()
    with restarted_stack(log, "gap") as restarted:
        fork(path, 5, ("episode.time_limit=1",), target, restarted=restarted)
    assert (restarted.differing, restarted.first_difference) == (5, 0)
    assert replay(target).identical
    assert open_log(target).config.stack.name == "gap"


@pytest.mark.parametrize(
    ("setting", "line"),
    [
        ("goal=[5.0,5.0]", "changes the mission of the task, which the stack got at its start"),
        ("latency.plan=0.1", "changes the delay_s of the task"),
    ],
)
def test_the_task_of_a_stack_on_trial_stays(recorded, tmp_path, setting, line):
    path = Path(recorded(*BLIND).log)
    with (
        restarted_stack(open_log(path), "blind") as restarted,
        pytest.raises(InputError, match=line),
    ):
        fork(path, 10, (setting,), tmp_path / "fork.mcap", restarted=restarted)
    assert list(tmp_path.iterdir()) == []


def test_a_fork_does_not_change_between_the_built_in_stack_and_one_on_trial(recorded, tmp_path):
    result = recorded(*SHORT["drone"])
    with pytest.raises(InputError, match="continues 'builtin'"):
        fork(Path(result.log), 3, ("stack.name=blind",), tmp_path / "fork.mcap")
    code = main(["replay", "fork", recorded(*BLIND).log, "3", "--stack", "builtin"])
    assert code == 2
