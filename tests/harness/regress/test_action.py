"""The steps of the action, run by a shell as GitHub runs them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[3]

STUDY = """\
name = "ci"
worlds = ["empty"]
robots = ["drone"]
stacks = ["mine.py:Mine"]
seeds = 2
gates = ["collisions.every <= 0"]

[set]
start = [4.0, 4.0]
goal = [5.5, 4.0]
"episode.time_limit" = 4.0
"""

STACK = """\
from wayproof.harness.interface.stacks.blind import Blind


class Mine(Blind):
    def step(self, observation):
        return {command}
"""

GOOD = STACK.format(command="super().step(observation)")
BROKEN = STACK.format(command="None")


class Runner:
    """What GitHub gives the steps: folders, files of outputs, the inputs in expressions."""

    def __init__(self, folder, **inputs):
        self.folder, self.inputs = folder, {"gates": "", "package": "", **inputs}
        self.summary = folder / "summary.md"
        self.temporary = folder.parent / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.outputs, self.path = {}, str(Path(sys.executable).parent)

    def run(self, *names):
        """Run the named steps; return the exit code of the last."""
        action = yaml.safe_load((ROOT / "action.yml").read_text())
        steps = [one for one in action["runs"]["steps"] if one["name"] in names]
        assert [one["name"] for one in steps] == list(names)
        return [self._step(one) for one in steps][-1]

    def _step(self, step):
        files = {one: self.temporary / one for one in ("GITHUB_OUTPUT", "GITHUB_PATH")}
        for file in files.values():
            file.write_text("")
        given = {name: self._value(text) for name, text in step.get("env", {}).items()}
        environment = os.environ | given | {name: str(file) for name, file in files.items()}
        environment |= {
            "PATH": f"{self.path}:{os.environ['PATH']}",
            "RUNNER_TEMP": str(self.temporary),
            "GITHUB_ACTION_PATH": str(ROOT),
            "GITHUB_STEP_SUMMARY": str(self.summary),
        }
        shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
        ended = subprocess.run(shell, cwd=self.folder, env=environment, timeout=1800)
        lines = files["GITHUB_OUTPUT"].read_text().splitlines()
        self.outputs[step.get("id")] = dict(line.split("=", 1) for line in lines)
        self.path = ":".join([*files["GITHUB_PATH"].read_text().split(), self.path])
        return ended.returncode

    def _value(self, text):
        if "allow-inconclusive" in text:
            return ""
        kind, *names = re.fullmatch(r"\$\{\{ ([\w.-]+) \}\}", text)[1].split(".")
        if kind == "inputs":
            return self.inputs[names[0]]
        return self.outputs[names[0]][names[2]]


@pytest.fixture
def repository(tmp_path):
    """A repository with a stack and its study."""
    folder = tmp_path / "repository"
    folder.mkdir()
    (folder / "ci.toml").write_text(STUDY)
    (folder / "mine.py").write_text(GOOD)
    return folder


def test_a_pull_request_is_judged_against_the_base_branch(repository):
    runner = Runner(repository, study="ci.toml", gates="success.every >= 1")
    assert runner.run("Run the study", "Verdict") == 0
    assert "collisions.every" in runner.summary.read_text()
    assert "success.every" not in runner.summary.read_text()
    assert "Not compared" in runner.summary.read_text()
    (repository / "mine.py").write_text(BROKEN)
    assert runner.run("Run the study", "Verdict") == 1
    summary = runner.summary.read_text()
    assert "❌ failed | success.every" in summary
    assert "wayproof explain" in summary
    assert (repository / "wayproof-results" / "compare.xml").is_file()


def test_a_study_that_cannot_be_read_is_said_so(repository, capfd):
    (repository / "ci.toml").write_text("name = 3")
    assert Runner(repository, study="ci.toml").run("Run the study", "Verdict") == 2
    assert "study 'ci.toml'" in capfd.readouterr().err


@pytest.mark.large
def test_every_step_runs_from_a_wheel_alone(repository, tmp_path):
    wheels = tmp_path / "wheels"
    words = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
    subprocess.run([*words, "--wheel-dir", wheels, ROOT], check=True, capture_output=True)
    (wheel,) = wheels.iterdir()
    runner = Runner(repository, study="ci.toml", package=str(wheel))
    steps = ("Install", "Compile the kernels", "Run the study", "Verdict")
    assert runner.run(*steps) == 0
    assert set(runner.outputs["install"]) == {"kernels", "digest"}
