"""A planner or controller of the user's own that fails: the episode is an error, the log whole."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override, to_json
from wayproof.harness.errors import NeverReturned
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.matching import mismatch
from wayproof.harness.study.plan import CLEAN, Arm, planned_for
from wayproof.harness.user_code import LONGEST_TRACEBACK, bounded, failure_of
from wayproof.planners import FreeSpace, PlannerConfig, plan
from wayproof.plugin import UserCodeError, files_of, load_class

ROOT = Path(__file__).parents[2]

PLANNERS = '''
"""Planners that go well at first, and then do not."""
import ctypes
import os
import signal
import time

from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.astar.grid_astar import GridAStar


class Late(GridAStar):
    """Fails at its second plan."""

    calls = 0

    def __init__(self, information):
        super().__init__(information, 1.0)

    def solve(self, until):
        type(self).calls += 1
        if type(self).calls == 1:
            return super().solve(until)
        return self.fail()

    def add(self, *places):
        information = self.getSpaceInformation()
        path = og.PathGeometric(information)
        kind = information.getStateValidityChecker().kind
        for place in places:
            state = information.allocState()
            kind.write(state, (*place, 0.0))
            path.append(state)
        self.getProblemDefinition().addSolutionPath(path, False, 0.0, "late")
        return ob.PlannerStatus(True, False)


class Raises(Late):
    def fail(self):
        raise ValueError("no way \\x1b[31m out")


class Leaves(Late):
    def fail(self):
        raise SystemExit(0)


class ReturnsNone(Late):
    def fail(self):
        return None


class NotFinite(Late):
    def fail(self):
        return self.add((1.0, 1.0, 1.0), (float("nan"), 1.0, 1.0), (2.0, 1.0, 1.0))


class Elsewhere(Late):
    def fail(self):
        return self.add((1.0, 1.0, 1.0), (2.0, 1.0, 1.0))


class Short(Late):
    def fail(self):
        return self.add((1.0, 1.0, 1.0))


class Loops(Late):
    def fail(self):
        while True:
            try:
                time.sleep(0.01)
            except Exception:
                pass


class Holds(Late):
    def fail(self):
        """Wait in the C library for itself, holding on to the interpreter; no core works."""
        mutex = ctypes.create_string_buffer(64)
        for _ in range(2):
            ctypes.PyDLL(None).pthread_mutex_lock(mutex)


class Killed(Late):
    def fail(self):
        os.kill(os.getpid(), signal.SIGKILL)


class Unmade(ob.Planner):
    def __init__(self, information):
        raise RuntimeError("not today")


class Good(GridAStar):
    def __init__(self, information):
        super().__init__(information, 1.0)
'''

# The search for a cheaper global path comes once a second: the second one at decision 10.
RUN = ["run", "corridor", "--robot", "drone", "--seed", "1", "--set", "map.resolution=0.2"]
RUN += ["--set", "planner.restarts=1"]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("mine") / "mine.py"
    path.write_text(PLANNERS)
    return path


def run(capsys, name, log, *options):
    load_class(name).calls = 0
    arguments = [*RUN, "--set", f"planner.name={name}", "--log", str(log), "--json", *options]
    code = main(arguments)
    return code, json.loads(capsys.readouterr().out)


def ended(capsys, path, name, said, *options):
    """Run to the error; its log."""
    code, result = run(capsys, name, path, *options)
    assert (code, result["outcome"]) == (1, "error")
    assert result["reason"].startswith(f"planner '{name}' {said}")
    assert result["reason"].endswith(f"at decision {result['decisions']}")
    assert result["decisions"] > 0
    log = open_log(path, allow_plugins=True)
    assert log.result["reason"] == result["reason"]
    assert not list(path.parent.glob("*.partial"))
    return log


def test_a_planner_that_raises_ends_the_episode_with_its_evidence(capsys, tmp_path, file):
    path = tmp_path / "log.mcap"
    name = f"{file}:Raises"
    log = ended(capsys, path, name, r"raised ValueError: no way \x1b[31m out (mine.py:")
    assert "in fail" in log.traceback
    assert "\x1b" not in log.traceback
    assert main(["explain", str(path), "--allow-plugins"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"error: planner '{name}'")
    assert log.traceback.splitlines()[-1] in shown
    settings = [*RUN[7::2], f"planner.name={name}"]
    config = override(Config("corridor", "drone", 1), settings)
    arm = Arm("corridor", "drone", "", CLEAN, 0.0)
    planned = planned_for(arm, config, contents_of(named_by(config)))
    assert mismatch(log, planned) == ""
    other = replace(log, plugins={name: "0" * 64})
    assert "or with another file of" in mismatch(other, planned)
    load_class(name).calls = 0
    assert main(["replay", str(path), "--allow-plugins"]) == 0
    count = log.result["decisions"]
    assert f"identical: {count} of {count}" in capsys.readouterr().out
    assert main(["explain", str(path), "--metrics", "--allow-plugins"]) == 0


@pytest.mark.parametrize(
    ("kind", "said", "options"),
    [
        ("Leaves", "raised SystemExit: 0 (mine.py:", ()),
        (
            "Loops",
            "had not returned after 5 s (plugins.wall_s)",
            ("--set", "plugins.wall_s=5"),
        ),
    ],
)
def test_a_planner_that_leaves_or_loops_ends_the_episode_likewise(
    capsys, tmp_path, file, kind, said, options
):
    log = ended(capsys, tmp_path / "log.mcap", f"{file}:{kind}", said, *options)
    assert "in fail" in log.traceback


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("ReturnsNone", "returned NoneType from solve, expected ompl.base.PlannerStatus"),
        ("NotFinite", "added a path whose state 1 is (nan, 1.000, 1.000)"),
        ("Elsewhere", "added a path with its start at (1.000, 1.000, 1.000), expected ("),
        ("Short", "added a path of 1 states, expected 2 or more"),
    ],
)
def test_what_a_planner_answers_is_checked(file, kind, said):
    """Each raises as a planner that raises does, and so ends an episode likewise."""
    name = f"{file}:{kind}"
    load_class(name).calls = 1
    field = np.full((20, 20, 12), 100, np.uint16)
    space = FreeSpace(field, np.zeros(3), 0.2, 4, np.zeros(101))
    near, far = np.array([0.5, 0.5, 0.5]), np.array([3.0, 3.0, 1.5])
    with pytest.raises(UserCodeError, match=re.escape(f"planner '{name}' {said}")):
        plan(space, near, far, PlannerConfig(name=name, restarts=1), seed=1)


def test_a_planner_that_cannot_be_made_leaves_a_log_without_decisions(capsys, tmp_path, file):
    path = tmp_path / "log.mcap"
    code, result = run(capsys, f"{file}:Unmade", path)
    assert (code, result["outcome"], result["decisions"]) == (1, "error", 0)
    assert "raised RuntimeError: not today" in result["reason"]
    assert result["reason"].endswith("at decision 0")
    assert main(["explain", str(path), "--allow-plugins"]) == 0
    assert "RuntimeError: not today" in capsys.readouterr().out
    assert main(["replay", str(path), "--allow-plugins"]) == 2
    assert "no decisions in it" in capsys.readouterr().err


def command(*arguments, cwd, **environment):
    return subprocess.run(
        [sys.executable, "-m", "wayproof", *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )


def whole_log(folder, name, said, setting="planner.name", **environment):
    """Run in a process of its own, which can finish nothing; its log."""
    options = ["--set", f"{setting}={name}", "--set", "plugins.wall_s=3", "--log", "a.mcap"]
    done = command(*RUN, *options, cwd=folder, **environment)
    assert done.returncode == 1
    assert said in done.stderr
    assert "log: " in done.stdout
    log = open_log(folder / "a.mcap", allow_plugins=True)
    assert log.result["outcome"] == "error"
    assert name in log.result["reason"]
    assert int(log.result["decisions"]) == sum(1 for _ in log.records()) > 0
    assert not list(folder.glob("*.partial*"))
    return log


@pytest.mark.large
def test_a_process_that_holds_on_leaves_a_whole_log(tmp_path, file):
    said = "the process did not return, and could not be interrupted"
    log = whole_log(tmp_path, f"{file}:Holds", said)
    assert "in fail" in log.traceback


def test_a_process_that_is_killed_leaves_a_whole_log_beside_packages_of_our_names(
    tmp_path, file, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # a relative name is looked for in the current folder
    (tmp_path / "planners").mkdir()
    (tmp_path / "planners" / "__init__.py").write_text("1 / 0\n")
    (tmp_path / "models.py").write_text("1 / 0\n")
    (tmp_path / "maps.py").write_text("1 / 0\n")
    shutil.copy(file, tmp_path / "mine.py")
    said = "the process was ended by SIGKILL after "
    whole_log(tmp_path, "mine.py:Killed", said, PYTHONPATH=f".:{ROOT}/src")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nowhere.py:Good", "no file 'nowhere.py' (looked for in '"),
        ("{}:Godo", "has no class 'Godo' (classes in it: Late, Raises, "),
        ("{}", "unknown planner.name"),
        ("{}:", "expected module:Class or path/to/file.py:Class"),
        ("{raising}:Good", "raised ZeroDivisionError: division by zero (raising.py:1)"),
        ("{typo}:Good", "raised SyntaxError: "),
        ("json:JSONDecoder", "expected a class made of ompl.base.Planner"),
    ],
)
def test_a_name_that_loads_nothing_is_one_line(capsys, tmp_path, file, name, said):
    (tmp_path / "raising.py").write_text("1 / 0\n")
    (tmp_path / "typo.py").write_text("class Good(:\n")
    name = name.format(file, raising=tmp_path / "raising.py", typo=tmp_path / "typo.py")
    assert main([*RUN, "--set", f"planner.name={name}", "--logs", str(tmp_path / "logs")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert said in line
    assert not (tmp_path / "logs").exists()


def test_a_file_that_changed_is_told_by_a_replay(capsys, tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text(PLANNERS)
    path = tmp_path / "log.mcap"
    run(capsys, f"{mine}:Good", path, "--set", "episode.time_limit=0.5")
    assert main(["replay", str(path), "--allow-plugins"]) == 0
    assert "changed" not in capsys.readouterr().err
    mine.write_text(f"{PLANNERS}\n# other words\n")
    assert main(["replay", str(path), "--allow-plugins"]) == 0
    assert f"warning: the file of '{mine}:Good' has changed since" in capsys.readouterr().err
    mine.unlink()
    assert main(["replay", str(path), "--allow-plugins"]) == 2
    assert f"no file '{mine}'" in capsys.readouterr().err


def test_a_fault_of_ours_is_a_traceback_and_the_log_is_whole(tmp_path, monkeypatch):
    from wayproof.harness.runner import run_episode
    from wayproof.harness.scenario.scenario import build
    from wayproof.harness.stack.pipeline import Navigator

    step = Navigator.step

    def planted(self, inputs, sense_ms=0.0, answer=None):
        if inputs.sequence == 2:
            raise TypeError("planted")
        return step(self, inputs, sense_ms, answer)

    monkeypatch.setattr(Navigator, "step", planted)
    path = tmp_path / "log.mcap"
    scenario = build(override(Config("empty", "drone", 1), ["map.resolution=0.2"]))
    with pytest.raises(TypeError, match="planted") as caught:
        run_episode(scenario, path)
    assert caught.value.__notes__ == [f"at decision 2; the log is {path}"]
    log = open_log(path)
    assert log.result["outcome"] == "error"
    assert log.result["reason"] == "internal error: TypeError: planted at decision 2"
    assert log.result["decisions"] == "2"
    assert "TypeError: planted" in log.traceback
    monkeypatch.setattr(Navigator, "commit", planted_commit)
    with pytest.raises(TypeError, match="planted"):  # in a replay likewise: it is no bad input
        main(["replay", str(path)])


def planted_commit(self, decision, delay_s):
    raise TypeError("planted")


def test_what_a_log_keeps_of_a_traceback_is_bounded():
    text = bounded("\n".join(f"line {k} \x1b[2J" for k in range(10_000)))
    assert len(text) <= LONGEST_TRACEBACK + 100
    assert text.endswith("line 9999 \\x1b[2J\n")
    assert text.startswith("[the beginning is left out]\n")


def test_memory_and_time_are_the_users_where_there_is_a_user():
    ours = failure_of(MemoryError(), "at decision 3", [])
    theirs = failure_of(MemoryError(), "at decision 3", ["a.py:B"])
    assert ours.ours
    assert not theirs.ours
    assert theirs.reason == "out of memory with a.py:B at decision 3"
    late = failure_of(NeverReturned("had not returned"), "after decision 3", ["a.py:B"])
    assert late.reason == "a.py:B had not returned after decision 3"


def test_a_study_keeps_what_an_episode_in_error_had_logged(recorded, tmp_path):
    from wayproof.harness.study.store import Store

    whole = Path(recorded("empty", "drone", 1).log).read_bytes()
    store = Store(tmp_path)
    with store.open():
        (tmp_path / "logs" / "a.mcap.partial").write_bytes(whole[: len(whole) * 2 // 3])
        store.record_error("a", "took more than the 900 s that bounds.wall_s allows")
        store.keep_evidence("a", "took more than the 900 s that bounds.wall_s allows")
        log = open_log(tmp_path / "errors" / "a.mcap")
        assert log.result["outcome"] == "error"
        assert "took more than the 900 s" in log.result["reason"]
        assert int(log.result["decisions"]) == sum(1 for _ in log.records()) > 0
        assert not list((tmp_path / "logs").iterdir())
        assert store.is_done("a")
        shutil.copy(tmp_path / "errors" / "a.mcap", tmp_path / "logs" / "b.mcap")
        (tmp_path / "logs" / "c.mcap").write_bytes(whole)
        store.forget_errors()
        assert [store.is_done(key) for key in "abc"] == [False, False, True]
        assert not list((tmp_path / "errors").iterdir())


def test_a_planner_s_changed_file_makes_other_episodes_of_a_study(tmp_path):
    from wayproof.harness.study.file import StudyFile
    from wayproof.harness.study.job import Job, run_job
    from wayproof.harness.study.plan import plan_episodes

    def planned(path, text):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        settings = {"planner.name": f"{path}:Good"}
        study = StudyFile("s", worlds=["empty"], robots=["drone"], seeds=1, settings=settings)
        return plan_episodes(study)[0]

    first = planned(tmp_path / "mine.py", PLANNERS)
    assert planned(tmp_path / "elsewhere" / "other.py", PLANNERS).key == first.key
    changed = planned(tmp_path / "mine.py", f"{PLANNERS}\n# other words\n")
    assert changed.key != first.key
    done = run_job(Job(first.key, to_json(first.config), tmp_path / "a.mcap"))
    assert done.error == "Wayproof or a file that its config names was changed since the plan"
    assert not (tmp_path / "a.mcap").exists()


def test_the_formulas_of_a_score_are_printed_where_asked_for(recorded, capsys):
    log = recorded("empty", "drone", 1).log
    assert main(["explain", log, "--metrics"]) == 0
    assert "Anderson" not in capsys.readouterr().out
    assert main(["explain", log, "--metrics", "--long"]) == 0
    assert "Anderson" in capsys.readouterr().out


def test_the_code_of_a_class_is_found_in_folders_without_an_init(tmp_path):
    inner = tmp_path / "parts" / "deep"
    inner.mkdir(parents=True)
    (inner / "gain.py").write_text("GAIN = 1\n")
    (tmp_path / "stack.py").write_text("from parts.deep import gain\n")
    assert files_of(tmp_path / "stack.py") == [tmp_path / "stack.py", inner / "gain.py"]
