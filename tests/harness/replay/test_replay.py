"""Replay: the recorded decisions computed again, bit by bit."""

import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard

from tests.harness.replay.episodes import SHORT, altered
from tests.harness.replay.forgeries import Forgery
from wayproof.harness.cli.main import main
from wayproof.harness.decision import differences
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Attachment, Metadata
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import FORMAT_VERSION, PACKED_SCENE
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb


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


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robot", "command"),
    [
        ("quadruped", ["replay", "--jobs", "1"]),
        ("drone", ["explain", "9"]),
    ],
)
def test_cached_kernels_are_loaded_without_a_compiler(recorded, robot, command):
    words = [command[0], str(recorded(*SHORT[robot]).log), *command[1:]]
    script = (
        "import sys\n"
        "from wayproof.harness.cli.main import main\n"
        f"assert main({words}) == 0\n"
        "print(sorted({'numba.np.arraymath', 'numba.np.npyimpl'} & set(sys.modules)))"
    )
    for _ in range(2):  # the first may compile
        shown = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=True
        )
    assert shown.stdout.splitlines()[-1] == "[]"


def test_a_log_of_decisions_is_small_and_simulated_again(recorded, tmp_path, capsys):
    full = recorded(*SHORT["quadruped"])
    small = recorded(*SHORT["quadruped"], "record=decisions")
    assert small.chain == full.chain
    assert Path(small.log).stat().st_size < 0.3 * Path(full.log).stat().st_size
    with pytest.raises(InputError, match=r"sweeps were left out .* replay simulate"):
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


@pytest.mark.parametrize(
    ("packed", "said"),
    [(b"junk", "damaged"), (zstandard.compress(bytes(65 * 2**20)), "unpacks to 68157440 bytes")],
)
def test_a_packed_scene_is_not_believed(packed, said):
    items = [Metadata("run", {"format_version": FORMAT_VERSION}), Attachment(PACKED_SCENE, packed)]
    with pytest.raises(InputError, match=said):
        read_head(iter(items), Path("a.mcap"), False)


def test_a_log_of_decisions_keeps_new_global_paths(recorded):
    full = open_log(Path(recorded(*SHORT["quadruped"]).log))
    small = open_log(Path(recorded(*SHORT["quadruped"], "record=decisions").log))
    assert small.scene == full.scene
    pairs = list(zip(small.decisions(), full.decisions(), strict=True))
    kept = [bool(one.global_path) for one, other in pairs if other.global_path]
    assert 2 <= sum(kept) < len(kept)
    assert all(one.global_path == other.global_path for one, other in pairs if one.global_path)
    assert all(one.global_path for one, other in pairs if other.planner and other.global_path)
    assert all(one.trajectory == other.trajectory for one, other in pairs)


def by_another_program(path, target, change):
    """Write a log as a program with other code recorded it."""
    forgery = Forgery(path)
    forgery.run |= {"wayproof": "0.0.1", "code": "0123456789abcdef"}
    change(forgery)
    forgery.write(target)
    return target


def test_a_log_of_another_program_that_decided_alike_replays(recorded, tmp_path, capsys):
    log = Path(recorded(*SHORT["drone"]).log)
    path = by_another_program(log, tmp_path / "alike.mcap", lambda forgery: None)
    assert main(["replay", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("identical")
    assert "recorded by another build, wayproof 0.0.1" in said
    assert replay(log).program is None


def test_decisions_of_another_program_are_named_so_and_not_a_divergence(recorded, tmp_path, capsys):
    def decide_otherwise(forgery):
        forgery.middle(pb.Decision).reason = "because"

    log = Path(recorded(*SHORT["drone"]).log)
    path = by_another_program(log, tmp_path / "other.mcap", decide_otherwise)
    assert main(["replay", str(path)]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("another program's: 11 of 21 decisions differ")  # chained
    assert "wayproof 0.0.1, code 0123456789abcdef" in line
    assert "install Wayproof 0.0.1" in line
