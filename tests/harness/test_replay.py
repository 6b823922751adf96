"""Replay, closed loop, what-if and fork: what each promises, on real episodes."""

import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Attachment, Metadata, Packet, walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import thin, write_copy
from wayproof.harness.log.reader import open_log, read_head
from wayproof.harness.log.writer import FORMAT_VERSION, PACKED_SCENE
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.what_if import what_if
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import differences

SHORT = {
    "drone": ("empty", "drone", 1, "episode.time_limit=2"),
    "quadruped": ("corridor", "quadruped", 1, "episode.time_limit=2"),
}


def altered(source, target, change):
    """A copy of a log with valid checksums, its messages changed by `change`."""
    log = open_log(source)
    messages = list(read_messages(source))
    for message in messages:
        change(message)
    head = read_head(walk(source, head_only=True), source, False)
    write_copy(target, head, messages, log.result)
    return target


def test_the_first_difference_is_named_value_by_value(recorded, tmp_path, capsys):
    def move(message):
        if isinstance(message, pb.Decision) and message.sequence == 7:
            message.trajectory.path[0].x += 0.5
            message.reason = "because"
            message.stages.map_ms += 1.0  # measured, and no part of identity

    path = altered(Path(recorded(*SHORT["drone"]).log), tmp_path / "moved.mcap", move)
    again = replay(path)
    assert not again.identical
    assert (again.differing, again.first_difference) == (1, 7)
    fields = {one.field: one for one in again.differences}
    assert fields.keys() == {"trajectory.path[0].x", "reason"}
    x = fields["trajectory.path[0].x"]
    assert float(x.recorded) == float(x.recomputed) + 0.5
    assert fields["reason"].recorded == "because"
    assert main(["replay", str(path)]) == 1
    assert f"trajectory.path[0].x: {x.recorded} -> {x.recomputed}" in capsys.readouterr().out
    assert main(["replay", str(path), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["differences"][0].keys() == {"field", "recorded", "recomputed"}


@pytest.mark.parametrize(
    "case",
    [
        SHORT["drone"],
        SHORT["quadruped"],
        ("empty", "drone", 1, "latency.plan=0.5", "latency.deadline=0.1", "episode.time_limit=1"),
    ],
)
def test_two_threads_replay_what_one_recorded(recorded, case):
    """The last one never decides in time, so what it had in mind stands in no log."""
    again = replay(Path(recorded(*case).log), threads=2)
    assert (again.identical, again.decisions) == (True, recorded(*case).decisions)


def test_a_bit_is_a_difference_and_a_measured_time_is_none():
    old, new = pb.Decision(path_cost=0.0), pb.Decision(path_cost=-0.0)
    assert [one.field for one in differences(old, new)] == ["path_cost"]
    nan = struct.unpack("<d", struct.pack("<Q", 0x7FF8000000000001))[0]
    old, new = pb.Decision(path_cost=float("nan")), pb.Decision(path_cost=nan)
    assert [one.field for one in differences(old, new)] == ["path_cost"]
    old, new = pb.Decision(action="follow"), pb.Decision(action="follow")
    new.stages.plan_ms = 3.0
    assert differences(old, new) == []
    new.trajectory.arc_length.extend([0.0, 1.0])
    old.trajectory.arc_length.extend([0.0, 2.0, 3.0])
    found = [(one.field, one.recorded, one.recomputed) for one in differences(old, new)]
    assert found == [
        ("len(trajectory.arc_length)", "3", "2"),
        ("trajectory.arc_length[1]", "2.0", "1.0"),
    ]


def test_replay_needs_no_simulator(recorded):
    script = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from wayproof.harness.cli.main import main\n"
        f"sys.exit(main(['replay', {str(recorded(*SHORT['drone']).log)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "identical" in done.stdout


@pytest.mark.parametrize("robot", sorted(SHORT))
def test_simulated_anew_everything_is_the_same(recorded, robot):
    again = simulate_again(Path(recorded(*SHORT[robot]).log))
    assert again.identical
    assert again.scene_from_seed
    assert again.first_input is None


def test_the_first_input_that_differs_is_named(recorded, tmp_path):
    def brush(message):
        if isinstance(message, pb.Pose) and message.sequence == 5:
            message.position[0] += 1e-12

    source = Path(recorded(*SHORT["drone"]).log)
    again = simulate_again(altered(source, tmp_path / "brushed.mcap", brush))
    assert not again.identical
    assert (again.first_input.stream, again.first_input.sequence) == ("/pose", 5)
    assert again.first_input.time_s == pytest.approx(0.5)


def test_a_measured_latency_is_lived_through_again(recorded):
    settings = ("episode.time_limit=2", "latency.mode=measured", "latency.deadline=0.5")
    again = simulate_again(Path(recorded("empty", "drone", 2, *settings).log))
    assert again.identical


@pytest.mark.parametrize(
    ("robot", "at"),
    [("drone", 0), ("drone", 1), ("drone", 13), ("quadruped", 1), ("quadruped", 13)],
)
def test_a_fork_without_a_change_ends_alike(recorded, tmp_path, robot, at):
    result = recorded(*SHORT[robot])
    forked = fork(Path(result.log), at, (), tmp_path / "fork.mcap")
    assert forked.chain == result.chain
    assert packets(Path(forked.log)) == packets(Path(result.log))
    assert replay(Path(forked.log)).identical


@pytest.mark.parametrize(
    ("world", "robot", "at"), [("crossing", "drone", 10), ("ghosts", "quadruped", 15)]
)
def test_a_fork_amid_what_moves_ends_alike(recorded, tmp_path, world, robot, at):
    result = recorded(world, robot, 4, "episode.time_limit=2")
    assert any(one.movers for one in open_log(Path(result.log)).truth())
    forked = fork(Path(result.log), at, (), tmp_path / "fork.mcap")
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


@pytest.mark.parametrize(
    "settings",
    [["map.resolution=0.08"], ["planner.name=rrtconnect"], ["sensors.lidar=velodyne-vlp16"]],
)
def test_a_fork_with_a_change_keeps_the_past_and_replays(recorded, tmp_path, settings):
    result = recorded(*SHORT["quadruped"])
    forked = fork(Path(result.log), 12, settings, tmp_path / "fork.mcap")
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
    code = main(["replay", f"{tmp_path}/a.mcap", "--from", "3", *change, "--json"])
    document = json.loads(capsys.readouterr().out)
    assert (code, document["recorded_outcome"], document["outcome"]) == (0, "timeout", "success")
    assert Path(document["log"]).name.startswith("a-from-3-")
    assert replay(Path(document["log"])).identical


def test_what_if_nothing_changes(recorded):
    answer = what_if(Path(recorded(*SHORT["drone"]).log), ["threads=2"])
    assert answer.faithful
    assert answer.changes == ()


def test_what_if_a_wider_margin(recorded, capsys):
    log = recorded(*SHORT["drone"]).log
    answer = what_if(Path(log), ["costmap.localization_margin=0.5"])
    assert answer.faithful
    assert 0 < len(answer.changes) <= answer.decisions
    first = answer.changes[0]
    old = list(open_log(Path(log)).decisions())[first.sequence]
    assert (first.recorded.action, first.recorded.reason) == (old.action, old.reason)
    assert first.departure_m > 0.01 or first.recorded != first.changed
    assert main(["replay", log, "--set", "costmap.localization_margin=0.5"]) == 1
    assert f"from {first.sequence} (" in capsys.readouterr().out


def test_a_change_later_on_is_no_echo(recorded):
    """Half the speed never changes where the recorded robot stands, so each change stands alone."""
    answer = what_if(Path(recorded(*SHORT["drone"]).log), ["motion.speed_fraction=0.5"])
    assert answer.changes
    assert all(one.changed.label != "localization_lost" for one in answer.changes)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--set", "sensors.lidar=velodyne-vlp16"], "changes what is sensed"),
        (["--set", "world=empty"], "changes what is sensed"),
        (["--from", "9999"], "expected a decision from 0 to 20"),
        (["--from", "-1"], "--from: got -1"),
        (["--from", "5", "--set", "seed=2"], "the episode had begun with it"),
        (
            ["--closed-loop", "--set", "map.log_odds_hit=0.8"],
            "--closed-loop: simulates what was recorded",
        ),
        (["--log", "x.mcap"], "--log: nothing to write"),
    ],
)
def test_questions_that_have_no_answer(recorded, capsys, options, said):
    assert main(["replay", recorded(*SHORT["quadruped"]).log, *options]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1


def test_decisions_alone_are_small_and_simulated_again(recorded, tmp_path, capsys):
    full = recorded(*SHORT["quadruped"])
    small = recorded(*SHORT["quadruped"], "record=decisions")
    assert small.chain == full.chain
    assert Path(small.log).stat().st_size < 0.3 * Path(full.log).stat().st_size
    with pytest.raises(InputError, match=r"sweeps were left out .* --closed-loop"):
        replay(Path(small.log))
    again = simulate_again(Path(small.log), written=tmp_path / "full.mcap")
    assert again.identical
    assert again.regenerated
    assert replay(tmp_path / "full.mcap").chain == full.chain
    assert fork(tmp_path / "full.mcap", 10, (), tmp_path / "fork.mcap").chain == full.chain
    with pytest.raises(InputError, match="left out"):
        fork(Path(small.log), 10, (), tmp_path / "none.mcap")
    assert main(["replay", small.log]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_failures_are_kept_in_full(recorded):
    failed = recorded(*SHORT["quadruped"], "record=failures")
    assert failed.outcome == "timeout"
    assert open_log(Path(failed.log)).record == "full"
    reached = recorded("empty", "drone", 1, "record=failures")
    assert reached.outcome == "success"
    assert open_log(Path(reached.log)).record == "decisions"
    assert reached.log_mb_per_min == pytest.approx(
        60e-6 * Path(reached.log).stat().st_size / reached.sim_time_s
    )


@pytest.mark.parametrize("at", [8, 12, 15])
def test_a_fork_can_be_forked_again(recorded, tmp_path, at):
    """Before, at and after the first fork; other cells, then another lidar, then neither."""
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


def test_a_fork_to_another_goal_knows_the_old_one(recorded, tmp_path):
    result = recorded(*SHORT["drone"])
    forked = fork(Path(result.log), 12, ["goal=[3.0,3.0,1.2]"], tmp_path / "fork.mcap")
    assert replay(Path(forked.log)).identical
    thin(Path(forked.log))
    assert [one.at for one in open_log(Path(forked.log)).forks] == [12]


def test_the_audit_of_a_fork_reads_each_decision_with_its_own_settings(recorded, tmp_path):
    result = recorded(*SHORT["quadruped"])
    change = ["map.resolution=0.08", "costmap.localization_margin=0.2"]
    forked = fork(Path(result.log), 12, change, tmp_path / "fork.mcap")
    found = audit(Path(forked.log))
    assert found.decisions == 21
    assert found.swept > 5
    assert found.violations == ()


@pytest.mark.parametrize(
    ("packed", "said"),
    [(b"junk", "damaged"), (zstandard.compress(bytes(65 * 2**20)), "unpacks to 68157440 bytes")],
)
def test_a_packed_scene_is_not_believed(packed, said):
    items = [Metadata("run", {"format_version": FORMAT_VERSION}), Attachment(PACKED_SCENE, packed)]
    with pytest.raises(InputError, match=said):
        read_head(iter(items), Path("a.mcap"), False)


def test_a_log_of_decisions_keeps_guides_where_they_were_searched_for(recorded):
    full = open_log(Path(recorded(*SHORT["quadruped"]).log))
    small = open_log(Path(recorded(*SHORT["quadruped"], "record=decisions").log))
    assert small.scene == full.scene
    pairs = list(zip(small.decisions(), full.decisions(), strict=True))
    kept = [bool(one.global_path) for one, other in pairs if other.global_path]
    assert 2 <= sum(kept) < len(kept)
    assert all(one.global_path == other.global_path for one, other in pairs if one.global_path)
    assert all(one.global_path for one, other in pairs if other.planner and other.global_path)
    assert all(one.trajectory == other.trajectory for one, other in pairs)
