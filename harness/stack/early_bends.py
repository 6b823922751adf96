"""Early bends of a body that need not face along its path, as a drone that flies sideways.

Within the distance that it takes to stop, such a body can leave its path along any bend that its
speed allows, if it can come to rest on the new path as well as on the old one.
"""

from __future__ import annotations

from collections.abc import Callable

from wayproof.harness.stack.path_timing import travel_time
from wayproof.harness.stack.types import Array, PlannerInput, arc_length
from wayproof.planners import PathState, Plan, TrajectorySample, keeps_limits, truncate

Found = tuple[Plan, Array | None]
"""A search, and the path (n, 3) that it found."""


def fastest_found(
    input: PlannerInput, start: TrajectorySample, prefix: Array, search: Callable[[Array], Found]
) -> Found:
    """Search from the end of a prefix and, if the body bends early, from places on it.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        prefix: (n, 3) of the present path, to where the body can stop, m.
        search: Plans from the end of a part of the prefix.

    Returns:
        The path that takes the least time to drive, of those along which the body keeps its limits.
        Without any early one, the one from the end of the prefix.
    """
    last = search(prefix)
    shares = input.gait.early_bends
    if len(prefix) == 1 or not shares:
        return last
    early = [search(truncate(prefix, share * arc_length(prefix))) for share in shares]
    found = [one for one in early if _stops_in_admitted(input, start, one[1])]
    if last[1] is not None:
        found.append(last)
    return min(found, key=lambda one: _time(input, start, one), default=last)


def _time(input: PlannerInput, start: TrajectorySample, found: Found) -> float:
    assert found[1] is not None
    return travel_time(input, start, found[1])


def _stops_in_admitted(input: PlannerInput, start: TrajectorySample, path: Array | None) -> bool:
    """Return whether the admitted part of a path can be driven to rest within all limits."""
    if path is None:
        return False
    part = truncate(path, input.traversable.free_length(path))
    state = PathState(input.effect_ns, 0.0, start.speed, start.acceleration, start.heading)
    return keeps_limits(part, state, input.gait.limits, input.gait.sideways_speed)
