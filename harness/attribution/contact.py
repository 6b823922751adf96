"""Cause of a contact, from its facts.

Each test takes measured facts and returns its evidence, or None. The first test with evidence names
the cause, so their order matters: a stack on trial that went where the referee's map held the
obstacle could have known; an obstacle that moved in, or a decision that came too late, explains the
state of the map, not the reverse.
"""

from __future__ import annotations

from collections.abc import Callable

from wayproof.harness.attribution.case import Case
from wayproof.harness.attribution.commanded import CommandedFacts
from wayproof.harness.attribution.contact_facts import LATE, ContactFacts, contact_facts
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.old_evidence import OLD_TESTS
from wayproof.harness.result import Contact

BLIND = 1.0
"""Distance beyond the body below which a robot without returns is blind to its path, m."""


def went_through_obstacle(facts: ContactFacts) -> str | None:
    """The referee's map held the obstacle in the way of a command, which was followed."""
    commanded = facts.commanded
    if commanded is None or commanded.verdict != "blocked" or not commanded.in_the_way:
        return None
    return (
        f"{facts.name} was mapped, {commanded.in_the_way} cells of it in the way of decision "
        f"{facts.decision}, which the referee admitted for {commanded.free_m:.2f} m; "
        f"{_followed(commanded)}"
    )


def went_into_the_unknown(facts: ContactFacts) -> str | None:
    """The obstacle stood in space unknown to the referee, and a command into it was followed."""
    commanded = facts.commanded
    if commanded is None or commanded.verdict != "unknown" or not facts.there_when_decided:
        return None
    if facts.unknown + facts.hidden <= facts.free:
        return None
    return (
        f"{facts.name} stood in unknown space at decision {facts.decision} ({facts.unknown} of "
        f"{facts.unknown + facts.free} cells before it unknown), of which the referee "
        f"admitted {commanded.free_m:.2f} m; {_followed(commanded)}"
    )


def _followed(commanded: CommandedFacts) -> str:
    if commanded.count == 1:
        return "that command alone led to the contact"
    return (
        f"{commanded.count} commands that it did not admit led to the contact, from decision "
        f"{commanded.first} on"
    )


def stack_late(facts: ContactFacts) -> str | None:
    """A command that avoids the obstacle came too late, for the time that the stack took."""
    if facts.late is None or facts.late_answer <= facts.late[2] + LATE:
        return None
    number, _, expected = facts.late
    return (
        f"decision {number} kept clear of {facts.name} and would have been in time after "
        f"{expected * 1e3:.0f} ms; the stack answered after {facts.late_answer * 1e3:.0f} ms"
    )


def localization(facts: ContactFacts) -> str | None:
    """The pose error exceeds what the margin covers."""
    return str(facts.pose) if facts.pose.beyond > 0.0 else None


def perception(facts: ContactFacts) -> str | None:
    """Returns were lost, wrong or dropped, so that occupied space stayed free in the map."""
    if facts.ranges.lied:
        return str(facts.ranges)
    blind = facts.ranges.blind
    if not facts.own and facts.free >= facts.unknown and blind > max(facts.away, BLIND):
        return (
            f"returns nearer than {blind:.1f} m are dropped, and {facts.name} was "
            f"{facts.away:.1f} m away at decision {facts.decision}, where the map said free"
        )
    return None


def latency(facts: ContactFacts) -> str | None:
    """A decision that avoids the obstacle was made in time, but took effect too late."""
    if facts.late is None:
        return None
    number, delay, expected = facts.late
    return (
        f"decision {number} kept clear of {facts.name} and would have been in time after "
        f"{expected * 1e3:.0f} ms; it took {delay * 1e3:.0f} ms"
    )


def moved_obstacle(facts: ContactFacts) -> str | None:
    """The obstacle was not there yet at the decision, or when the map last observed the place."""
    if not facts.there_when_decided:
        return (
            f"{facts.name} was not at the place of contact at {facts.decision_s:.1f} s, "
            f"{facts.time_s - facts.decision_s:.1f} s before, when there was room to stop"
        )
    if facts.observed_s >= 0.0 and not facts.there_when_observed:
        return (
            f"{facts.name} came to the place of contact after {facts.observed_s:.1f} s, "
            "when the map had last looked there"
        )
    return None


def tracking(facts: ContactFacts) -> str | None:
    """The body had left a path on which it would have avoided the obstacle."""
    beyond, short = facts.off_path - facts.usual, facts.usual - facts.planned_clearance
    least = max(0.5 * facts.usual, 0.02)
    if beyond <= max(short, 0.0) or facts.planned_clearance < least:
        return None
    return (
        f"the body was {facts.off_path:.2f} m off its path (usual margin {facts.usual:.2f} m), "
        f"on which it would have kept {facts.planned_clearance:.2f} m from {facts.name}"
    )


def disregarded_obstacle(facts: ContactFacts) -> str | None:
    """The obstacle was mapped, and the stack chose a trajectory through it."""
    if not facts.own:
        return None
    if facts.commanded is not None and facts.commanded.blocked:
        return (
            f"{facts.name} was mapped ({facts.own} cells), and {facts.commanded.blocked} commands "
            f"that led to the contact were blocked by the referee's map; "
            f"{_followed(facts.commanded)}"
        )
    if facts.disregarded <= 0.0:
        return None
    return (
        f"{facts.name} was mapped ({facts.own} cells), and a trajectory was chosen that comes "
        f"{facts.disregarded:.2f} m nearer to it than body and margin allow"
    )


def unseen_obstacle(facts: ContactFacts) -> str | None:
    """The obstacle was in unknown space, which the policy lets the robot enter."""
    if facts.own or facts.unknown <= facts.free:
        return None
    if facts.commanded is not None:
        return (
            f"{facts.unknown} of {facts.unknown + facts.free} cells before {facts.name} were "
            f"unknown at decision {facts.decision}; {_followed(facts.commanded)}"
        )
    let_in = "the robot was let in"
    if facts.prior_free:
        let_in = f"{facts.prior_free} of these free in the prior map, which let the robot in"
    return (
        f"{facts.unknown} of {facts.unknown + facts.free} cells before {facts.name} were "
        f"unknown at decision {facts.decision}, and {let_in}"
    )


def missed_obstacle(facts: ContactFacts) -> str | None:
    """The obstacle was there, and the map says free."""
    if facts.own:
        return None
    return (
        f"{facts.free} cells before {facts.name} were mapped free and none of it occupied at "
        f"decision {facts.decision}, though it stood there"
    )


def margin_too_small(facts: ContactFacts) -> str | None:
    """The obstacle was mapped, and the robot came nearer than the errors of the map allow."""
    if not facts.own:
        return None
    return (
        f"{facts.name} was mapped ({facts.own} cells, the nearest {facts.nearest_own:.2f} m from "
        f"the contact), the pose was {facts.pose_error:.2f} m off, and the margin was "
        f"{facts.margin:.2f} m"
    )


TESTS: tuple[tuple[str, Callable[[ContactFacts], str | None]], ...] = (
    ("disregarded_obstacle", went_through_obstacle),
    ("unseen_obstacle", went_into_the_unknown),
    *OLD_TESTS,
    ("localization", localization),
    ("perception", perception),
    ("plugin_failed", stack_late),
    ("latency", latency),
    ("moved_obstacle", moved_obstacle),
    ("tracking", tracking),
    ("disregarded_obstacle", disregarded_obstacle),
    ("unseen_obstacle", unseen_obstacle),
    ("missed_obstacle", missed_obstacle),
    ("margin_too_small", margin_too_small),
)
"""Tests in their order, by cause."""


def near_to_contact(facts: ContactFacts) -> frozenset[str]:
    """Return the causes whose tests hold or are near to holding, whatever their order."""
    near = {cause for cause, test in TESTS if test(facts) is not None}
    near |= {"localization"} if facts.pose.nearly else set()
    near |= {"perception"} if facts.ranges.nearly_lied else set()
    near |= {"tracking"} if facts.off_path > 0.5 * facts.usual else set()
    return frozenset(near)


def cause_of_contact(case: Case, contact: Contact, time_s: float) -> Finding:
    """Attribute a contact at a time, s."""
    facts = contact_facts(case, contact, time_s)
    for cause, test in TESTS:
        evidence = test(facts)
        if evidence is not None:
            return Finding(cause, evidence, facts.decision, contact.position)
    raise AssertionError("the last test always answers")
