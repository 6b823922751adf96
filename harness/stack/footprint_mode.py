"""Choice of footprint for an elongated body: circumscribed, or oriented discs at its heading.

Where the circumscribed disc fits, the body may turn as it likes, and search and motion are those
of a disc: fast, and with room to spare. Only where no such path leads on, or only a long detour,
is it planned for by its discs at their heading, through gaps in which it cannot turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.prices import note_lost_way, record_closed_gap, with_closed_gaps
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Command, Decided, PlannerInput, arc_length, is_free_along
from wayproof.maps.elementary import cosine
from wayproof.planners import remaining

DETOUR_RATIO = 2.0
"""Ratio of a path's length to that of the one it replaces beyond which it is a detour."""

DETOUR_LENGTH = 2.0
"""Length that a detour is longer besides, m.

A gap that is too narrow for the circumscribed disc looks wide enough from afar, where what bounds
it is hardly seen: without this rule a robot went to and fro between two ways.
"""


MAX_STEP = 0.1
"""Longest way out of the inflation of the discs where the disc about them has none, m."""

MAX_TURN = 0.2
"""Greatest turn out of it, rad."""


class FootprintDecision(NamedTuple):
    """A decision, and the footprint that it was made for.

    Attributes:
        command: Command of the robot.
        state: Planner state for the next decision.
        input: Planner input of the footprint chosen.
    """

    command: Command
    state: PlannerState
    input: PlannerInput


def decide_with_footprint(
    circumscribed: PlannerInput, make_oriented: Callable[[], PlannerInput], state: PlannerState
) -> FootprintDecision:
    """Decide for the circumscribed footprint, or for the oriented one where that does not lead on.

    Args:
        circumscribed: Input for the disc about the body.
        make_oriented: Makes the input for the discs at their heading; seldom called.
        state: Planner state before the decision.
    """
    decided = _decide(circumscribed, make_oriented, state)
    return decided._replace(state=record_closed_gap(decided.input, decided.state))


def _decide(
    circumscribed: PlannerInput, make_oriented: Callable[[], PlannerInput], state: PlannerState
) -> FootprintDecision:
    """Decide for one of the footprints; arguments as of `decide_with_footprint`."""
    if state.narrows.oriented and not _can_widen(circumscribed, state):
        oriented = make_oriented()
        state = note_lost_way(oriented, state)
        oriented = with_closed_gaps(oriented, state)
        return FootprintDecision(*decide(oriented, state), oriented)
    wide = decide(circumscribed, _planned_for(state, oriented=False))
    limit = DETOUR_RATIO * _length_left(state, circumscribed) + DETOUR_LENGTH
    wide_leads = _makes_progress(wide)
    if wide_leads and _path_length(wide.state) <= limit:
        return FootprintDecision(*wide, circumscribed)
    oriented = with_closed_gaps(make_oriented(), state)
    narrow = decide(oriented, _planned_for(state, oriented=True))
    narrow_leads = _makes_progress(narrow)
    if narrow_leads and (not wide_leads or _path_length(narrow.state) <= limit):
        return FootprintDecision(*narrow, oriented)
    if state.narrows.oriented and _brakes(wide) and _brakes(narrow):
        return FootprintDecision(*narrow, oriented)
    if _steps_out(narrow) and not _escapes(wide):
        return FootprintDecision(*narrow, oriented)
    return FootprintDecision(*wide, circumscribed)


def _planned_for(state: PlannerState, *, oriented: bool) -> PlannerState:
    return replace(state, narrows=replace(state.narrows, oriented=oriented))


def _can_widen(circumscribed: PlannerInput, state: PlannerState) -> bool:
    """Return whether an oriented footprint's path ahead has room for the circumscribed one."""
    start = state.trajectory.at(circumscribed.effect_ns)
    if state.global_path is None:
        return True
    path = remaining(state.global_path, start.arc_length)
    if not is_free_along(circumscribed.optimistic, path):
        return False
    if not circumscribed.traversable.is_free(start.position):
        return False
    return cosine(heading_at(path, 0.0) - start.heading) > 0.0  # not tail first


def _length_left(state: PlannerState, input: PlannerInput) -> float:
    """Return the length left of the known path to the goal, m; infinite without one."""
    if state.global_path is None or state.exploring:
        return math.inf
    start = state.trajectory.at(input.effect_ns)
    return arc_length(remaining(state.global_path, start.arc_length))


def _path_length(state: PlannerState) -> float:
    """Return the length of the path to the goal after a decision, m; infinite without one."""
    if state.global_path is None or state.exploring:
        return math.inf
    return arc_length(state.global_path)


def _makes_progress(decided: Decided) -> bool:
    """Return whether the robot moves, turns or has arrived."""
    command = decided.command
    if command.reason.kind == "leaving_inflation" or command.action == "abort":
        return False
    return command.action != "stop_and_wait"


def _escapes(decided: Decided) -> bool:
    """Return whether the body moves or turns out of the inflation."""
    command = decided.command
    return command.reason.kind == "leaving_inflation" and command.trajectory.duration_s > 0.0


def _steps_out(decided: Decided) -> bool:
    """Return whether the body leaves the inflation that it only grazes.

    A longer way out leads on among what may be ghosts, towards what the map may lack.
    """
    reason = decided.command.reason
    short = (reason.distance_m or 0.0) <= MAX_STEP and abs(reason.turn_rad or 0.0) <= MAX_TURN
    return _escapes(decided) and short


def _brakes(decided: Decided) -> bool:
    """Return whether a robot in motion comes to rest."""
    return decided.command.action == "stop_and_wait" and decided.command.trajectory.duration_s > 0.0
