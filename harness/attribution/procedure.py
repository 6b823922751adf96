"""Attribution of an episode: of its contact, or of its failure to arrive."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, with_whole_area
from wayproof.harness.attribution.contact import cause_of_contact, near_to_contact
from wayproof.harness.attribution.contact_facts import contact_facts
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.standstill import cause_of_standstill, near_to_standstill
from wayproof.harness.attribution.standstill_facts import standstill_facts
from wayproof.harness.result import Contact
from wayproof.harness.stack.rolling_window import edge_of

TOO_LARGE = "the operating area is too large to search all of it for a way"


@dataclass(frozen=True)
class NearMiss:
    """Moment at which the robot was nearer to something than half its margin.

    Attributes:
        decision: Number of the decision.
        time_s: Simulated time, s.
        clearance_m: True clearance of the body, m.
        finding: Its cause.
    """

    decision: int
    time_s: float
    clearance_m: float
    finding: Finding


def find_cause(case: Case) -> Finding | None:
    """Return the cause of a failure; None for a success or an error."""
    if case.outcome in ("success", "error"):
        return None
    contact = contact_of(case)
    if contact is not None:
        return cause_of_contact(case, contact, case.end_s)
    whole = _whole(case)
    if whole is None:
        x, y, z = case.moments[-1].truth.position
        return Finding("unexplained", TOO_LARGE, len(case.moments) - 1, (x, y, z))
    return cause_of_standstill(whole)


def _whole(case: Case) -> Case | None:
    """Return the case with costmaps of the whole area; None if that takes too much memory."""
    rolling = any(math.isfinite(edge_of(one.config, one.mission)) for one in case.segments)
    return with_whole_area(case) if rolling else case


def contact_of(case: Case) -> Contact | None:
    """Return the contact that ended an episode, or None."""
    if case.contact is None and case.outcome == "collision":
        return nearest_contact(case, case.moments[-1])
    return case.contact


def near_causes(case: Case) -> frozenset[str]:
    """Return the causes of a failure whose own tests hold, or are near to holding."""
    contact = contact_of(case)
    if contact is not None:
        return near_to_contact(contact_facts(case, contact, case.end_s))
    whole = _whole(case)
    return frozenset() if whole is None else near_to_standstill(standstill_facts(whole))


def near_misses(case: Case, most: int = 5) -> list[NearMiss]:
    """Return near misses, the nearest moment of each, without that of a contact.

    Args:
        case: The episode.
        most: Maximum number, the nearest ones.
    """
    runs: list[list[Moment]] = [[]]
    for moment in case.moments:
        if moment.truth.clearance_m < 0.5 * moment.decision.localization_margin_m:
            runs[-1].append(moment)
        elif runs[-1]:
            runs.append([])
    if runs[-1] and case.outcome == "collision":
        runs.pop()
    nearest = [min(run, key=lambda one: one.truth.clearance_m) for run in runs if run]
    nearest = sorted(nearest, key=lambda one: one.truth.clearance_m)[:most]
    return [_near_miss(case, one) for one in sorted(nearest, key=lambda one: one.time_ns)]


def nearest_contact(case: Case, moment: Moment) -> Contact:
    """Return a contact with what was nearest to the robot at a moment."""
    case.space.place_movers(moment.truth)
    case.space.place_robot(moment.true_position, np.array(moment.truth.quaternion))
    place, name = case.space.body_contact(flies=not case.mission.planar)
    x, y, z = place.tolist()
    return Contact(name, (x, y, z))


def _near_miss(case: Case, moment: Moment) -> NearMiss:
    time_s = moment.time_ns * 1e-9
    finding = cause_of_contact(case, nearest_contact(case, moment), time_s)
    return NearMiss(moment.decision.sequence, time_s, moment.truth.clearance_m, finding)
