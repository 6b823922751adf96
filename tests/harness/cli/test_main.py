import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.text import Text

from wayproof.harness.cli.arguments import refusing_unusable_paths
from wayproof.harness.cli.main import main
from wayproof.harness.cli.stdout import PlainConsole
from wayproof.harness.errors import InputError

RUN = ["run", "empty", "--robot", "drone", "--seed", "1"]


def bad_input(capsys, arguments):
    """Run a command that must be refused; returns its one line."""
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("wayproof: ")
    assert captured.out == ""
    return captured.err


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({1: "warehose"}, "unknown world 'warehose'; did you mean 'warehouse'? (available: "),
        ({3: "drome"}, "'drome'; did you mean 'drone'? (available: drone, quadruped)"),
        ({5: "x"}, "argument --seed: invalid int value: 'x'"),
        ({5: "-1"}, "seed: got -1"),
        ({0: "rnu"}, "unknown verb 'rnu'; did you mean 'run'?"),
    ],
)
def test_bad_words(capsys, tmp_path, changes, said):
    arguments = [changes.get(i, word) for i, word in enumerate(RUN)]
    assert said in bad_input(capsys, [*arguments, "--logs", str(tmp_path / "logs")])
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--set", "map.resolution=-0.1"], "map.resolution: got -0.1, expected 0.01 to 0.5 m"),
        (["--set", "map.resolution=fine"], "expected a finite number, such as 0.1"),
        (["--set", "map.resolution=inf"], "expected a finite number, such as 0.1"),
        (["--set", "map.resolution="], "expected a finite number, such as 0.1"),
        (["--set", "map.memory_mib=x"], "map.memory_mib=x: expected a whole number, such as 512"),
        (["--set", "seed=1", "--set", "seed=2"], "--set seed: given twice, "),
        (["--set", "sensors.lidar=vlp16"], "did you mean 'velodyne-vlp16'?"),
        (["--set", "planner.name=RRTConnect"], "did you mean 'rrtconnect'?"),
        (["--perturb", "latency:2", "--perturb", "rate:1"], "given twice, latency:2 and rate:1"),
        (["--seed", "2"], "--seed: given twice, 1 and 2"),
        (["--perturb", "latency:9"], "latency:9: severity: got 9, expected above 0, up to 5"),
        (["--perturb", "latency:nan"], "severity: got nan, expected above 0, up to 5"),
        (["--goal", "nan,1,1"], "--goal nan,1,1: expected X,Y or X,Y,Z, finite numbers in m"),
        (["--start", "-1,2,1"], "one argument; one with a minus sign is written --start=-1"),
        (["--robto", "drone"], "unknown option '--robto'; did you mean '--robot'?"),
        (["--set", "map.resoluton=1"], "did you mean 'map.resolution'?"),
        (["--set", "planner.name=rrtconect"], "did you mean 'rrtconnect'?"),
        (["--set", "map.kind=voxels"], "did you mean 'voxel'?"),
        (["--goal", "99,99"], "goal: got (99, 99, 1), expected inside the geofence"),
        (["--goal", "3,4,2.9"], "goal: altitude 2.9 m, expected 0.66 to 2.34 m"),
        (["--goal", "0.05,3"], "goal: (0.05, 3, 1) is within the body's radius of 0.3"),
        (["--goal", "north"], "--goal north: expected X,Y or X,Y,Z"),
        (
            ["--set", "map.resolution=0.01", "--set", "map.half_life=0"],
            "expected at most 200000000",
        ),
        (["--set", "motion.altitude_high=0.5"], "altitude_low, altitude_high: got 0.2 and 0.5"),
        (["--set", "behaviour.rotate_in_place_angle=1"], "'drone' flies and does not use it"),
        (["--nonsense"], "unknown option '--nonsense' (see 'wayproof run --help')"),
    ],
)
def test_bad_settings_leave_nothing_behind(capsys, tmp_path, options, said):
    assert said in bad_input(capsys, [*RUN, "--logs", str(tmp_path / "logs"), *options])
    assert not (tmp_path / "logs").exists()


def test_a_goal_inside_a_shelf(capsys, tmp_path):
    from wayproof.models.worlds import WORLDS

    shelf = next(box for box in WORLDS["warehouse"](0).solids if box.kind == "shelf")
    goal = f"{shelf.centre[0]},{shelf.centre[1]}"
    arguments = ["run", "warehouse", "--robot", "quadruped", "--seed", "0", "--goal", goal]
    line = bad_input(capsys, [*arguments, "--logs", str(tmp_path / "logs")])
    assert "'shelf" in line
    assert not (tmp_path / "logs").exists()


def test_a_log_folder_that_is_a_file(capsys, tmp_path):
    (tmp_path / "logs").write_text("")
    line = bad_input(capsys, [*RUN, "--logs", str(tmp_path / "logs")])
    assert "is a file, expected a folder" in line


def test_an_unwritable_log_folder(capsys, tmp_path):
    if os.geteuid() == 0:
        folder = "/proc/wayproof"  # where even root may not write
    else:
        folder = str(tmp_path / "closed" / "logs")
        (tmp_path / "closed").mkdir(mode=0o500)
    assert "log" in bad_input(capsys, [*RUN, "--logs", folder])


def test_a_full_log_folder(capsys, tmp_path, monkeypatch):
    from wayproof.harness.log import writer as log

    free = 10 * 2**60  # no disk has this much to spare, so this one counts as full
    monkeypatch.setattr(log, "LEAST_FREE_BYTES", free)
    line = bad_input(capsys, [*RUN, "--logs", str(tmp_path)])
    assert "MiB free, expected at least" in line
    assert not list(tmp_path.iterdir())


@pytest.fixture
def log_bytes(recorded):
    return Path(recorded("empty", "drone", 1).log).read_bytes()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda data: data[: len(data) // 2], "truncated"),
        (lambda data: b"", "empty"),
        (lambda data: b"certainly no log", "not an MCAP file"),
        (lambda data: data[:8] + data[-8:], "damaged"),
        (lambda data: data[:5000] + bytes(64) + data[5064:], "damaged"),
        (lambda data: data[:-2000] + bytes(1000) + data[-1000:], "damaged"),
    ],
)
def test_broken_logs(capsys, tmp_path, log_bytes, spoil, said):
    path = tmp_path / "broken.mcap"
    path.write_bytes(spoil(log_bytes))
    line = bad_input(capsys, ["replay", str(path)])
    assert said in line
    assert str(path) in line


def test_json_is_one_document_and_nothing_else(capsys, tmp_path):
    brief = ["--set", "episode.time_limit=0.5", "--json", "--logs", str(tmp_path)]
    assert main([*RUN, *brief]) == 1
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert captured.err == ""
    figures = {"outcome", "sim_time_s", "wall_time_s", "decisions", "log"}
    assert {*figures, "goal_distance_m", "collisions", "min_clearance_m"} <= document.keys()
    assert Path(document["log"]).is_file()
    assert not list(tmp_path.glob("*.partial"))


def test_json_of_bad_input_holds_the_line(capsys):
    assert main(["run", "nowhere", "--robot", "drone", "--seed", "1", "--json"]) == 2
    assert "unknown world 'nowhere'" in json.loads(capsys.readouterr().out)["error"]


def test_list_names_what_is_registered(capsys):
    assert main(["list", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {"warehouse", "corridor", "empty"} <= set(document["worlds"])
    assert set(document["robots"]) == {"drone", "quadruped"}
    assert {"smoke"} <= set(document["studies"])
    assert {"rays"} <= set(document["benches"])
    assert document["settings"]["map.resolution"] == {
        "meaning": "Edge of a cell, m.",
        "source": "maps/config.py",
        "type": "float",
        "default": "0.1",
        "unit": "m",
        "bounds": [0.01, 0.5],
    }


def test_the_module_is_the_command():
    printed = subprocess.run(
        [sys.executable, "-m", "wayproof", "list"], capture_output=True, text=True, check=True
    )
    assert "worlds: " in printed.stdout
    assert "\x1b" not in printed.stdout  # a pipe gets no colours


def test_a_robot_whose_spec_file_is_here_is_named(capsys, tmp_path):
    line = bad_input(capsys, ["run", "empty", "--robot", "Spot", "--seed", "1"])
    assert "unknown robot 'Spot'; its spec file is here: --robot " in line
    assert Path(line.split("--robot ")[1].split(" (")[0]).is_file()


def test_the_version_and_the_help(capsys):
    assert main([]) == 2
    assert "verbs:" in capsys.readouterr().err
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("wayproof ")


def test_ctrl_c_says_what_is_left(tmp_path, monkeypatch, capsys):
    from wayproof.harness.stack.pipeline import Navigator

    step = Navigator.step

    def press(at):
        def pressed(self, inputs, sense_ms=0.0, answer=None):
            if inputs.sequence == at:
                raise KeyboardInterrupt
            return step(self, inputs, sense_ms, answer)

        monkeypatch.setattr(Navigator, "step", pressed)

    log = tmp_path / "a.mcap"
    press(0)
    assert main([*RUN, "--log", str(log)]) == 130
    said = capsys.readouterr().err
    assert said == "wayproof: interrupted; nothing was decided yet, and no log is left\n"
    assert not list(tmp_path.iterdir())
    press(3)
    assert main([*RUN, "--log", str(log)]) == 130
    said = capsys.readouterr().err
    assert (
        said
        == f"wayproof: interrupted; the log so far: wayproof export {log}.partial --log {log}\n"
    )
    assert main(["export", f"{log}.partial", "--log", str(log)]) == 0


def test_the_live_line_keeps_its_end_at_60_columns():
    from io import StringIO

    from rich.console import Console

    from wayproof.harness.cli.live import LiveLine
    from wayproof.harness.schema import wayproof_pb2 as pb

    out = StringIO()
    decision = pb.Decision(action="stop_and_wait", map_version="e75fde96" * 4, path_length_m=12.3)
    decision.global_path.add(x=1.0)
    decision.timestamp.FromNanoseconds(99_900_000_000)
    with LiveLine(Console(file=out, width=60), "quadruped") as line:
        line(decision, pb.Truth(velocity=[1.0, 0.0, 0.0]))
    assert "12.3 m to go" in out.getvalue()


def test_a_name_apart_in_case_or_part_of_one_is_near():
    from wayproof.harness.errors import near_name

    names = ["velodyne-vlp16", "rrtstar", "informed_rrtstar", "warehouse"]
    assert near_name("vlp16", names) == "velodyne-vlp16"
    assert near_name("RRTstar", names) == "rrtstar"
    assert near_name("rrt_star", names) == "rrtstar"
    assert near_name("e", names) is None
    assert near_name("own", ["brownfield", "downtown-street"]) is None  # of two
    assert near_name("wharehouse", names) == "warehouse"


TOO_LONG = "x" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        *([verb, TOO_LONG] for verb in ("explain", "audit", "replay", "verify", "lab")),
        *([verb, TOO_LONG] for verb in ("view", "report", "study")),
        ["run", "empty", "--robot", TOO_LONG, "--seed", "1"],
        ["run", f"{TOO_LONG}.xml", "--robot", "drone", "--seed", "1"],
        ["explain", "x.mcap", "--png", f"{TOO_LONG}/x.png"],
        ["verify", "--new-key", TOO_LONG],
        ["export", TOO_LONG, "--log", "x.mcap"],
    ],
)
def test_a_path_that_the_system_refuses_is_one_line(capsys, arguments):
    assert bad_input(capsys, arguments).endswith("': File name too long\n")


def test_an_error_of_another_path_is_a_fault_of_ours(tmp_path):
    with pytest.raises(PermissionError), refusing_unusable_paths(["explain", "a.mcap", "3"]):
        raise PermissionError(errno.EACCES, "Permission denied", "/etc/shadow")
    with pytest.raises(OSError, match="space"), refusing_unusable_paths(["explain", "a.mcap"]):
        raise OSError(errno.ENOSPC, "No space left on device", "a.mcap")
    for path in ("a.mcap", "/logs/a.mcap", "/logs/a.mcap.partial", "a.mcap/x"):
        with pytest.raises(InputError, match="Permission denied"):
            with refusing_unusable_paths(["explain", "logs/a.mcap"]):
                raise PermissionError(errno.EACCES, "Permission denied", path)


def test_printed_text_does_not_control_the_terminal():
    written = io.StringIO()
    console = PlainConsole(file=written, force_terminal=True, color_system="standard")
    console.print(Text.assemble(("held", "green"), ": a\x1b]0;title\x07b\u202ec\td"))
    assert written.getvalue() == "\x1b[32mheld\x1b[0m: a\\x1b]0;titleb\\u202ec       d\n"
