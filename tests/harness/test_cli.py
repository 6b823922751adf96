import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from harness.cli import main

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
        (
            {3: "drome"},
            "unknown robot 'drome'; did you mean 'drone'? (available: drone, quadruped)",
        ),
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
        (["--set", "map.resolution=fine"], "map.resolution: expected `float`, got `str`"),
        (["--set", "map.resoluton=1"], "did you mean 'map.resolution'?"),
        (["--set", "planner.name=rrtconect"], "did you mean 'rrtconnect'?"),
        (["--set", "map.kind=voxels"], "did you mean 'voxel'?"),
        (["--goal", "99,99"], "goal: got (99, 99, 1), expected inside the geofence"),
        (["--goal", "3,4,2.9"], "goal: altitude 2.9 m, expected 0.66 to 2.34 m"),
        (["--goal", "0.05,3"], "goal: (0.05, 3, 1) is within the body's radius of 0.3"),
        (["--goal", "north"], "goal: "),
        (
            ["--set", "map.resolution=0.01", "--set", "map.half_life=0"],
            "expected at most 200000000",
        ),
        (
            ["--set", "motion.altitude_high=0.5"],
            "motion.altitude_low, altitude_high: got 0.2 and 0.5",
        ),
        (["--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_bad_settings_leave_nothing_behind(capsys, tmp_path, options, said):
    assert said in bad_input(capsys, [*RUN, "--logs", str(tmp_path / "logs"), *options])
    assert not (tmp_path / "logs").exists()


def test_a_goal_inside_a_shelf(capsys, tmp_path):
    from models.worlds import WORLDS

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
    import harness.logs.log

    free = 10 * 2**60  # no disk has this much to spare, so this one counts as full
    monkeypatch.setattr(harness.logs.log, "LEAST_FREE_BYTES", free)
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


def test_a_log_that_is_not_there(capsys, tmp_path):
    assert "no such file" in bad_input(capsys, ["replay", str(tmp_path / "none.mcap")])


def test_json_is_one_document_and_nothing_else(capsys, tmp_path):
    assert main([*RUN, "--json", "--logs", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert captured.err == ""
    wanted = {
        "outcome",
        "goal_distance_m",
        "sim_time_s",
        "wall_time_s",
        "decisions",
        "collisions",
        "min_clearance_m",
        "log",
    }
    assert wanted <= document.keys()
    assert Path(document["log"]).is_file()
    assert not list(tmp_path.glob("*.partial"))
    assert main(["replay", document["log"], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical"] is True


def test_json_of_bad_input_holds_the_line(capsys):
    assert main(["run", "nowhere", "--robot", "drone", "--seed", "1", "--json"]) == 2
    assert "unknown world 'nowhere'" in json.loads(capsys.readouterr().out)["error"]


def test_list_names_what_is_registered(capsys):
    assert main(["list", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {"warehouse", "corridor", "empty"} <= set(document["worlds"])
    assert set(document["robots"]) == {"drone", "quadruped"}
    assert "map.resolution" in document["settings"]


def test_the_module_is_the_command():
    printed = subprocess.run(
        [sys.executable, "-m", "harness", "list"], capture_output=True, text=True, check=True
    )
    assert "worlds: " in printed.stdout
