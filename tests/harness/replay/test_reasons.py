"""Reasons: those in a log are true, and every falsified one is found."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.config import StackConfig
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.reasons import PREDICATES, ReasonCheck, figures_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reason_sentences import MEANINGS, sentence
from wayproof.harness.stack.reasons import (
    FIGURES,
    POINTS,
    TEXTS,
    Reason,
    logged_reason,
    reason_message,
)

EVERY = 8
"""Of the decisions on the way one of so many is checked."""

LAST = 12
"""Of the last ones all of so many."""


@pytest.fixture(scope="module")
def log(recorded):
    """A drone that follows up to the unknown, and brakes to its goal."""
    return open_log(Path(recorded("empty", "drone", 1).log))


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


def occupied(decision):
    decision.predicate.cell_state = "occupied"


def as_it_is(decision):
    pass


FALSE = {
    "nothing": (as_it_is, set()),
    "free_m": (shifted("free_m", 1.5), {"unknown_ahead"}),
    "cell": (shifted("cell", 0.8), {"unknown_ahead"}),
    "place": (shifted("place", 0.8), {"unknown_ahead"}),
    "full_speed_stop_m": (shifted("full_speed_stop_m", 0.3), {"unknown_ahead"}),
    "path_m": (shifted("path_m", 0.5), {"path_to_goal", "braking_to_goal"}),
    "stop_m": (shifted("stop_m", 0.1), {"braking_to_goal"}),
    "distance_m": (shifted("distance_m", 0.1), {"at_goal"}),
    "limit_m": (shifted("limit_m", 0.1), {"at_goal"}),
    "action": (explores, {"unknown_ahead", "path_to_goal", "braking_to_goal", "at_goal"}),
    "label": (unlabelled, {"unknown_ahead"}),
    "cell_state": (occupied, {"unknown_ahead"}),
}
"""What is falsified in all decisions, and the kinds of reasons that it makes false."""


@pytest.fixture(scope="module")
def texts_by_fault(log):
    """Texts of what is false by kind of reason, for each falsification; the map is built once."""
    checks = {name: ReasonCheck() for name in FALSE}
    found = {name: {} for name in FALSE}
    count = int(log.result["decisions"])
    for moment in committed_of(log):
        sequence = moment.decision.sequence
        chosen = sequence % EVERY == 0 or sequence >= count - LAST
        for name, (falsify, _) in FALSE.items():
            decision = pb.Decision()
            decision.CopyFrom(moment.decision)
            if not chosen:
                checks[name].pass_by(decision)
                continue
            falsify(decision)
            decision.reason = sentence(logged_reason(decision.predicate))
            texts = checks[name].check(decision, moment.map, moment.config, moment.mission)
            if texts:
                found[name].setdefault(decision.predicate.kind, []).extend(texts)
    return found


def test_reasons_in_a_log_are_true(texts_by_fault, log):
    assert texts_by_fault["nothing"] == {}
    kinds = {one.predicate.kind for one in log.decisions()}
    assert {"unknown_ahead", "path_to_goal", "braking_to_goal", "at_goal"} <= kinds


@pytest.mark.parametrize("name", [name for name in FALSE if name != "nothing"])
def test_a_false_figure_is_found(texts_by_fault, name):
    assert FALSE[name][1] <= set(texts_by_fault[name])


def test_words_that_its_figures_do_not_make_are_found(log):
    check, moment = ReasonCheck(), next(committed_of(log))
    moment.decision.reason = "the way ahead is blocked"
    texts = check.check(moment.decision, moment.map, moment.config, moment.mission)
    assert texts == ["its sentence is not that of its figures"]


PLANTED = {
    "blocked_ahead": {"free_m": 1.0, "full_speed_stop_m": 1.008, "cell_state": "occupied"},
    "through_unknown": {"free_m": 1.0, "speed_share": 0.4, "cell_state": "unknown"},
    "path_to_corner": {"free_m": 1.0, "path_m": 3.0},
    "turning_into_path": {"turn_rad": 1.0},
    "stepping_aside": {"distance_m": 0.5},
    "stepping_to_pose": {"distance_m": 0.5, "turn_rad": 0.2},
    "looking_elsewhere": {"path_m": 2.0, "since": 0, "places": 1},
    "at_viewpoint": {"path_m": 0.1},
    "backing_up": {"path_m": 1.0, "since": 0},
    "off_trajectory": {"distance_m": 1.0, "limit_m": 0.8},
    "returning_to_held": {"path_m": 1.0, "since": 0, "sigma_m": 0.6, "limit_m": 0.5},
    "pose_lost": {"sigma_m": 0.6, "limit_m": 0.5},
    "goal_uncertain": {"distance_m": 0.1, "sigma_m": 0.2, "limit_m": 0.2},
    "escaping_inflation": {"distance_m": 0.4, "cell_state": "occupied"},
    "turning_out_of_inflation": {"turn_rad": 0.2, "cell_state": "occupied"},
    "braking_before_unknown": {"free_m": 0.4, "stop_m": 0.8, "cell_state": "unknown"},
    "braking_before_blocked": {"free_m": 0.4, "stop_m": 0.8, "cell_state": "occupied"},
    "path_too_short": {"path_m": 0.4, "stop_m": 0.8},
    "goal_place_moved": {"distance_m": 0.5, "stop_m": 0.8},
    "coming_to_rest": {"path_m": 0.4, "since": 3},
    "waiting_before_unknown": {
        "free_m": 0.1,
        "limit_m": 0.3,
        "waited_s": 0.5,
        "cell_state": "unknown",
    },
    "waiting_before_blocked": {
        "free_m": 0.1,
        "limit_m": 0.3,
        "waited_s": 0.5,
        "cell_state": "occupied",
    },
    "no_path_in_map": {"iterations": 1, "waited_s": 0.0},
    "no_path_found": {"iterations": 7, "waited_s": 0.0},
    "goal_blocked": {"limit_m": 1.0, "waited_s": 0.0, "cell_state": "occupied"},
    "goal_inside_inflation": {"distance_m": 0.5, "waited_s": 0.0, "cell_state": "occupied"},
    "no_room_to_turn": {"turn_rad": 1.0, "waited_s": 0.0, "cell_state": "occupied"},
    "no_room_along_path": {"free_m": 0.0, "waited_s": 0.0, "cell_state": "occupied"},
    "no_way_out": {"limit_m": 1.0, "waited_s": 0.0, "cell_state": "occupied"},
    "way_out_blocked": {"distance_m": 0.5, "waited_s": 0.0, "cell_state": "occupied"},
    "keeping_course": {},
    "deadline_missed": {"delay_s": 0.3, "deadline_s": 0.25},
    "path_to_goal": {"path_m": 2.0},
    "braking_to_goal": {"path_m": 1.0, "stop_m": 1.0},
    "at_goal": {"distance_m": 0.1, "limit_m": 0.4},
    "unknown_ahead": {"free_m": 1.0, "full_speed_stop_m": 1.008, "cell_state": "unknown"},
    "commanded": {"free_m": 1.0},
    "commanded_without_proof": {"free_m": 1.0},
    "guard_braking": {"free_m": 1.0},
}
"""A reason of each kind that decision 12, which follows up to the unknown, does not have."""


def test_a_false_reason_of_each_kind_is_found(log):
    assert set(PLANTED) == set(MEANINGS) == set(PREDICATES)
    *_, moment = itertools.islice(committed_of(log), 13)
    before = list(itertools.islice(log.decisions(), 12))
    for kind, figures in PLANTED.items():
        check = ReasonCheck()
        for decision in before:
            check.pass_by(decision)
        x, y, z = moment.decision.trajectory.path[5].x, moment.decision.trajectory.path[5].y, 1.0
        places = {name: (x, y, z) for name in (*POINTS,) if _needs(kind, name)}
        decision = pb.Decision()
        decision.CopyFrom(moment.decision)
        reason = Reason(kind, **figures, **places)
        decision.predicate.CopyFrom(reason_message(reason))
        decision.reason = sentence(reason)
        decision.action, decision.label = MEANINGS[kind].actions[0], MEANINGS[kind].labels[0]
        texts = check.check(decision, moment.map, moment.config, moment.mission)
        assert any(text.startswith(f"{kind}: ") for text in texts), kind


def _needs(kind, name):
    needed = figures_of(MEANINGS[kind].text)
    return name in needed or (name == "place" and "cell" in needed)


BENDS_AT_ONCE = [[0.0, 0.0], [0.137, -0.034], [0.162, -0.073], [0.175, -0.123], [0.26, -0.149]]
"""Begin of the thinned path of decision 121 of fr079, m."""


@pytest.mark.parametrize(
    ("discs", "turn", "is_true"),
    [
        ((), -1.507, True),  # the direction at 0.2 m, to which the stack turned there
        ((), 0.8, False),
        ((), -1.507 + math.pi, False),
        (((0.0, 0.3),), -0.25, True),  # a long body takes that at 0.1 m, or its tail does
        (((0.0, 0.3),), -0.25 + math.pi, True),
        (((0.0, 0.3),), 1.0, False),
    ],
)
def test_a_turn_leads_into_the_path_where_it_is_read(log, discs, turn, is_true):
    moment = next(committed_of(log))
    mission = replace(moment.mission, discs=discs)
    decision, reason = moment.decision, Reason("turning_into_path", turn_rad=turn)
    decision.predicate.CopyFrom(reason_message(reason))
    decision.reason, decision.action, decision.label = sentence(reason), "follow", "none"
    decision.quaternion[:] = [1.0, 0.0, 0.0, 0.0]
    del decision.global_path[:], decision.trajectory.path[1:]
    for x, y in BENDS_AT_ONCE:
        decision.global_path.add(x=x, y=y)
    texts = ReasonCheck().check(decision, moment.map, moment.config, mission)
    assert (texts == []) == is_true, texts


def commanded_texts(moment, reason, verdict, path=None, turn=0.0):
    """Texts of the check of a command of a stack on trial, by default of a decision's own path."""
    decision = pb.Decision()
    decision.CopyFrom(moment.decision)
    if path is not None:
        del decision.trajectory.path[:]
        for x, y, z in path:
            decision.trajectory.path.add(x=x, y=y, z=z)
        decision.trajectory.arc_length[:] = [0.0, 0.0]
        decision.trajectory.heading[:] = [0.0, turn]
    decision.trajectory.start.FromNanoseconds(decision.timestamp.ToNanoseconds())
    decision.predicate.CopyFrom(reason_message(reason))
    decision.reason, decision.action, decision.label = sentence(reason), "follow", "none"
    decision.verdict.verdict, decision.verdict.cut = verdict, False
    config = replace(moment.config, stack=StackConfig("dwa"))
    return ReasonCheck().check(decision, moment.map, config, moment.mission)


def test_a_command_without_proof_names_what_blocks_it_on_its_way(log):
    *_, moment = itertools.islice(committed_of(log), 13)
    x, y, z = (getattr(moment.decision.trajectory.path[5], axis) for axis in "xyz")
    outside = {"cell": moment.mission.high, "cell_state": "unknown", "place": (x, y, z)}
    free = {"cell": (x, y, z), "cell_state": "occupied", "place": (x, y, z)}

    def texts(free_m, **where):
        reason = Reason("commanded_without_proof", free_m=free_m, **where)
        return " ".join(commanded_texts(moment, reason, "blocked"))

    assert "free_m is" in texts(9.0)
    assert "the cell is free, not occupied" in texts(0.3, **free)
    assert "out of reach of the body" in texts(0.3, **outside)
    aside = {"cell": moment.mission.high, "cell_state": "unknown", "place": moment.mission.high}
    assert "beside the way" in texts(0.3, **aside)


def test_a_body_that_keeps_its_place_is_admitted_wherever_it_is(log):
    moment = next(committed_of(log))
    reason, unknown = Reason("commanded", free_m=0.0), [moment.mission.high]
    assert commanded_texts(moment, reason, "admitted", path=unknown) == []
    long = replace(moment, mission=replace(moment.mission, discs=((0.0, 0.3),)))
    assert commanded_texts(long, reason, "admitted", path=unknown) == []
    assert commanded_texts(long, reason, "admitted", path=unknown, turn=0.5) != []


@pytest.mark.parametrize(("left", "is_true"), [(0.25, True), (0.1, False), (0.5, False)])
def test_what_is_left_of_a_step_under_way_is_what_its_trajectory_has_left(log, left, is_true):
    moment = next(committed_of(log))
    decision, reason = moment.decision, Reason("stepping_to_pose", distance_m=left, turn_rad=0.0)
    decision.predicate.CopyFrom(reason_message(reason))
    decision.reason, decision.action, decision.label = sentence(reason), "follow", "none"
    decision.quaternion[:] = [1.0, 0.0, 0.0, 0.0]
    begun_ns = decision.timestamp.ToNanoseconds() + moment.config.latency.expected_ns
    begun_ns -= 100_000_000
    step = pb.Trajectory(duration_s=0.2, sample_period_s=0.1, heading=[0.0, 0.0, 0.0])
    step.start.FromNanoseconds(begun_ns)
    step.path.add(x=0.0)
    step.path.add(x=0.5)
    step.arc_length[:] = [0.0, 0.25, 0.5]
    decision.trajectory.CopyFrom(step)
    del decision.global_path[:]
    texts = ReasonCheck().check(decision, moment.map, moment.config, moment.mission)
    assert any("distance_m" in text for text in texts) != is_true, texts


@pytest.mark.parametrize("more", [None, 0.0, 0.1])
def test_a_robot_in_motion_brakes_before_a_blocked_goal(log, more):
    *_, moment = itertools.islice(committed_of(log), 13)
    path = [(one.x, one.y, one.z) for one in moment.decision.trajectory.path]
    stop = sum(itertools.starmap(math.dist, itertools.pairwise(path)))
    stop_m = None if more is None else stop + more
    spot = moment.mission.goal
    reason = Reason(
        "goal_blocked", limit_m=1.0, stop_m=stop_m, cell=spot, place=spot, cell_state="occupied"
    )
    moment.decision.predicate.CopyFrom(reason_message(reason))
    texts = ReasonCheck().check(moment.decision, moment.map, moment.config, moment.mission)
    assert ("goal_blocked: it moves" in texts) == (more is None)
    assert any("stop_m" in text for text in texts) == (more == 0.1)


LONG = ((-0.2, 0.2), (0.2, 0.2))
"""Discs of a long body: offset and radius, m."""


@pytest.mark.parametrize(
    ("discs", "spare", "is_enough"),
    [
        ((), 0.001, True),
        (LONG, 0.03, False),  # less than what it keeps before the first pose that does not fit
        (LONG, 0.15, True),
    ],
)
def test_a_stop_before_an_obstacle_is_one_that_was_needed(log, discs, spare, is_enough):
    moment = next(committed_of(log))
    mission = replace(moment.mission, discs=discs)
    if discs:  # the decision is of the discs
        decision, margin = moment.decision, moment.decision.localization_margin_m
        decision.inflation_radius_m = discs[0][1] + margin
    spot = (1.0, 1.0, 1.0)
    reason = Reason(
        "braking_before_blocked",
        free_m=0.4 + spare,
        stop_m=0.4,
        cell=spot,
        cell_state="occupied",
        place=spot,
    )
    moment.decision.predicate.CopyFrom(reason_message(reason))
    texts = ReasonCheck().check(moment.decision, moment.map, moment.config, mission)
    assert any("m enough to stop" in text for text in texts) == is_enough, texts


@pytest.mark.parametrize(
    ("discs", "committed", "is_true"),
    [(LONG, 0.98, True), (LONG, 1.02, True), (LONG, 1.05, False), ((), 1.02, False)],
)
def test_a_long_body_may_take_a_little_more_than_leads_to_a_corner(log, discs, committed, is_true):
    moment = next(committed_of(log))
    decision, reason = moment.decision, Reason("path_to_corner", free_m=1.0, path_m=3.0)
    decision.predicate.CopyFrom(reason_message(reason))
    del decision.trajectory.path[:], decision.global_path[:]
    for x, y in ((0.0, 0.0), (committed, 0.0)):
        decision.trajectory.path.add(x=x, y=y)
    for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 2.0)):
        decision.global_path.add(x=x, y=y)
    mission = replace(moment.mission, discs=discs)
    texts = ReasonCheck().check(decision, moment.map, moment.config, mission)
    assert any("committed" in text or "free_m" in text for text in texts) != is_true, texts


@pytest.mark.parametrize(("discs", "is_true"), [(LONG, True), ((), False)])
def test_a_long_body_may_come_to_rest_before_the_unknown_on_its_way(log, discs, is_true):
    *_, moment = itertools.islice(committed_of(log), 13)
    committed = len(moment.decision.trajectory.path) * 0.1 + 5.0
    spot = (1.0, 1.0, 1.0)
    reason = Reason(
        "through_unknown",
        free_m=committed,
        speed_share=0.4,
        cell=spot,
        cell_state="unknown",
        place=spot,
    )
    moment.decision.predicate.CopyFrom(reason_message(reason))
    mission = replace(moment.mission, discs=discs)
    texts = ReasonCheck().check(moment.decision, moment.map, moment.config, mission)
    assert any("lies beyond the committed part" in text for text in texts) != is_true, texts


@pytest.mark.parametrize(
    ("action", "speeds", "share", "complaint"),
    [
        ("follow", (1.0, 0.5), 0.4, ""),
        ("slow", (1.0, 0.5), 0.4, "action slow"),
        ("follow", (1.0, 1.0), 0.4, "where space is unknown"),
        ("follow", (1.0, 0.02), 1e-6, ""),  # as slowly as a body moves
        ("follow", (1.0, 0.03), 1e-6, "where space is unknown"),
    ],
)
def test_a_body_is_slow_where_space_is_unknown(log, action, speeds, share, complaint):
    *_, moment = itertools.islice(committed_of(log), 13)
    mission = replace(moment.mission, discs=LONG, max_speed=1.25, sideways_speed=1.0)
    behaviour = replace(moment.config.behaviour, unknown_speed_fraction=share)
    config = replace(moment.config, behaviour=behaviour)
    spot = (1.0, 1.0, 1.0)
    reason = Reason(
        "through_unknown", free_m=3.0, speed_share=share,
        cell=spot, cell_state="unknown", place=spot,
    )  # fmt: skip
    decision = moment.decision
    decision.predicate.CopyFrom(reason_message(reason))
    decision.action = action
    steps = [0.1 * speed for speed in speeds for _ in range(30)]
    decision.trajectory.arc_length[:] = itertools.accumulate(steps)
    texts = ReasonCheck().check(decision, moment.map, config, mission)
    found = [text for text in texts if "action" in text or "where space" in text]
    assert all(complaint in text for text in found) if complaint else not found, texts
    assert bool(found) == bool(complaint), texts


def test_a_corner_that_the_thinned_path_leaves_out_is_where_the_committed_part_ends(log):
    """A kink to the right, of one step of 5 cm, of a path of which every fifth point is logged."""
    moment = next(committed_of(log))
    decision, reason = moment.decision, Reason("path_to_corner", free_m=0.72, path_m=0.85)
    decision.predicate.CopyFrom(reason_message(reason))
    del decision.trajectory.path[:], decision.global_path[:]
    for x, y in ((8.27, 7.3), (8.05, 7.54), (7.87, 7.71), (7.76, 7.81)):
        decision.trajectory.path.add(x=x, y=y)
    for x, y in ((8.27, 7.3), (8.05, 7.54), (7.87, 7.71), (7.77, 7.87), (7.64, 8.07)):
        decision.global_path.add(x=x, y=y)
    texts = ReasonCheck().check(decision, moment.map, moment.config, moment.mission)
    assert not any("which is no corner" in text for text in texts), texts
    decision.global_path[3].x = 7.71  # it goes straight on
    texts = ReasonCheck().check(decision, moment.map, moment.config, moment.mission)
    assert any("which is no corner" in text for text in texts), texts


@pytest.mark.parametrize(
    ("kind", "action", "figures", "complaint"),
    [
        ("unknown_ahead", "slow", ("free_m", "full_speed_stop_m"), "action slow"),
        ("unknown_ahead", "follow", ("free_m", "full_speed_stop_m"), "action follow"),
        ("waiting_before_unknown", "stop_and_wait", ("free_m", "limit_m"), "m are free"),
        ("path_too_short", "stop_and_wait", ("path_m", "stop_m"), "m enough to stop"),
    ],
)
def test_figures_that_are_equal_as_rounded_may_have_been_in_order(
    log, kind, action, figures, complaint
):
    moment, spot = next(committed_of(log)), (1.0, 1.0, 1.0)
    moment.decision.action = action
    found = []
    for values in ((0.3, 0.3), (0.3, 0.1), (0.1, 0.3)):
        places = {name: spot for name in POINTS if _needs(kind, name)}
        known = {"cell_state": "unknown"} if places else {}
        reason = Reason(kind, **dict(zip(figures, values, strict=True)), **places, **known)
        moment.decision.predicate.CopyFrom(reason_message(reason))
        given = moment.decision, moment.map, moment.config, moment.mission
        found.append(any(complaint in text for text in ReasonCheck().check(*given)))
    assert not found[0]
    assert any(found[1:])


def test_a_decision_without_figures_is_found(log):
    moment = next(committed_of(log))
    moment.decision.ClearField("predicate")
    given = moment.decision, moment.map, moment.config, moment.mission
    assert ReasonCheck().check(*given) == ["there is no reason with figures"]


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_figures_that_no_decision_has_are_found_and_harm_nothing(log, value):
    moment = next(committed_of(log))
    for name in FIGURES:
        decision = pb.Decision()
        decision.CopyFrom(moment.decision)
        predicate = decision.predicate
        if name in POINTS:
            getattr(predicate, name).x = value
        elif name in (*TEXTS, "since", "places", "iterations"):
            continue
        else:
            setattr(predicate, name, value)
        given = decision, moment.map, moment.config, moment.mission
        assert ReasonCheck().check(*given), name


def test_a_sentence_is_made_of_its_figures():
    reason = Reason(
        "braking_before_blocked",
        free_m=0.4,
        stop_m=0.81,
        cell=(1.0, 2.0, 3.0),
        cell_state="occupied",
        place=(1.0, 1.5, 3.0),
    )
    text = "0.40 m passable, then occupied at (1.00, 2.00, 3.00); 0.81 m needed to stop"
    assert sentence(reason) == text
    assert logged_reason(reason_message(reason)) == reason


@pytest.mark.parametrize("kind", list(MEANINGS))
def test_every_figure_of_a_sentence_is_one_of_a_reason(kind):
    assert set(figures_of(MEANINGS[kind].text)) <= set(FIGURES)
    assert MEANINGS[kind].actions
    assert MEANINGS[kind].labels
