"""Cells of the map that block the body of a decision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.decision import path_of
from wayproof.harness.log.paths import densely
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]

SHOWN_CELLS = 5
"""Maximum number of blocking cells on a card, those nearest to the path."""


@dataclass(frozen=True)
class BlockingCell:
    """Cell that blocks the path.

    Attributes:
        state: `occupied`, `unknown`, or `floor not seen`: the column is free above its floor.
        place: (x, y, z) of its centre, m; on the ground of its column.
        distance_m: Distance from the robot, m.
        age_s: Time since its last observation, s; None without one.
        probability: Probability of occupancy; on the ground the greatest in its column.
    """

    state: str
    place: tuple[float, float, float]
    distance_m: float
    age_s: float | None
    probability: float


def blocking_cells(case: Case, moment: Moment, navigator: Navigator) -> tuple[BlockingCell, ...]:
    """Return the cells that first block the way to the goal by the unknown policy; maybe none.

    The way is the global path, of a stack on trial its planned path; or without one the straight
    line to the goal.
    """
    costmap, decision = navigator.costmap, moment.decision
    # Of the disc or discs of the decision: an elongated body has two widths.
    limit, radius = decision.collision_distance_sq, decision.inflation_radius_m
    field, size = costmap.field(), costmap.resolution
    way = densely(_way(case, moment), 0.5 * size)
    cells = np.floor((way - costmap.origin) / size).astype(int)
    inside = ((cells >= 0) & (cells < costmap.shape)).all(axis=1)
    cells, way = cells[inside], way[inside]
    closed = np.flatnonzero(field[tuple(cells.T)] <= limit) if len(cells) else cells[:, 0]
    if not len(closed):
        return ()
    place = way[closed[0]]
    states = costmap.state
    wrong = states != FREE if costmap.config.unknown_policy == "forbid" else states == OCCUPIED
    found = np.argwhere(wrong)
    centres = np.round(costmap.origin + (found + 0.5) * size, 9)  # as a reason prints them
    gaps = np.linalg.norm(centres - place, axis=1)
    nearest = np.argsort(gaps, kind="stable")[:SHOWN_CELLS]
    nearest = nearest[gaps[nearest] <= radius + size]
    here = np.array(moment.pose.position)
    return tuple(
        _blocking(
            case, moment, navigator, cell=tuple(found[k].tolist()), centre=centres[k], here=here
        )
        for k in nearest
    )


def _blocking(
    case: Case,
    moment: Moment,
    navigator: Navigator,
    cell: tuple[int, ...],
    centre: Array,
    here: Array,
) -> BlockingCell:
    """Describe one cell, whose centre is (3,) m, as seen from the body at `here` (3,), m."""
    occupied = navigator.costmap.state[cell] == OCCUPIED
    column, state = centre[None], "occupied" if occupied else "unknown"
    if case.mission.planar:
        size = navigator.map.resolution
        heights = np.arange(0.5 * size, case.mission.height, size)
        column = np.column_stack([np.tile(centre[:2], (len(heights), 1)), heights])
        floor = np.array([[*centre[:2], 0.0]])
        unseen = navigator.map.state_at(floor)[0] == UNKNOWN
        if not occupied and unseen and (navigator.map.state_at(column[1:]) == FREE).all():
            column, centre, state = floor, floor[0], "floor not seen"
    observed = int(navigator.map.observed_ns_at(column).max())
    if state == "floor not seen":
        observed = -1  # the beams that passed above it looked at no floor
    x, y, z = centre.tolist()
    return BlockingCell(
        state=state,
        place=(x, y, z),
        distance_m=float(np.linalg.norm((centre - here)[: case.axes])),
        age_s=None if observed < 0 else (moment.time_ns - observed) * 1e-9,
        probability=float(navigator.map.probability_at(column).max()),
    )


def _way(case: Case, moment: Moment) -> Array:
    """Return the way (n, 3) to the goal that the cells block, m; see `blocking_cells`."""
    global_path = path_of(moment.decision.global_path)
    committed = path_of(moment.decision.trajectory.path)
    if len(global_path) >= 2:
        return global_path
    goal = np.array(case.mission.goal)
    if case.mission.planar:
        goal[2] = committed[-1, 2]
    return np.vstack([committed[-1], goal])
