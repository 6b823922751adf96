"""Commands of a stack on trial on cards, in pictures and in the viewer."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.decision import path_of
from wayproof.harness.explain import commanded, make_card
from wayproof.harness.explain.card import command_at
from wayproof.harness.log.paths import arc_lengths, densely
from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.colours import PLANNED, REFUSED
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.words import describe, is_warning

STACKS = Path(__file__).parents[1] / "interface" / "stacks_on_trial.py"
STACK = f"stack.name={STACKS}:Straight"


@pytest.fixture(scope="module")
def followed(recorded):
    """Straight into a pillar."""
    return open_log(Path(recorded("cylinders", "quadruped", 2, STACK).log))


@pytest.fixture(scope="module")
def guarded(recorded):
    """The same, braked by the guard."""
    guard = "stack.guard=true", "episode.time_limit=4"
    return open_log(Path(recorded("cylinders", "quadruped", 2, STACK, *guard).log))


def first(log, verdict, cut):
    found = (one.verdict for one in log.decisions())
    numbers = [n for n, one in enumerate(found) if (one.verdict, one.cut) == (verdict, cut)]
    return numbers[0]


def test_the_path_of_a_cut_command_is_worked_out_as_the_referee_judged_it(followed):
    """Of commands that were followed the log has the path to compare with."""
    check_paths(followed)


@pytest.mark.parametrize(
    ("robot", "kind"), [("drone", "ToGoalAtFullSpeed"), ("quadruped", "Swerves")]
)
def test_waypoints_of_a_cut_command_are_timed_as_the_referee_timed_them(recorded, robot, kind):
    """Another timing stops elsewhere, and keeps other limits of the body."""
    settings = f"stack.name={STACKS}:{kind}", "episode.time_limit=4"
    check_paths(open_log(Path(recorded("empty", robot, 1, *settings).log)))


def check_paths(log):
    """Check the path that is worked out for each command of a log against the one that it has."""
    case = read_case(log)
    for number in range(1, len(case.moments)):
        command = command_at(case, number)
        decision, before = (case.moments[n].decision for n in (number, number - 1))
        found = commanded._path_of_motion(
            command.message, decision, before.trajectory, case.config, case.mission
        )
        true = densely(path_of(decision.trajectory.path), 0.005)
        gaps = np.linalg.norm(found[:, None] - true[None], axis=2).min(axis=1)
        assert gaps.max() < 0.04
        assert abs(arc_lengths(found)[-1] - arc_lengths(true)[-1]) < 0.05


def test_a_command_is_divided_where_the_referee_stops_to_admit_it(guarded):
    case = read_case(guarded)
    number = first(guarded, "blocked", cut=True)
    command, decision = command_at(case, number), case.moments[number].decision
    assert command.cut
    assert arc_lengths(command.admitted)[-1] == pytest.approx(decision.verdict.free_m, abs=0.03)
    assert arc_lengths(command.refused)[-1] > 0.05
    admitted = command_at(case, first(guarded, "admitted", cut=False))
    assert len(admitted.refused) == 0
    assert len(admitted.admitted) > 1


def test_a_card_says_how_much_of_the_plan_the_referee_admits(followed):
    case = read_case(followed)
    number = first(followed, "blocked", cut=False)
    card = make_card(case, number)
    free_m = case.moments[number].decision.verdict.free_m
    assert card.planned_m > 10.0
    assert card.planned_admitted_m == pytest.approx(free_m, abs=0.15)


def test_pictures_show_plan_and_verdict(followed, guarded, tmp_path, capsys):
    for log, cut in ((followed, False), (guarded, True)):
        out = tmp_path / f"{cut}.png"
        number = first(log, "blocked", cut=cut)
        assert main(["explain", str(log.path), str(number), "--png", str(out)]) == 0
        words = " ".join(capsys.readouterr().out.replace("│", " ").split())
        planned = make_card(read_case(log), number)
        assert f"the referee's map admits {planned.planned_admitted_m:.2f} m" in words
        pixels = np.asarray(Image.open(out).convert("RGB")).reshape(-1, 3)
        colours = {tuple(pixel) for pixel in np.unique(pixels, axis=0).tolist()}
        assert {PLANNED, REFUSED} <= colours


def test_the_viewer_has_the_plan_and_a_lane_of_verdicts(guarded, tmp_path):
    pytest.importorskip("rerun")
    out = tmp_path / "x.rrd"
    assert main(["view", str(guarded.path), "--save", str(out)]) == 0
    shown = entities(out)
    for name in ("world/planned_path", "world/not_admitted", "verdict"):
        assert f"/log/{name}" in shown


def test_words_name_command_and_verdict(guarded):
    shown = {moment.decision.sequence: moment for moment in moments(guarded)}
    moment = shown[first(guarded, "blocked", cut=True)]
    text = describe(moment.decision, 1.0, moment.commanded)
    free_m = moment.decision.verdict.free_m
    assert f"- referee: **blocked**, free for {free_m:.2f} m" in text
    assert "the guard braked in its place" in text
    assert "- stack: velocity (" in text
    assert is_warning(moment.decision)
