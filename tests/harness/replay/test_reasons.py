"""Reasons: those in a log are true, and every falsified one is found."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.config import StackConfig
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit.facts import FACTS, Past
from wayproof.harness.replay.audit.reasons import false_parts, figures_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reasons import (
    COUNTS,
    FIGURES,
    MEANINGS,
    POINTS,
    TEXTS,
    Reason,
    logged_reason,
    reason_message,
    sentence,
)

EVERY = 8
"""Of the decisions on the way one of so many is checked."""

LAST = 12
"""Of the last ones all of so many."""


@pytest.fixture(scope="module")
def logs(recorded):
    """A drone and a quadruped that follow up to the unknown, and brake to their goals."""
    return {robot: open_log(Path(recorded("empty", robot, 1).log)) for robot in ROBOTS}


ROBOTS = ("drone", "quadruped")


@pytest.fixture(scope="module")
def log(logs):
    """That of the drone."""
    return logs["drone"]


def shifted(name, by):
    def falsify(decision):
        predicate = decision.predicate
        if name in POINTS and predicate.HasField(name):
            getattr(predicate, name).x += by
        elif name not in POINTS and predicate.HasField(name):
            setattr(predicate, name, getattr(predicate, name) + by)

    return falsify


def explores(decision):
    decision.action = "explore"


def unlabelled(decision):
    decision.label = "none"


def of_state(state):
    def falsify(decision):
        if decision.predicate.HasField("cell"):
            decision.predicate.cell_state = state

    return falsify


def as_it_is(decision):
    pass


FALSE = {
    "nothing": (as_it_is, set()),
    "free_m": (shifted("free_m", 1.5), {"following"}),
    "cell": (shifted("cell", 1.2), {"following"}),
    "place": (shifted("place", 1.2), {"following"}),
    "path_m": (shifted("path_m", 0.5), {"braking_for_goal"}),
    "distance_m": (shifted("distance_m", 0.1), {"arrived"}),
    "limit_m": (shifted("limit_m", 0.1), {"arrived"}),
    "action": (explores, {"following", "braking_for_goal", "arrived"}),
    "label": (unlabelled, {"following"}),
    **{state: (of_state(state), {"following"}) for state in ("occupied", "outside", "no floor")},
    "class margin": (of_state("class margin"), {"following"}),
}
"""What is falsified in all decisions, and the kinds of reasons that it makes false."""


@pytest.fixture(scope="module")
def texts_by_fault(logs):
    """Texts of what is false by kind of reason, for each robot and falsification."""
    return {robot: falsified(log) for robot, log in logs.items()}


def with_decision(moment, decision):
    return replace(moment, record=replace(moment.record, decision=decision))


def falsified(log):
    pasts = {name: Past() for name in FALSE}
    found = {name: {} for name in FALSE}
    count = int(log.result["decisions"])
    for moment in committed_of(log):
        sequence = moment.decision.sequence
        chosen = sequence % EVERY == 0 or sequence >= count - LAST
        for name, (falsify, _) in FALSE.items():
            decision = pb.Decision()
            decision.CopyFrom(moment.decision)
            if chosen:
                falsify(decision)
                decision.reason = sentence(logged_reason(decision.predicate))
                texts = false_parts(with_decision(moment, decision), pasts[name])
                if texts:
                    found[name].setdefault(decision.predicate.kind, []).extend(texts)
            pasts[name].take(decision)
    return found


@pytest.mark.parametrize("robot", ROBOTS)
def test_reasons_in_a_log_are_true(texts_by_fault, logs, robot):
    assert texts_by_fault[robot]["nothing"] == {}
    decisions = list(logs[robot].decisions())
    kinds = {one.predicate.kind for one in decisions}
    assert {"following", "braking_for_goal", "arrived"} <= kinds


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", [name for name in FALSE if name != "nothing"])
def test_a_false_figure_is_found(texts_by_fault, name, robot):
    assert FALSE[name][1] <= set(texts_by_fault[robot][name])


def test_a_walking_body_is_told_what_is_unknown_the_floor_or_what_is_above_it(logs):
    """Of a floor that was not seen, all above may be known to be free."""
    moment = next(
        one for one in committed_of(logs["quadruped"]) if one.decision.predicate.cell_state
    )
    seen = {one.predicate.cell_state for one in logs["quadruped"].decisions()} - {""}
    assert "floor not seen" in seen
    assert moment.decision.predicate.cell_state == "floor not seen"
    moment.decision.predicate.cell_state = "unknown"
    moment.decision.reason = sentence(logged_reason(moment.decision.predicate))
    texts = false_parts(moment, Past())
    assert any("the cell is floor not seen, not unknown" in text for text in texts)


def test_words_that_its_figures_do_not_make_are_found(log):
    moment = next(committed_of(log))
    moment.decision.reason = "the way ahead is blocked"
    texts = false_parts(moment, Past())
    assert texts == ["its sentence is not that of its figures"]


PLANTED = {
    "following": {"free_m": 0.1},
    "slowing_for_unknown": {"free_m": 1.0, "cell_state": "unknown"},
    "turning": {"turn_rad": 1.0},
    "braking_for_blocked": {"free_m": 0.4, "cell_state": "occupied"},
    "braking_for_unknown": {"free_m": 0.4, "cell_state": "unknown"},
    "braking_for_goal": {"path_m": 0.1},
    "waiting": {"free_m": 0.1, "waited_s": 0.5, "cell_state": "unknown"},
    "looking_elsewhere": {"since": 0, "places": 1},
    "leaving_inflation": {"distance_m": 0.4, "cell_state": "occupied"},
    "going_back": {"since": 0},
    "no_path": {"iterations": 7, "waited_s": 0.0},
    "goal_blocked": {"waited_s": 0.0, "cell_state": "occupied"},
    "localization_lost": {"sigma_m": 0.6, "limit_m": 0.5},
    "old_evidence": {"delay_s": 0.7, "deadline_s": 0.5},
    "late": {"delay_s": 0.3, "deadline_s": 0.25},
    "arrived": {"distance_m": 0.1, "limit_m": 0.4},
    "commanded": {"free_m": 1.0},
}
"""A reason of each kind that decision 12, which follows up to the unknown, does not have."""


@pytest.mark.parametrize("kind", list(MEANINGS))
def test_a_false_reason_of_each_kind_is_found(log, kind):
    assert set(PLANTED) == set(MEANINGS) == set(FACTS)
    *_, moment = itertools.islice(committed_of(log), 13)
    past = Past()
    for decision in itertools.islice(log.decisions(), 12):
        past.take(decision)
    x, y = moment.decision.trajectory.path[5].x, moment.decision.trajectory.path[5].y
    names = ["target"] if "target" in figures_of(MEANINGS[kind].text) else []
    names += ["cell", "place"] if "cell_state" in PLANTED[kind] else []
    reason = Reason(kind, **PLANTED[kind], **{name: (x, y, 1.0) for name in names})
    decision = moment.decision
    decision.predicate.CopyFrom(reason_message(reason))
    decision.reason = sentence(reason)
    decision.action, decision.label = MEANINGS[kind].actions[0], MEANINGS[kind].labels[0]
    texts = false_parts(moment, past)
    assert any(text.startswith(f"{kind}: ") for text in texts)


def commanded_texts(moment, reason, verdict, free_m, cut=False):
    """Texts of the check of a command of a stack on trial along a decision's own path."""
    decision = moment.decision
    decision.predicate.CopyFrom(reason_message(reason))
    decision.reason, decision.label = sentence(reason), "none"
    decision.verdict.verdict, decision.verdict.cut = verdict, cut
    decision.verdict.free_m = free_m
    config = replace(moment.config, stack=StackConfig("dwa"))
    return " ".join(false_parts(replace(moment, config=config), Past()))


def test_a_command_without_proof_names_what_blocks_it_on_its_way(log):
    *_, moment = itertools.islice(committed_of(log), 13)
    x, y, z = (getattr(moment.decision.trajectory.path[5], axis) for axis in "xyz")
    outside = {"cell": moment.mission.high, "cell_state": "unknown", "place": (x, y, z)}
    free = {"cell": (x, y, z), "cell_state": "occupied", "place": (x, y, z)}

    def texts(free_m, **where):
        reason = Reason("commanded", free_m=free_m, **where)
        return commanded_texts(moment, reason, "blocked", free_m)

    assert "the path is" in texts(9.0, **free)
    assert "the cell is free, not occupied" in texts(0.3, **free)
    assert "out of reach of the body" in texts(0.3, **outside)
    aside = {"cell": moment.mission.high, "cell_state": "unknown", "place": moment.mission.high}
    assert "beside the way" in texts(0.3, **aside)


def test_a_command_is_admitted_as_its_verdict_says(log):
    moment, reason = next(committed_of(log)), Reason("commanded", free_m=0.2)
    assert commanded_texts(moment, reason, "admitted", 0.2) == ""
    assert "free_m is" in commanded_texts(moment, reason, "admitted", 0.4)
    assert "the guard cut it" in commanded_texts(moment, reason, "admitted", 0.2, cut=True)


def test_a_decision_without_figures_is_found(log):
    moment = next(committed_of(log))
    moment.decision.ClearField("predicate")
    assert false_parts(moment, Past()) == ["there is no reason with figures"]


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_figures_that_no_decision_has_are_found_and_harm_nothing(log, value):
    moment = next(committed_of(log))
    for name in set(FIGURES) - {*TEXTS, *COUNTS}:
        decision = pb.Decision()
        decision.CopyFrom(moment.decision)
        if name in POINTS:
            getattr(decision.predicate, name).x = value
        else:
            setattr(decision.predicate, name, value)
        assert false_parts(with_decision(moment, decision), Past()), name


def test_a_sentence_is_made_of_its_figures():
    reason = Reason(
        "braking_for_blocked",
        free_m=0.4,
        cell=(1.0, 2.0, 3.0),
        cell_state="occupied",
        place=(1.0, 1.5, 3.0),
    )
    assert sentence(reason) == "braking: 0.40 m admitted, then occupied at (1.00, 2.00, 3.00)"
    assert logged_reason(reason_message(reason)) == reason


@pytest.mark.parametrize("kind", list(MEANINGS))
def test_every_figure_of_a_sentence_is_one_of_a_reason(kind):
    assert set(figures_of(MEANINGS[kind].text)) <= set(FIGURES)
    assert MEANINGS[kind].actions
    assert MEANINGS[kind].labels
