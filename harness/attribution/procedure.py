"""Attribution of an episode: of its contact, or of its failure to arrive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, moments_of, with_whole_area
from wayproof.harness.attribution.contact import cause_of_contact, near_to_contact
from wayproof.harness.attribution.contact_facts import contact_facts
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.standstill import cause_of_standstill, near_to_standstill
from wayproof.harness.attribution.standstill_facts import standstill_facts
from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.goals import leg_towards
from wayproof.harness.log.codec.messages import read_unfinished
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.recompute.rebuild import segment_of
from wayproof.harness.result import Contact, Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.stack.rolling_window import edge_of

TOO_LARGE = "the operating area is too large to search all of it for a way"


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


def nearest_contact(case: Case, moment: Moment) -> Contact:
    """Return a contact with what was nearest to the robot at a moment."""
    case.space.place_movers(moment.truth)
    case.space.place_robot(moment.true_position, np.array(moment.truth.quaternion))
    place, name = case.space.body_contact(flies=not case.mission.planar)
    x, y, z = place.tolist()
    return Contact(name, (x, y, z))


def with_cause(result: Result, scenario: Scenario, log: LogWriter) -> Result:
    """Return the result of a failure, which is no error, with its cause.

    Args:
        result: Result of the episode, with at least one decision.
        scenario: Scenario of the episode.
        log: Its full log, without a result yet.

    Raises:
        OSError: The log cannot be written or read.
    """
    log.flush()
    moments = tuple(moments_of(read_unfinished(log.partial_path)))
    if len(moments) != result.decisions:
        raise OSError(
            f"log '{log.partial_path}': {len(moments)} decisions can be read, "
            f"expected the {result.decisions} that were written"
        )
    case = Case(
        config=scenario.config,
        mission=leg_towards(scenario.mission, moments[-1].goal),
        segments=(segment_of(scenario),),
        outcome=result.outcome,
        reason=result.reason,
        end_s=result.sim_time_s,
        contact=Contact.from_text(result.contact),
        moments=moments,
        space=TrueSpace(scenario.scene.mjcf),
    )
    finding = find_cause(case)
    assert finding is not None
    return replace(
        result,
        cause=finding.cause,
        cause_evidence=finding.evidence,
        cause_decision=finding.decision,
    )
