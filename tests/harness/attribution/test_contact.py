"""Causes of contacts, from tables of facts."""

from dataclasses import replace

import pytest

from tests.harness.attribution.facts import BAD, LIED, cause_of, changed
from wayproof.harness.attribution import contact as contacts
from wayproof.harness.attribution.commanded import CommandedFacts
from wayproof.harness.attribution.contact_facts import ContactFacts
from wayproof.harness.attribution.pose import PoseFacts
from wayproof.harness.attribution.ranges import RangeFacts

TOUCH = ContactFacts(
    name="crate_0", time_s=5.0, decision=38, decision_s=3.8, there_when_decided=True,
    there_when_observed=True, observed_s=3.8, away=0.9, free=3, unknown=0, own=4, nearest_own=0.1,
    off_path=0.02, planned_clearance=0.0, pose_error=0.02, margin=0.1, usual=0.1, pose=PoseFacts(),
    ranges=RangeFacts(), disregarded=0.0, late=None,
)  # fmt: skip

BLOCKED = CommandedFacts(first=30, count=15, verdict="blocked", free_m=0.4, in_the_way=5, blocked=9)
UNKNOWN = replace(BLOCKED, verdict="unknown", in_the_way=0, blocked=0)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({}, "margin_too_small"),
        ({"own": 0}, "missed_obstacle"),
        ({"own": 0, "free": 1, "unknown": 2}, "unseen_obstacle"),
        ({"off_path": 0.3, "planned_clearance": 0.2}, "tracking"),
        ({"off_path": 0.3, "planned_clearance": 0.04}, "margin_too_small"),
        ({"off_path": 0.12, "planned_clearance": 0.06}, "margin_too_small"),
        ({"off_path": 0.08, "planned_clearance": 0.2, "margin": 0.04}, "margin_too_small"),
        ({"there_when_decided": False}, "moved_obstacle"),
        ({"there_when_observed": False}, "moved_obstacle"),
        ({"there_when_observed": False, "observed_s": -1e-9, "own": 0}, "missed_obstacle"),
        ({"late": (40, 0.3, 0.05), "there_when_decided": False}, "latency"),
        ({"disregarded": 0.2}, "disregarded_obstacle"),
        ({"disregarded": 0.2, "own": 0}, "missed_obstacle"),
        ({"pose": LIED, "own": 0}, "localization"),
        ({"pose": LIED, "off_path": 0.6, "planned_clearance": 0.2}, "localization"),
        ({"pose": LIED, "ranges": BAD}, "localization"),
        ({"ranges": BAD, "own": 0}, "perception"),
        ({"ranges": RangeFacts(off=0.4), "late": (40, 0.3, 0.05)}, "perception"),
        ({"ranges": RangeFacts(early=0.01), "own": 0}, "perception"),
        ({"ranges": RangeFacts(early=0.001), "own": 0}, "missed_obstacle"),
        ({"ranges": RangeFacts(lost=0.001, off=0.01), "own": 0}, "missed_obstacle"),
        ({"ranges.blind": 4.0, "own": 0}, "perception"),
        ({"ranges.blind": 4.0, "own": 0, "unknown": 9}, "unseen_obstacle"),
        ({"old.hidden": "the pose came again", "old.stated": "old"}, "frozen_evidence"),
        ({"old.stated": "without a new sweep", "pose": LIED}, "stale_evidence"),
        ({"late": (40, 0.6, 0.25), "late_answer": 0.59}, "plugin_failed"),
        ({"late": (40, 0.6, 0.25), "late_answer": 0.05}, "latency"),
        ({"commanded": BLOCKED}, "disregarded_obstacle"),
        ({"commanded": BLOCKED, "pose": LIED}, "disregarded_obstacle"),
        ({"commanded": replace(BLOCKED, in_the_way=0)}, "disregarded_obstacle"),
        ({"commanded": replace(BLOCKED, in_the_way=0), "own": 0}, "missed_obstacle"),
        ({"commanded": UNKNOWN, "own": 0, "unknown": 9}, "unseen_obstacle"),
        ({"commanded": UNKNOWN, "own": 0, "unknown": 9, "pose": LIED}, "unseen_obstacle"),
        (
            {"commanded": UNKNOWN, "own": 0, "unknown": 9, "there_when_decided": False},
            "moved_obstacle",
        ),
        ({"commanded": UNKNOWN, "own": 0}, "missed_obstacle"),
        (
            {"commanded": UNKNOWN, "own": 0, "free": 12, "unknown": 5, "hidden": 16},
            "unseen_obstacle",
        ),
        (
            {"commanded": UNKNOWN, "own": 0, "free": 4, "unknown": 3, "hidden": -9},
            "missed_obstacle",
        ),
        ({"commanded": UNKNOWN}, "margin_too_small"),
    ],
)
def test_a_contact_has_the_cause_that_its_facts_leave(change, cause):
    assert cause_of(contacts.TESTS, changed(TOUCH, change)) == cause
