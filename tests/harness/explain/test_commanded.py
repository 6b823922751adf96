"""Commands of a stack on trial on cards, in pictures and in the viewer."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.decision import path_of
from wayproof.harness.explain import make_card
from wayproof.harness.explain.commanded import commanded
from wayproof.harness.log.paths import arc_lengths
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


def test_a_command_is_divided_where_the_referee_stops_to_admit_it(followed, guarded):
    def command_at(log, verdict, cut):
        moment = read_case(log).moments[first(log, verdict, cut=cut)]
        return commanded(moment.answer, moment.decision), moment.decision

    command, decision = command_at(followed, "blocked", cut=False)
    whole = arc_lengths(path_of(decision.trajectory.path))[-1]
    rest = whole - decision.verdict.free_m
    assert arc_lengths(command.refused)[-1] == pytest.approx(rest, abs=0.03)
    assert rest > 0.05
    for verdict, cut in (("admitted", False), ("blocked", True)):
        command, _ = command_at(guarded, verdict, cut=cut)
        assert command.cut == cut
        assert len(command.refused) == 0


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
        assert (PLANNED in colours, REFUSED in colours) == (True, not cut)


def test_the_viewer_has_the_plan_and_a_lane_of_verdicts(followed, tmp_path):
    pytest.importorskip("rerun")
    out = tmp_path / "x.rrd"
    assert main(["view", str(followed.path), "--save", str(out)]) == 0
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
