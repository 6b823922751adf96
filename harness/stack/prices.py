"""Prices of space: what a cell costs for another reason than that an obstacle is near."""

from __future__ import annotations

from dataclasses import replace

from wayproof.planners import FreeSpace

UNKNOWN, ELSEWHERE, TRIED_ONCE, TRIED_OFTEN = 1, 2, 3, 4
"""Indices of `FreeSpace.cost_by_price`: not known to be free; free by other evidence than
measurements alone; in a narrow gap that closed before the robot once, and more often."""

PRICES = 5
"""Number of prices, with that of none."""


def with_costs(space: FreeSpace, costs: dict[int, float]) -> FreeSpace:
    """Return a space in which some prices have other costs."""
    table = [*space.cost_by_price, *[0.0] * (PRICES - len(space.cost_by_price))]
    for price, cost in costs.items():
        table[price] = cost
    return replace(space, cost_by_price=tuple(table))
