"""Prices of space: what a cell costs for another reason than that an obstacle is near.

**Unknown space** costs less to a robot in flight where enough of a path is admitted: it sees what
lies ahead while it draws near, and at the full cost would take detours within what it has seen.
Above and below itself it does not see well, so there the full cost remains. It remains all around
for a body that has only a camera, whose cone leaves the sides unknown.
"""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.stack.types import Array, PlannerInput, arc_length
from wayproof.planners import FreeSpace, stopping_distance

UNKNOWN, ELSEWHERE = 1, 2
"""Indices of `FreeSpace.cost_by_price`: not known to be free; free by other evidence than
measurements alone."""

PRICES = 3
"""Number of prices, with that of none."""


def with_costs(space: FreeSpace, costs: dict[int, float]) -> FreeSpace:
    """Return a space in which some prices have other costs."""
    table = [*space.cost_by_price, *[0.0] * (PRICES - len(space.cost_by_price))]
    for price, cost in costs.items():
        table[price] = cost
    return replace(space, cost_by_price=tuple(table))


STOPS_AHEAD = 1.25
"""Admitted part of a path, in stops from full speed, that is enough to go on at that speed."""

SHARE_OF_COST = 0.0625
"""Share of the cost of unknown space that is left on such a path: at the defaults half of a path's
length. With twice that the drone took 1.03 instead of 1.02 of the shortest way in halls of 60 m."""


def enough_admitted(input: PlannerInput, path: Array) -> bool:
    """Return whether the beginning of a path (n, 3), or all of it, is admitted for full speed."""
    full_stop = stopping_distance(input.gait.limits.speed, 0.0, input.gait.limits)
    needed = min(STOPS_AHEAD * full_stop, arc_length(path))
    return input.traversable.free_length(path) >= needed


def discounted_space(input: PlannerInput) -> FreeSpace:
    """Return the optimistic space in which the unknown costs less."""
    space = input.optimistic if input.spaces.guided is None else input.spaces.guided
    costs = {
        price: SHARE_OF_COST * cost
        for price, cost in enumerate(space.cost_by_price)
        if price in (ELSEWHERE, UNKNOWN)
    }
    return with_costs(space, costs)
