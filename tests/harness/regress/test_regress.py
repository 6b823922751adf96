"""A failure is shrunk, becomes a test folder, and pytest fails on it until the stack is mended."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.log.reader import open_log
from wayproof.harness.regress.scene import case_of
from wayproof.harness.regress.shrink import _reduced, _Spent
from wayproof.harness.scenario.scenario import build


@pytest.fixture(scope="module")
def failure(tmp_path_factory):
    """A log of a drone that flies straight at its goal into a pillar."""
    path = tmp_path_factory.mktemp("failure") / "blind.mcap"
    words = ["run", "cylinders", "--robot", "drone", "--seed", "2", "--stack", "blind"]
    assert main([*words, "--log", str(path)]) == 1
    return path


@pytest.mark.large
def test_what_is_left_fails_alike_and_is_smaller(failure, tmp_path):
    shrunk = tmp_path / "shrunk"
    words = ["shrink", str(failure), "--jobs", "1", "--json"]
    assert main([*words, "--out", str(shrunk)]) == 0
    before, after = open_log(failure), open_log(shrunk / "shrunk.mcap")
    for figure in ("outcome", "cause"):
        assert after.result[figure] == before.result[figure]
    assert after.scene.count("<geom") < before.scene.count("<geom") / 2
    again = tmp_path / "again.mcap"
    words = ["run", str(shrunk / "world.xml"), "--robot", "drone", "--seed", "2"]
    assert main([*words, "--stack", "blind", "--log", str(again)]) == 1
    assert open_log(again).result["chain"] == after.result["chain"]
    assert not (shrunk / "tries").exists()


def test_a_bound_ends_the_search_which_goes_on(failure, tmp_path, capsys):
    words = ["shrink", str(failure), "--jobs", "1", "--json", "--out", str(tmp_path / "small")]
    assert main([*words, "--at-most", "2"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert not document["ended"]
    assert document["before"] == document["after"]
    assert (tmp_path / "small" / "tries" / "logs").is_dir()


class Oracle:
    """Scenarios fail alike while a given mover or solid is in them; so many may be asked for."""

    def __init__(self, needed, most):
        self.needed, self.most, self.episodes = needed, most, 0

    def fail_alike(self, cases):
        self.episodes += len(cases)
        if self.episodes > self.most:
            raise _Spent
        return [self.needed in one.found.parts for one in cases]


def test_a_bound_keeps_what_was_taken_away_until_then(failure):
    case = case_of(open_log(failure), 10, None)
    needed = case.found.parts[-1]
    smaller, ended = _reduced(case, Oracle(needed, most=10), lambda line: None)
    assert not ended
    assert needed in smaller.found.parts
    assert 1 < len(smaller.found.parts) < len(case.found.parts) / 2
    smallest, ended = _reduced(case, Oracle(needed, most=1000), lambda line: None)
    assert ended
    assert list(smallest.found.parts) == [needed]


def test_a_success_has_nothing_to_shrink(tmp_path, capsys):
    log = tmp_path / "good.mcap"
    words = ["run", "empty", "--robot", "drone", "--seed", "1", "--goal", "3,3"]
    main([*words, "--log", str(log)])
    capsys.readouterr()
    assert main(["shrink", str(log)]) == 2
    assert "success, expected a failure with a cause" in capsys.readouterr().err


def test_pytest_fails_until_the_stack_is_mended(failure, tmp_path):
    test = tmp_path / "test"
    assert main(["regress", str(failure), "--out", str(test)]) == 0
    words = [sys.executable, "-m", "pytest", "-q", "--wayproof", str(test), str(test)]
    found = run_pytest(words, tmp_path)
    assert found.returncode == 1, found.stdout
    assert "2 failed" in found.stdout
    assert "failed: success.every >= 1" in found.stdout
    assert "wayproof explain" in found.stdout
    mended = [*words, "--wayproof-set", "stacks=builtin", f"--junitxml={tmp_path / 'junit.xml'}"]
    found = run_pytest(mended, tmp_path)
    assert found.returncode == 0, found.stdout
    assert 'name="success.every' in (tmp_path / "junit.xml").read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name = ", "test.toml"),
        ('name = "x"\nworlds = ["lost.xml"]\nrobots = ["drone"]\nseeds = 1\n'
         'gates = ["success.every >= 1"]\n', "lost.xml"),
        ('name = "x"\nworlds = ["empty"]\nrobots = ["drone"]\nseeds = 1\n', "no gates"),
    ],
)  # fmt: skip
def test_a_test_that_cannot_run_fails_in_a_line(tmp_path, text, said):
    (tmp_path / "test.toml").write_text(text)
    words = [sys.executable, "-m", "pytest", "-q", "--wayproof", str(tmp_path), str(tmp_path)]
    found = run_pytest(words, tmp_path)
    assert found.returncode in (1, 2)
    assert said in found.stdout
    assert "Traceback" not in found.stdout + found.stderr
    assert "INTERNALERROR" not in found.stdout + found.stderr


def test_a_recording_becomes_a_world_whose_unseen_parts_are_named(tmp_path):
    log, recording, test = (tmp_path / name for name in ("log.mcap", "rec.mcap", "test"))
    words = ["run", "warehouse", "--robot", "quadruped", "--seed", "3"]
    main([*words, "--set", "episode.time_limit=4", "--log", str(log)])
    assert main(["shadow", str(log), "--robot", "quadruped", "--log", str(recording)]) == 0
    words = ["regress", str(recording), "--out", str(test)]
    assert main([*words, "--robot", "quadruped"]) == 0
    scenario = build(Config(str(test / "world.xml"), "quadruped", 0))
    kinds = {name.rpartition("_")[0] for name in scenario.world.solid_names}
    assert kinds == {"wall", "unseen"}
    driven = [truth.position for truth in open_log(log).truth()]
    for place, recorded in (
        (scenario.mission.start, driven[0]),
        (scenario.mission.goal, driven[-1]),
    ):
        assert math.dist(place[:2], recorded[:2]) < 0.5
    assert main([*words, "--robot", "no-such"]) == 2


def run_pytest(words, folder):
    own = {name: text for name, text in os.environ.items() if not name.startswith("PYTEST")}
    return subprocess.run(words, cwd=folder, env=own, text=True, capture_output=True, check=False)


MARKED = """\
import pytest


@pytest.mark.wayproof("empty", robot="drone", seeds=[1, 2], goals=[(5.5, 4.0)],
                      settings={"start": [4.0, 4.0], "episode.time_limit": 6.0})
def test_it_arrives_by_seed(episode):
    assert (episode.outcome, episode.config.seed) == ("success", 1)


@pytest.mark.wayproof("nowhere", robot="drone")
def test_of_no_world(episode):
    pass


def test_without_the_marker(episode):
    pass
"""


def test_a_marked_test_runs_for_each_seed(tmp_path):
    (tmp_path / "test_mine.py").write_text(MARKED)
    words = [sys.executable, "-m", "pytest", "-q", "--strict-markers", str(tmp_path)]
    found = run_pytest(words, tmp_path)
    assert "1 passed" in found.stdout
    assert "1 failed, 1 passed, 2 errors" in found.stdout
    assert "test_it_arrives_by_seed[seed 2]" in found.stdout
    assert "next: wayproof explain" in found.stdout
    assert "marker 'wayproof': unknown world 'nowhere'" in found.stdout
    assert "expected a test of the marker" in found.stdout


@pytest.mark.parametrize(
    ("seeds", "given", "said"),
    [("0", "episode", "no seeds, expected"), ("2", "tmp_path", "no argument 'episode', expected")],
)
def test_a_marked_test_that_would_run_nothing_is_an_error(tmp_path, seeds, given, said):
    (tmp_path / "test_mine.py").write_text(
        "import pytest\n"
        f"@pytest.mark.wayproof('empty', robot='drone', seeds={seeds})\n"
        f"def test_of_nothing({given}):\n    pass\n"
    )
    found = run_pytest([sys.executable, "-m", "pytest", "-q", str(tmp_path)], tmp_path)
    assert found.returncode == 2, found.stdout
    assert said in found.stdout
