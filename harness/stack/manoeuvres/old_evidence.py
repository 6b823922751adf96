"""Stopping by old evidence: the way to rest must lie in what was seen recently."""

from __future__ import annotations

from wayproof.harness.stack.manoeuvres.stopping import brake
from wayproof.harness.stack.old_evidence import OldEvidence, old_evidence
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.types import Command, Decided, PlannerInput, is_stationary
from wayproof.planners import hold, remaining, stopping_distance, truncate


def stop_in_seen_space(situation: Situation) -> Decided | None:
    """Brake on the way once its stopping distance lies in old evidence; at rest, stay.

    By the map and the robot's own speed, whichever sensor it is that sees nothing any more.
    """
    input, state, start = situation.input, situation.state, situation.start
    path, needs = start.position[None], 0.0
    if not is_stationary(start):
        path = remaining(state.trajectory.path, start.arc_length)
        needs = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    found = old_evidence(input, truncate(path, needs) if needs else path[:1])
    if found is None:
        return None
    if needs:
        return brake(input, state, start, path, reason_of(input, found), "map_stale")
    trajectory = hold(start.position, input.effect_ns, start.heading)
    command = Command("stop_and_wait", reason_of(input, found), "map_stale", trajectory)
    return Decided(command, state)


def reason_of(input: PlannerInput, found: OldEvidence) -> Reason:
    """Return the reason of a robot that stops by old evidence."""
    limit = input.config.costmap.max_evidence_age
    return Reason("old_evidence", delay_s=found.age_s, deadline_s=limit)
