"""Stacks on trial, end to end: the same by every way in, judged, logged, replayed and broken."""

import contextlib
import json
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.filters import NAMES
from wayproof.harness.interface import trial as trial_module
from wayproof.harness.interface.connect import isolating
from wayproof.harness.interface.observation_messages import task_from, task_message
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.types import Task
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.answers import compare_answers
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.scenario.scenario import sensor_info
from wayproof.harness.schema import stack_pb2 as sb

STACKS = Path(__file__).with_name("stacks_on_trial.py")
CHILD = f"exec:{sys.executable} -m wayproof serve"
PEER = f"exec:{sys.executable} {STACKS.with_name('peer.py')}"


def own(kind):
    return f"{STACKS}:{kind}"


QUICK = ("episode.time_limit=2.2", "plugins.wall_s=120")


def trial(tmp_path, stack, world="empty", robot="quadruped", seed=1, *settings, name="a"):
    config = override(Config(world, robot, seed), [*QUICK, *settings, f"stack.name={stack}"])
    return run_episode(build(config), tmp_path / f"{name}.mcap")


@pytest.fixture(scope="session")
def tried(recorded):
    """Run a stack in this process, as `trial` does; each combination once for all tests."""

    def run(stack, world="empty", robot="quadruped", seed=1, *settings):
        return recorded(world, robot, seed, *QUICK, *settings, f"stack.name={stack}")

    return run


def decisions(result):
    return list(open_log(Path(result.log)).decisions())


def test_a_child_gives_the_same_chain_whose_log_runs_and_leaves_nothing(tried, tmp_path):
    mark, script, slept = tmp_path / "ran", tmp_path / "child.sh", tmp_path / "pid"
    serve = f"{sys.executable} -m wayproof serve {own('Ahead')}"
    script.write_text(f"touch {mark}\nsleep 987 & echo $! > {slept}\nexec {serve}\n")
    result, here = trial(tmp_path, f"exec:sh {script}"), tried(own("Ahead"))
    assert (here.chain, here.outcome) == (result.chain, "timeout")
    assert here.decisions == result.decisions > 20
    until = time.monotonic() + 60.0
    while Path(f"/proc/{int(slept.read_text())}").exists():
        assert time.monotonic() < until
        time.sleep(0.1)
    mark.unlink()
    path = Path(result.log)
    again = replay(path)
    assert again.identical, (again.differences, again.contradictions)
    assert simulate_again(path).identical
    assert main(["explain", result.log, "3"]) == 0
    assert not mark.exists()


LOST = "estimate.kind=lidar", "start=[15, 1.3]", "behaviour.lost_sigma=0.04"


@pytest.mark.parametrize(
    ("world", "robot", "seed", "settings"),
    [
        ("cylinders", "quadruped", 2, ("motion.limits=full",)),
        ("tunnel", "drone", 0, LOST),
    ],
)  # fmt: skip
def test_the_border_loses_nothing_of_the_built_in_stack(
    tried, tmp_path, world, robot, seed, settings
):
    """Filters are of the referee's map too; in the tunnel the pose has a covariance."""
    scene = world, robot, seed, *settings, f"map.filters={','.join(NAMES)}"
    direct = decisions(tried("builtin", *scene))
    there = decisions(trial(tmp_path, f"{CHILD} {own(f'OfSeed{seed}')}", *scene))
    for one, other in zip(direct, there, strict=True):
        assert one.trajectory == other.trajectory
        assert (one.action, one.label) == (other.action, other.label)
        assert (one.map_version, one.widening) == (other.map_version, other.widening)
    lost = "localization_lost" in {one.label for one in direct}
    assert lost == (world == "tunnel")
    assert lost or {one.verdict.verdict for one in there} == {"admitted"}


def test_the_border_loses_nothing_of_the_mission():
    mission = build(Config("empty", "quadruped", 1)).mission
    whole = replace(
        mission,
        waypoints=((1.0, 2.0, 0.3),),
        discs=((0.1, 0.2),),
        rest_height=0.31,
        sideways_speed=0.25,
    )
    assert all(getattr(whole, one.name) for one in fields(whole) if one.name != "start_heading")
    task = Task("quadruped", 7, whole, 0.2, 0.1, 0.05, 0.25, {}, "{}")
    assert task_from(task_message(task)) == task


def test_a_stack_asked_again_answers_alike_or_the_first_difference_is_found(tried):
    same = compare_answers(Path(tried(own("Ahead")).log), own("Ahead"))
    assert same.identical
    assert same.answers > 20
    other = compare_answers(Path(tried(own("Random")).log), own("Random"))
    assert not other.identical
    assert other.first_difference == 0
    assert other.differing == other.answers
    assert [one.field for one in other.differences] == ["velocity.forward"]
    with pytest.raises(InputError, match="a log of the built-in stack, expected one of a stack on"):
        compare_answers(Path(tried("builtin").log), own("Ahead"))


def test_a_blind_stack_is_judged_and_stopped_by_the_guard(tmp_path):
    scene = "blind", "cylinders", "quadruped", 2, "episode.time_limit=6"
    free = trial(tmp_path, *scene, name="f")
    kept = trial(tmp_path, *scene, "stack.guard=true", name="k")
    assert free.outcome == "collision"
    assert free.cause == "disregarded_obstacle"
    assert kept.collisions == 0
    verdicts = [one.verdict for one in decisions(free)]
    assert {one.verdict for one in verdicts[-5:]} <= {"blocked", "unknown"}
    assert not any(one.cut for one in verdicts)
    cuts = [one for one in decisions(kept) if one.verdict.cut]
    assert cuts
    assert {one.action for one in cuts} == {"stop_and_wait"}
    assert {one.label for one in cuts} <= {"unknown_ahead", "path_blocked"}
    assert audit(Path(kept.log)).violations == ()
    assert any(one.rule == "swept" for one in audit(Path(free.log)).violations)


@pytest.mark.parametrize(
    ("stack", "text"),
    [
        (f"{CHILD} {own('Raises')}", "failed: KeyError: 'map'"),
        (f"{PEER} dies", "ended (exit code 7); its last line on stderr: segmentation"),
        (f"{PEER} hangs", "had not answered after 2 s (plugins.wall_s)"),
        (own("Nan"), "velocity: got (nan, 0.0, 0.0, 0.0), expected finite"),
        (own("Elsewhere"), "starts 3.00 m from where the robot is then"),
        (own("Garbage"), "got str, expected a Command"),
        (own("Overwrites"), "destination is read-only"),
        (own("Moves"), "output array is read-only"),
    ],
    ids=["raises", "dies", "hangs", "nan", "elsewhere", "garbage", "overwrites", "moves"],
)
def test_a_broken_stack_ends_the_episode_in_one_line(tmp_path, stack, text):
    wall = "plugins.wall_s=2" if stack.endswith("hangs") else "plugins.wall_s=120"
    result = trial(tmp_path, stack, "empty", "drone", 1, wall)
    assert result.outcome == "error"
    assert result.cause == "plugin_failed"
    assert text in result.reason
    assert "at decision 3" in result.reason
    assert replay(Path(result.log)).identical  # the decisions before


def test_a_stack_reaches_nothing_that_the_referee_judges_by(tried):
    assert tried(own("BlindsItsReferee")).chain == tried(own("Ahead")).chain


def test_a_stack_is_not_told_its_world():
    perturbation = perturbation_from("pose_drift:2")
    config = Config("warehouse", "quadruped", 4711, difficulty=0.75, perturbation=perturbation)
    scenario = build(config)
    infos = {info.name: info for info in map(sensor_info, scenario.scene.casters)}
    sent = str(task_message(task_of(scenario.config, scenario.mission, infos)))
    assert "unknown_policy" in sent
    for told in ("warehouse", "4711", "0.75", "pose_drift", "aisle", '"world', '"seed', '"start"'):
        assert told not in sent


def test_an_isolated_class_cannot_change_its_judge(tmp_path, monkeypatch):
    monkeypatch.setattr(trial_module, "judge", trial_module.judge)  # what it changes here is undone
    verdicts = {}
    for name, where in (("inside", contextlib.nullcontext()), ("outside", isolating())):
        with where:
            log = trial(tmp_path, own("JudgesItself"), "cylinders", name=name).log
        verdicts[name] = {one.verdict.verdict for one in open_log(Path(log)).decisions()}
        monkeypatch.undo()
    assert verdicts["inside"] == {"admitted"}
    assert verdicts["outside"] > {"admitted"}


def test_a_child_that_floods_its_standard_error_is_no_danger(tmp_path):
    result = trial(tmp_path, f"{PEER} floods", "empty", "drone")
    assert result.outcome == "timeout"


def test_garbage_on_the_pipe_is_found(tmp_path):
    script = tmp_path / "garbage.sh"
    slept = tmp_path / "slept"
    script.write_text(f"printf 'hello, world, this is no message'\nsleep 60\ntouch {slept}\n")
    with pytest.raises(InputError, match="sent a message of 1819043176 bytes, expected 1 to"):
        trial(tmp_path, f"exec:sh {script}")
    assert not slept.exists()  # the child was not waited for


def test_a_stack_on_a_socket_gives_the_same_chain(tried, tmp_path):
    here = tried(own("Ahead"))
    address = tmp_path / "socket"
    server = subprocess.Popen(
        [sys.executable, "-m", "wayproof", "serve", own("Ahead"), "--listen", f"unix:{address}"]
    )
    try:
        while not address.exists():
            assert server.poll() is None
            time.sleep(0.05)
        there = trial(tmp_path, f"unix:{address}", name="there")
    finally:
        server.kill()
        server.wait()
    assert here.chain == there.chain


@pytest.mark.parametrize(
    ("stack", "text"),
    [
        ("blnid", "unknown stack.name 'blnid'"),
        ("exec:no-such-command-here", "no-such-command-here: No such file or directory"),
        ("exec:", "got no command, expected exec:COMMAND"),
        ("unix:/no/such/socket", "expected a stack that listens"),
        ("tcp:localhost", "expected tcp:HOST:PORT"),
        (f"{STACKS}:Nobody", "has no class 'Nobody'"),
        (f"{STACKS}:Base", "a class without step"),
        (f"{STACKS}:RaisesInStart", "cannot be started: it raised FileNotFoundError: weights.bin"),
        (f"{STACKS}:RaisesInBoth", "cannot be started: it raised FileNotFoundError: weights.bin"),
        ("exec:true", "ended (exit code 0)"),
    ],
)
def test_a_stack_that_cannot_be_reached_is_one_line_and_leaves_no_log(
    tmp_path, capsys, stack, text
):
    log = tmp_path / "a.mcap"
    code = main(
        ["run", "empty", "--robot", "drone", "--seed", "1", "--stack", stack, "--log", str(log)]
    )
    printed = capsys.readouterr().err
    assert code == 2
    assert text in printed
    assert len(printed.strip().splitlines()) == 1
    assert not list(tmp_path.glob("*.mcap*"))


def test_what_a_stack_raises_as_it_is_closed_changes_nothing(tried, tmp_path, capsys):
    settings = [part for one in QUICK for part in ("--set", one)]
    command = ["run", "empty", "--robot", "quadruped", "--seed", "1", *settings]
    log = tmp_path / "b.mcap"
    code = main([*command, "--stack", own("RaisesInClose"), "--log", str(log), "--json"])
    assert (code, json.loads(capsys.readouterr().out)["outcome"]) == (1, "timeout")
    assert open_log(log).result["chain"] == tried(own("Ahead")).chain


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("RaisesInStart", "cannot be started: it raised FileNotFoundError: weights.bin"),
        ("Raises", "raised KeyError: 'map' (stacks_on_trial.py"),
    ],
)
def test_a_stack_that_fails_as_it_is_asked_again_is_one_line(tried, capsys, kind, text):
    log = tried(own("Ahead")).log
    assert main(["replay", "what-if", log, "--stack", own(kind)]) == 2
    printed = capsys.readouterr().err
    assert text in printed
    assert len(printed.strip().splitlines()) == 1
    asked = compare_answers(Path(log), own("RaisesInClose"))
    assert asked.identical


def test_answers_are_logged_as_they_were_sent_and_a_card_shows_them(tried, capsys):
    result = tried(own("Ahead"))
    for count, record in enumerate(open_log(Path(result.log)).records()):
        command = sb.Command.FromString(record.answer.command)
        assert (command.sequence, command.reason) == (count, "on and on")
        assert dict(command.scalars) == {"n": count}
        assert command.velocity.forward == 0.3
    assert main(["explain", result.log, "3"]) == 0
    lines = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "velocity (0.30, 0.00, 0.00) m/s, 0.00 rad/s for 0.5 s; on and on; n 3" in lines
    assert "admitted, free for 0." in lines


def test_waypoints_are_followed_to_rest(tmp_path):
    near = "start=[3.0,3.0]", "goal=[4.5,3.0]", "episode.time_limit=30"
    assert trial(tmp_path, own("ToWaypoint"), "empty", "drone", 1, *near).outcome == "success"


def test_waypoints_go_on_with_the_acceleration_that_is_commanded(tmp_path):
    """As the built-in stack's paths do: each answer that began without any would be slower."""
    own_stack = own("ToGoalAtFullSpeed")
    result = trial(tmp_path, own_stack, "empty", "drone", 1, "episode.time_limit=1.5")
    log = open_log(Path(result.log))
    fastest = max(float(np.linalg.norm(one.velocity)) for one in log.truth())
    assert fastest > 0.7 * log.mission.max_speed
    broken = {one.rule for one in audit(Path(result.log)).violations}
    assert not broken & {"limits", "rest", "joined"}


def test_a_trajectory_beyond_the_body_s_limits_is_followed_within_them(tmp_path):
    result = trial(tmp_path, own("TooFast"), "empty", "quadruped", 1, "episode.time_limit=2")
    made, most = decisions(result), open_log(Path(result.log)).mission.max_speed
    assert len(made) > 15
    assert all(one.verdict.limited for one in made)
    speeds = [np.diff(one.trajectory.arc_length) / 0.1 for one in made]
    assert max(one.max() for one in speeds) < 1.01 * most
    assert min(one.max() for one in speeds[5:]) > 0.9 * most
    rules = {one.rule for one in audit(Path(result.log)).violations}
    assert not rules & {"limits", "rest", "joined"}
    assert replay(Path(result.log)).identical


def test_a_goal_claimed_in_motion_is_none(tmp_path):
    settings = ("episode.goal_tolerance=5", "episode.time_limit=1")
    result = trial(tmp_path, own("ClaimsInMotion"), "empty", "drone", 1, *settings)
    assert {one.action for one in decisions(result)} == {"follow"}
    assert result.outcome == "timeout"


@pytest.mark.large
def test_the_built_in_stack_goes_on_from_where_the_guard_stopped_it(tmp_path):
    """With a margin that it does not know of the referee cuts, and it never starts elsewhere."""
    result = trial(
        tmp_path, own("Daring"), "cylinders", "quadruped", 2, "episode.time_limit=8",
        "stack.guard=true",
    )  # fmt: skip
    assert result.outcome != "error", result.reason
    assert any(one.verdict.cut for one in decisions(result))
    assert result.collisions == 0
