"""Prices of space: what a cell costs for another reason than that an obstacle is near.

**Unknown space** costs less to a robot in flight where enough of a path is admitted: it sees what
lies ahead while it draws near, and at the full cost would take detours within what it has seen.
Above and below itself it does not see well, so there the full cost remains. It remains all around
for a body that has only a camera, whose cone leaves the sides unknown.

**Narrow gaps** that closed before the robot cost more from then on. What bounds a gap looks
otherwise from afar than from near: a cell that a surface cuts is occupied by beams that end in it,
and free by those that graze it. Without a memory a robot whose gap closed before it turns away,
sees the gap open from there, and comes back.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wayproof.harness.stack.state import ClosedGap, LostWay, Place, PlannerState
from wayproof.harness.stack.types import Array, PlannerInput, arc_length, distance, is_free_along
from wayproof.planners import FreeSpace, point_at, remaining, stopping_distance

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


SEEN_WITHIN = 1.0
"""Length of the path before a gap from which the robot judges it, m; from afar it is not sure."""

DETOUR = 1.5
"""Extra length of a path that leads around what closed, m; a shorter one evades a cell or two."""

GIVEN_UP_NS = 10_000_000_000
"""Time after which a way that closed is no longer compared with what the robot follows, ns."""

SAME_GAP = 0.5
"""Distance within which two places are the same gap, m."""

GAP_RADIUS = 0.4
"""Radius about a gap within which space costs more, m."""

TRY_COSTS = (4.0, 12.0)
"""Cost of the way through a gap that closed once, and more often, m of length."""

MOST_GAPS = 32
"""Number of gaps that are remembered, the latest ones."""


def note_lost_way(input: PlannerInput, state: PlannerState) -> PlannerState:
    """Note where the global path closed right before an elongated body, if it did.

    Args:
        input: Planner input of the oriented footprint.
        state: Planner state before the decision; not written to.
    """
    if state.global_path is None or state.exploring:
        return state
    start = state.trajectory.at(input.effect_ns)
    path = remaining(state.global_path, start.arc_length)
    if is_free_along(input.optimistic, path):
        return state
    free, length = input.optimistic.free_length(path), arc_length(path)
    if free > SEEN_WITHIN:
        return state
    x, y, z = point_at(path, min(free + input.optimistic.resolution, length)).tolist()
    lost = LostWay((x, y, z), length, input.time_ns)
    return replace(state, narrows=replace(state.narrows, lost=lost))


def record_closed_gap(input: PlannerInput, state: PlannerState) -> PlannerState:
    """Record a gap that closed once the robot takes a detour around it.

    Args:
        input: Planner input of the decision.
        state: Planner state after the decision; not written to.
    """
    narrows, lost = state.narrows, state.narrows.lost
    if lost is None:
        return state
    if input.time_ns - lost.time_ns > GIVEN_UP_NS:
        return replace(state, narrows=replace(narrows, lost=None))
    path = state.global_path
    if path is None or state.exploring or arc_length(path) < lost.length_m + DETOUR:
        return state
    closed = _with_try(narrows.closed, lost.place)
    return replace(state, narrows=replace(narrows, lost=None, closed=closed))


def _with_try(gaps: tuple[ClosedGap, ...], place: Place) -> tuple[ClosedGap, ...]:
    """Return the gaps with one more try of that at a place, as the latest."""
    others = [gap for gap in gaps if distance(np.array(gap.place), np.array(place)) >= SAME_GAP]
    tries = 1 + max((gap.tries for gap in gaps if gap not in others), default=0)
    return (*others, ClosedGap(place, tries))[-MOST_GAPS:]


def with_closed_gaps(input: PlannerInput, state: PlannerState) -> PlannerInput:
    """Return the planner input by which ways through closed gaps cost more."""
    if not state.narrows.closed:
        return input
    guided = input.optimistic if input.spaces.guided is None else input.spaces.guided
    weight, gaps = input.planner.clearance_weight, state.narrows.closed
    costly = costly_gaps(guided, gaps, weight)
    return replace(input, spaces=replace(input.spaces, guided=costly, avoids_gaps=True))


def costly_gaps(space: FreeSpace, gaps: tuple[ClosedGap, ...], weight: float) -> FreeSpace:
    """Return a flat space in which the way through a gap costs `TRY_COSTS` more.

    No cell becomes free or blocked.

    Args:
        space: Not written to.
        gaps: Gaps that closed.
        weight: Weight of the cell cost against length.
    """
    field = space.distances[:, :, 0]
    prices = np.zeros(space.distances.shape, np.uint8)
    if space.prices is not None:
        prices[:] = space.prices
    middle = space.origin[:2] + 0.5 * space.resolution  # of the first cell
    for gap in sorted(gaps, key=lambda gap: gap.tries):
        columns, rows = _cells_about(space, gap)
        x = middle[0] + space.resolution * np.arange(columns.start, columns.stop)
        y = middle[1] + space.resolution * np.arange(rows.start, rows.stop)
        apart = np.square(x - gap.place[0])[:, None] + np.square(y - gap.place[1])
        free = field[columns, rows] > space.shape.thresholds.max()
        inside = (apart <= GAP_RADIUS * GAP_RADIUS) & free
        prices[columns, rows, 0][inside] = TRIED_ONCE if gap.tries == 1 else TRIED_OFTEN
    costs = zip((TRIED_ONCE, TRIED_OFTEN), TRY_COSTS, strict=True)
    way = 2.0 * GAP_RADIUS * max(weight, 1.0)
    return with_costs(replace(space, prices=prices), {price: cost / way for price, cost in costs})


def _cells_about(space: FreeSpace, gap: ClosedGap) -> list[slice]:
    """Return the cells along x and y that hold all of a gap's surroundings within the space."""
    reach = math.ceil(GAP_RADIUS / space.resolution) + 1
    cells = np.floor((np.array(gap.place) - space.origin) / space.resolution).astype(np.int64)
    counts = space.distances.shape[:2]
    return [
        slice(min(max(cell - reach, 0), n), min(max(cell + reach + 1, 0), n))
        for cell, n in zip(cells.tolist(), counts, strict=False)
    ]
