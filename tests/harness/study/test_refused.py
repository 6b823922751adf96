"""Studies that cannot be meant, are too large or would run code: refused before anything runs."""

import json
import re
from pathlib import Path

import pytest

from tests.harness.shadow.conftest import BODY, FR079
from tests.harness.study.here import HEAD, SMALL, written
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.models.robots import custom

GATED = SMALL.replace("seeds", 'gates = ["success.drop <= 0"]\nseeds')
GAP = SMALL.replace("seeds", 'stacks = ["gap"]\nseeds')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nam = 1", "unknown field `nam`"),
        ("seeds = 1", "missing required field `name`"),
        (SMALL.replace("seeds = 2", 'seeds = "many"'), "seeds"),
        (SMALL.replace("seeds = 2", "seeds = 0"), "seeds is empty"),
        (SMALL.replace("seeds = 2", "seeds = [-1]"), "`int` >= 0"),
        (SMALL.replace("seeds = 2", f"seeds = [{2**63}]"), "seeds"),
        (SMALL.replace('name = "small"', 'name = "../up"'), "expected letters"),
        (SMALL.replace("= 1\n", "= three\n"), "Invalid value"),
        (SMALL + '[axes]\n"map.nonsense" = [1]', "unknown setting 'map.nonsense'"),
        (SMALL + '[axes]\n"map.resolution" = []', "axis 'map.resolution' is empty"),
        (SMALL + '[axes]\n"planner.name" = ["rrtstr"]', "did you mean 'rrtstar'"),
        (SMALL + "[bounds]\nwall_s = 0", "bounds of 0 s"),
        (SMALL + f"[axes]\n{'a.' * 9999}a = 1", "nested too deeply"),
        (SMALL + f"[set]\n'start' = {'[' * 99}{']' * 99}", "set"),
        (SMALL.replace("= 0.2", "= 1979-05-27"), "set"),
        (SMALL + "[colour]\nred = 1", "unknown field `colour`"),
        (GATED.replace("success.drop <= 0", "sucess.drop <= 0"), "did you mean 'success'"),
        (GATED.replace("success.drop <= 0", "success.fall <= 0"), "STATISTIC one of drop, rise"),
        (GATED.replace("<= 0", "<= 1e999"), "expected a number"),
        (GATED, "difference needs pairs"),
        (GATED.replace("success.drop", "collisions.rise"), "difference needs pairs"),
        (GATED.replace("seeds", 'stacks = ["gap"]\nseeds'), "two stacks"),
        (GAP.replace("gap", "gpa"), "unknown stack of study 'small' 'gpa'; did you mean 'gap'?"),
        (GAP + "[axes]\n'stack.name' = ['gap']", "stacks and stack.name, expected"),
    ],
)
def test_a_wrong_study_is_one_line(tmp_path, text, message):
    with pytest.raises(InputError) as caught:
        plan_episodes(read_study(written(tmp_path, text)))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("smoky", [], r"unknown study 'smoky'; did you mean 'smoke'\?"),
        ("calibrate", ["axes.costmap.localization_margin=[0.2,0.1]"], "two rising numbers"),
        ("calibrate", ["perturbations.pose_drift=[1]"], "expected `perturbation` in"),
        ("calibrate", ["calibrate.bound=1.0"], r"Expected `float` < 1.0"),
        ("calibrate", ["kind=grid", "calibrate.bound=0.1"], r"\[calibrate\] in a study of kind"),
        ("falsify", ["perturbations=pose_jump:5"], "the search chooses the severity"),
        ("falsify", ["perturbations=slip"], "acts all the time"),
        ("falsify", ["falsify.greatest=0"], "Expected `float` > 0.05"),
        ("falsify", ["kind=threshold", "perturbations.rate:3=[]"], "rate:3': the search chooses"),
        ("falsify", ["perturbations={}"], r"no \[perturbations\] to search"),
        ("falsify", ["worlds"], "expected NAME=VALUE"),
        ("threshold", ["perturbations=pose_drfit"], "did you mean 'pose_drift'"),
    ],
)
def test_a_setting_that_a_packaged_study_cannot_use_is_refused(name, settings, message):
    with pytest.raises(InputError, match=message):
        read_study(name, settings=settings)


RECORDED = f"""
name = "cut"
recordings = ["{FR079}"]
robots = ["wheeled.toml"]
seeds = 1
[read]
end = 4
[perturbations]
depth_noise = [5]
"""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("recordings = ", 'worlds = ["empty"]\nrecordings = '), "expected one of the two"),
        (("depth_noise", "motion"), "changes the world"),
        (("[read]", '[set]\n"stack.name" = "gap"\n\n[read]'), "expected `stacks`"),
        (("end = ", "stop = "), "stop"),
        (("fr079-200", "no"), "no such file"),
        (("end = 4", "end = 0.000001\nbegin = 1e8\n#"), "no sweep"),
    ],
)
def test_a_wrong_study_of_recordings_is_one_line(tmp_path, monkeypatch, change, message):
    monkeypatch.chdir(tmp_path)
    Path("wheeled.toml").write_text(BODY)
    with pytest.raises(InputError, match=message) as caught:
        plan_episodes(read_study(written(tmp_path, RECORDED.replace(*change))))
    assert "\n" not in str(caught.value)


def values(count):
    return str([round(0.1 + 0.001 * k, 3) for k in range(count)])


def axes(count, *names):
    return "seeds = 1\n[axes]\n" + "".join(f'"{name}" = {values(count)}\n' for name in names)


FOUR = (
    "costmap.localization_margin",
    "costmap.cost_range",
    "behaviour.blend_length",
    "motion.altitude_low",
)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("seeds = 100000000000\n", [], "100000000000 episodes, expected at most 100000"),
        ("seeds = " + "9" * 5000 + "\n", [], "Exceeds the limit"),
        ("seeds = -3\n", [], "seeds is empty"),
        (axes(200, *FOUR), [], "1600000000 arms, expected at most 5000"),
        (f"seeds = 1\n[perturbations]\nlatency = {values(6000)}\n", [], "6001 arms"),
        (axes(60, *FOUR[:2]).replace("seeds = 1", "seeds = 100"), [], "360000 episodes"),
        (f"seeds = 1\n# {'x' * 2**20}\n", [], "bytes, expected at most 1048576"),
        (f"seeds = {'[' * 50000}{']' * 50000}\n", [], "nested too deeply"),
        ("seeds = 1", ["--set", "worlds=emty"], "unknown world of study 'small' 'emty'; did you"),
        ("seeds = 1", ["--set", "robots=dron"], "unknown robot of study 'small' 'dron'; did you"),
        ("seeds = 1", ["--jobs", "0"], "--jobs 0: expected at least 1"),
        ("seeds = 1", ["--engine", "foo"], "unknown engine 'foo'"),
        (
            'seeds = 1\ngates = ["success.mean >= 0.5"]',
            ["--until-decided", "--at-most", "0"],
            "expected at least 1",
        ),
        ("seeds = 1", ["--until-decided"], "expected a study with gates"),
    ],
)
def test_a_study_is_refused_before_anything_runs(tmp_path, capsys, text, options, message):
    command = ["study", written(tmp_path, HEAD + text), "--out", str(tmp_path / "out")]
    assert main([*command, *options]) == 2
    printed = capsys.readouterr()
    [line] = printed.err.splitlines()
    assert message in line
    assert printed.out == ""
    assert not (tmp_path / "out").exists()


def test_the_folder_of_a_study_is_bounded_too(tmp_path):
    store = Store(tmp_path)
    document = {"name": "a", "worlds": ["empty"], "robots": ["drone"], "seeds": 10**11}
    store.study.write_text(json.dumps(document))
    with pytest.raises(InputError, match="100000000000 episodes"):
        store.read_study()
    store.study.write_text(json.dumps({**document, "seeds": 1}) + " " * 2**20)
    with pytest.raises(InputError, match="bytes, expected at most"):
        store.read_study()


SPEC = (Path(custom.__file__).parent / "examples" / "spot.toml").read_text()

CODE = {
    "set": 'seeds = 1\n[set]\n"planner.name" = "planted:Planner"\n',
    "axis": 'seeds = 1\n[axes]\n"planner.name" = ["astar", "planted:Planner"]\n',
    "stack": 'seeds = 1\nstacks = ["builtin", "planted:Stack"]\n',
    "stack setting": 'seeds = 1\n[set]\n"stack.name" = "exec:touch ran"\n',
    "robot": "seeds = 1\n",
    "text": 'seeds = 1\n[set]\n"robot_file" = "controller = \'planted:Controller\'"\n',
}


@pytest.mark.parametrize("name", CODE)
def test_neither_a_study_nor_its_folder_runs_code(name, tmp_path, capsys, monkeypatch):
    (tmp_path / "planted.py").write_text("open('ran', 'w').close()\n")
    (tmp_path / "robot.toml").write_text(
        re.sub('controller = ".*"', 'controller = "planted:Controller"', SPEC)
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    text = HEAD + CODE[name]
    if name == "robot":
        text = text.replace('"drone"', '"robot.toml"')
    written(tmp_path, text)
    assert main(["study", "study.toml", "--out", "out"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "expected --allow-plugins" in line
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "ran").exists()
    study = read_study("study.toml", allow_plugins=True)
    (tmp_path / "ran").unlink(missing_ok=True)
    store = Store(tmp_path)
    store.keep_study(study, {})
    with pytest.raises(InputError, match="expected --allow-plugins"):
        store.read_study()
    assert not (tmp_path / "ran").exists()
    assert store.read_study(allow_plugins=True) == study
