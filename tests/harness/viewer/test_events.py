"""Events: each once, when it begins."""

from types import SimpleNamespace

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.events import (
    CONTACT,
    LAST_CHANCE,
    LATE,
    STOP,
    Events,
)


def events(decisions, truths=None, **result):
    found = Events(SimpleNamespace(result=result))
    truths = truths or [pb.Truth() for _ in decisions]
    return [
        (number, event.kind)
        for number, (decision, truth) in enumerate(zip(decisions, truths, strict=True))
        for event in found.at(decision, truth)
    ]


def acting(*actions):
    return [pb.Decision(sequence=k, action=action) for k, action in enumerate(actions)]


def test_a_stop_counts_once_when_it_begins():
    actions = acting("follow", "stop_and_wait", "stop_and_wait", "follow", "abort")
    assert events(actions) == [(1, STOP), (4, STOP)]


def test_the_guard_s_braking_is_a_stop():
    cut = pb.Decision(sequence=1, action="follow", verdict=pb.Verdict(verdict="blocked", cut=True))
    before = pb.Decision(action="follow")
    assert events([before, cut, cut, before, cut]) == [(1, STOP), (4, STOP)]


def test_every_contact_and_every_late_decision_counts():
    truths = [pb.Truth(collisions=c, hit_by_mover=h) for c, h in ((0, 0), (1, 0), (1, 1), (1, 1))]
    assert events(acting(*["follow"] * 4), truths) == [(1, CONTACT), (2, CONTACT)]
    late = pb.Decision(action="follow", deadline_missed=True, delay_s=0.3, deadline_s=0.25)
    assert events([late, late]) == [(0, LATE), (1, LATE)]


def test_the_last_chance_is_the_decision_that_the_cause_names():
    actions = acting(*["follow"] * 3)
    assert events(actions, cause="pose", cause_decision="1") == [(1, LAST_CHANCE)]
    assert events(actions, cause_decision="-1") == []
    assert events(actions) == []
