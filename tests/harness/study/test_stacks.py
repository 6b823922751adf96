"""Stacks as an axis of a study: planned, identified, paired, tabulated and compared."""

import dataclasses
import json
import sys

import pyarrow.parquet as pq
import pytest

from tests.harness.study.here import BRIEF, HEAD, paired, row, run_here, written
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.machine import code_digest
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.analysis import samples_of
from wayproof.harness.study.compare import compare, differences_of, read_folder
from wayproof.harness.study.contents import contents_of, named_by
from wayproof.harness.study.file import read_study
from wayproof.harness.study.job import episode_key
from wayproof.harness.study.plan import Arm, plan_episodes, reference_of
from wayproof.harness.study.report.sections import stacks_section
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study, verdict_in_words

STACK = """
from wayproof.harness.interface.types import Command, Waypoints


class Mine:
    def start(self, task):
        self.goal = task.mission.goal

    def step(self, observation):
        return Command(Waypoints([self.goal], {speed}))

    def close(self):
        pass
"""


CRASHES = STACK.replace("return Command(Waypoints([self.goal], {speed}))", 'raise KeyError("map")')

NEAR = '"start" = [3.0, 3.0]\n"goal" = [5.0, 3.0]\n'
"""Ends that a drone flies between in two seconds."""


def planned(folder, *stacks, limit=1, more="", seeds="[1, 2]"):
    names = f"stacks = {json.dumps(stacks)}\nseeds = {seeds}"
    brief = BRIEF.replace("= 1\n", f"= {limit}\n")
    study = read_study(written(folder, f"{HEAD}{names}{brief}{more}"), allow_plugins=True)
    return study, plan_episodes(study)


def ran(folder, *stacks, limit=1, more=""):
    """Run a study and return its folder."""
    folder.mkdir(exist_ok=True)
    study, episodes = planned(folder, *stacks, limit=limit, more=more)
    store = Store(folder / "out")
    result = run_study(study, episodes, store, run_here, lambda done: None)
    assert (result.missing, result.errors) == (0, 0)
    return store.folder


def built(folder, speed):
    """Write a build of a stack, and return its name."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(STACK.format(speed=speed))
    return f"{folder / 'mine.py'}:Mine"


def test_stacks_are_arms_with_the_built_in_one_first(tmp_path):
    command = "exec:./my stack --quiet"
    _, episodes = planned(tmp_path, "gap", command, "builtin", "gap")
    assert [one.arm.stack for one in episodes[:3]] == ["builtin", "gap", command]
    assert len(episodes) == 3 * 2
    assert all(one.config.stack.name == one.arm.stack for one in episodes)
    assert all(one.arm.variant == "" for one in episodes)
    assert len({one.key for one in episodes}) == len(episodes)


def test_the_built_in_stack_has_the_key_of_a_study_without_stacks(tmp_path):
    _, episodes = planned(tmp_path, "builtin", "gap")
    _, plain = planned(tmp_path)
    assert [one.arm.stack for one in plain] == ["", ""]
    assert {one.key for one in plain} < {one.key for one in episodes}


def test_a_stack_of_ones_own_counts_by_the_content_of_its_file(tmp_path):
    def keys(folder, speed):
        return [one.key for one in planned(tmp_path, built(tmp_path / folder, speed))[1]]

    first = keys("a", 0.5)
    assert keys("elsewhere", 0.5) == first
    assert not set(keys("a", 0.6)) & set(first)


def test_references_of_stacks():
    def arm(stack, variant="", perturbation="none", severity=0):
        return Arm("empty", "drone", variant, perturbation, severity, stack)

    def reference(one):
        return reference_of(one, "a=1", "builtin")

    assert reference(arm("builtin", "a=1")) is None
    assert reference(arm("gap", "a=1")) == arm("builtin", "a=1")
    assert reference(arm("gap", "a=2")) == arm("builtin", "a=2")
    assert reference(arm("builtin", "a=2")) == arm("builtin", "a=1")
    assert reference(arm("gap", "a=2", "motion", 3)) == arm("gap", "a=2")


def test_the_table_of_stacks_by_hand():
    def ended(stack, seed, outcome, **figures):
        arm = Arm("office", "drone", "", "none", 0, stack)
        return row(seed, arm, outcome, duration=20.0, chain="c", **figures)

    rows = [
        ended("builtin", 1, "success"),
        ended("builtin", 2, "success"),
        ended("gap", 1, "success", not_admitted=0.2, guard_cuts=0.0),
        ended("gap", 2, "collision", collisions=1.0, not_admitted=0.6, guard_cuts=4.0),
    ]
    table = stacks_section(samples_of(paired(rows, stack="builtin")), 60.0)
    builtin, gap = ([cell.text for cell in cells] for cells in table.cells)
    assert builtin[:3] == ["office drone", "builtin", "2"]
    assert builtin[3].startswith("1.00 (")
    assert builtin[6:] == ["", ""]  # no referee
    assert gap[1:3] == ["gap", "2"]
    # A failure counts the limit: (20 + 60) / 2 = 40 s.
    starts = ["0.50 (", "0.50 (", "40.0 (", "0.400 (", "2.0 ("]
    assert [one.startswith(start) for one, start in zip(gap[3:], starts, strict=True)] == [True] * 5
    assert float(gap[5].split()[-1].rstrip(")")) <= 60.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of the built-in stack, a reference stack and one of the user's own."""
    folder = tmp_path_factory.mktemp("stacks")
    return ran(folder, "builtin", "blind", built(folder, 0.5))


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A study of one stack that reaches its goals."""
    place = tmp_path_factory.mktemp("before")
    return ran(place, built(place, 2.0), limit=4, more=NEAR)


def test_stacks_run_and_the_report_tabulates_them(folder, capsys):
    assert main(["report", str(folder), "--json"]) == 2  # it names code
    assert "expected --allow-plugins" in capsys.readouterr().err
    assert main(["report", str(folder), "--allow-plugins", "--json"]) == 0
    arms = {one["arm"]["stack"]: one for one in json.loads(capsys.readouterr().out)["arms"]}
    assert arms["builtin"]["against"] is None
    assert arms["builtin"]["metrics"]["not_admitted"] is None
    assert arms["blind"]["against"]["pairs"] == 2
    assert 0.0 <= arms["blind"]["metrics"]["not_admitted"] <= 1.0
    assert arms["blind"]["metrics"]["guard_cuts"] == 0.0
    page = (folder / "report.html").read_text()
    section = page[page.index("<h2>Stacks</h2>") :]
    assert section.index("builtin") < section.index("blind") < section.index("mine.py:Mine")
    table = pq.read_table(folder / "table.parquet")
    assert len(set(table["stack"].to_pylist())) == 3
    assert "not_admitted" in table.column_names


def test_a_build_of_a_stack_is_gated_against_the_one_before(before, tmp_path, capsys):
    """A build that is slower than the time limit allows, from another file of the same name."""
    gate = ["success.drop <= 0.9", "success.mean >= 0.2"]
    after = ran(tmp_path / "after", built(tmp_path / "after", 0.1), limit=4, more=NEAR)
    result = compare(before, after, gate, allow_plugins=True).result
    [arm] = result.arms
    assert arm.arm.stack.endswith("after/mine.py:Mine")
    assert (arm.against.pairs, arm.against.lost) == (2, (1, 2))
    assert arm.against.drop.estimate == 1.0
    assert result.missing == 0
    same = compare(before, before, gate, allow_plugins=True).result
    assert same.arms[0].against.changed == 0
    command = ["compare", str(before), str(after), "--allow-plugins"]
    assert main([*command, "--gate", "success.mean >= 0.99"]) == 1
    assert "lost 2, won 0" in " ".join(capsys.readouterr().out.split())


def test_a_build_that_fails_in_its_first_decision_has_failed_and_not_passed(before, tmp_path):
    place = tmp_path / "after"
    stack = built(place, 2.0)
    (place / "mine.py").write_text(CRASHES)
    after = ran(place, stack, limit=4, more=NEAR)
    result = compare(before, after, ["success.drop <= 0.1"], allow_plugins=True).result
    [arm] = result.arms
    assert arm.against.lost == (1, 2)
    assert dict(arm.outcomes) == {"error": 2}
    [gate] = result.gates
    assert gate.verdict != "held"  # two pairs show no more
    assert result.exit_code(allow_inconclusive=False) != 0
    assert main(["report", str(after), "--allow-plugins"]) == 0
    assert "KeyError" in (after / "report.html").read_text()


def test_differences_between_two_folders_are_named(tmp_path):
    """Times are bounded by the longer limit: by the shorter, the other's would lie beyond."""
    folders = [ran(tmp_path / str(limit), "gap", limit=limit) for limit in (0.5, 1)]
    for before, after in (folders, folders[::-1]):
        compared = compare(before, after, ["success.drop <= 0.1"])
        assert compared.time_limit == 1.0
        [difference] = compared.result.differences
        assert difference.startswith("episode.time_limit (")
        assert f"the folders differ in {difference}. " in verdict_in_words(compared.result)
    read = read_folder(folders[0], allow_plugins=False)
    other = dataclasses.replace(read, contents={"wayproof": "0123456789abcdef"})
    [difference] = differences_of(other, read, renamed=False)
    assert difference == f"code of Wayproof (0123456789abcdef -> {code_digest()})"
    assert differences_of(read, read, renamed=False) == ()


RAISES_IN_START = STACK.replace("self.goal = task.mission.goal", 'raise KeyError("weights")')


def test_a_stack_that_fails_in_its_start_has_failed_in_each_episode(tmp_path):
    """The same in this process as in one of its own."""
    here = built(tmp_path, 2.0)
    (tmp_path / "mine.py").write_text(RAISES_IN_START)
    there = f"exec:{sys.executable} -m wayproof serve {here}"
    study, episodes = planned(tmp_path, here, there, seeds="[1]")
    store = Store(tmp_path / "out")
    result = run_study(study, episodes, store, run_here, lambda done: None)
    assert (result.missing, result.errors) == (0, 0)
    assert [dict(one.outcomes) for one in result.arms] == [{"error": 1}, {"error": 1}]
    for one in episodes:
        ended = open_log(store.log(one.key), allow_plugins=True).result
        assert (ended["outcome"], ended["cause"]) == ("error", "plugin_failed")
        assert "KeyError: 'weights'" in ended["reason"]
        assert ended["reason"].endswith("at decision 0")


@pytest.mark.parametrize("setting", ["planner.name", "prediction.source", "stack.name"])
def test_a_module_that_a_user_s_code_imports_is_part_of_the_episode(tmp_path, setting):
    own, imported = tmp_path / "own.py", tmp_path / "rates.py"
    own.write_text("import rates\n\n\nclass Own:\n    def plan(self, *_):\n        pass\n")
    imported.write_text("UP = 1.0\n")
    config = override(
        Config("empty", "drone", 0), [f"{setting}={own}:Own", "prediction.policy=guide"]
    )
    keys = []
    for text in ("UP = 2.0\n", "UP = 2.0\n", "UP = 3.0\n"):
        imported.write_text(text)
        keys.append(episode_key(config, contents_of(named_by(config))))
    assert keys[0] == keys[1] != keys[2]
