"""Occupied cells of a map that are truly free: ghosts, and traces of movers."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.attribution.grids import (
    Array,
    Cells,
    clearances,
    passage,
    true_occupancy,
)
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.stack.footprint import body_of
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import OCCUPIED
from wayproof.models.grids import distances

GHOST_CELLS = 1.5
"""Distance from anything true beyond which an occupied cell is a ghost, pose error apart, cells."""

JUST_NOW = 1.0
"""Time for which a map may still hold a thing that left, s: the surest cell takes nine sweeps."""


def ghosts(case: Case, navigator: Navigator) -> dict[str, Any]:
    """Return ghosts of the last map, and whether it has a path without them or without movers."""
    costmap, number = navigator.costmap, len(case.moments) - 1
    last, occupied = case.moments[-1], costmap.state == OCCUPIED
    case.space.place_movers(last.truth)
    truly = _near(case, navigator, true_occupancy(case, navigator), last)
    cells = occupied & ~truly & ~_near(case, navigator, _swept(case, navigator, number), last)
    way = passage(case, navigator, last.believed, corners=False)
    gaps = clearances(occupied & ~cells, costmap.resolution)
    return {
        "ghosts": int(cells.sum()),
        "of_prior": _of_prior(case, navigator, cells),
        "ghost": _nearest_cell(navigator, cells, way.start),
        "without_ghosts": way.leads(gaps > costmap.inflation_radius),
        "roomy_without_ghosts": way.lets_turn(gaps > turning_radius(case, navigator)),
        "without_movers": without_movers(case, navigator, number),
    }


def _of_prior(case: Case, navigator: Navigator, cells: Cells) -> int:
    """Return how many cells of a costmap the prior map alone holds occupied."""
    prior = logged_cells(case.config)
    if prior is None or not cells.any():
        return 0
    costmap, size = navigator.costmap, navigator.costmap.resolution
    centres = costmap.origin + (np.argwhere(cells) + 0.5) * size
    heights = centres[:, 2:]
    if case.mission.planar:
        span = np.arange(case.mission.step_height + 0.5 * size, case.mission.height, size)
        heights = np.tile(span, (len(centres), 1))
    points = np.repeat(centres, heights.shape[1], axis=0)
    points[:, 2] = heights.ravel()
    held = prior.states_at(points).reshape(heights.shape) == OCCUPIED
    measured = navigator.map.observed_ns_at(points).reshape(heights.shape) >= 0
    return int((held & ~measured).any(axis=1).sum())


def without_movers(case: Case, navigator: Navigator, number: int) -> bool:
    """Return whether the map of a decision has a path without present and recent movers."""
    size, moment = navigator.costmap.resolution, case.moments[number]
    if not moment.truth.movers:
        return False
    moving = _near(case, navigator, _swept(case, navigator, number), moment)
    case.space.place_movers(moment.truth, present=False)
    moving &= _to_nearest(true_occupancy(case, navigator), size) > size
    still = (navigator.costmap.state == OCCUPIED) & ~moving
    way = passage(case, navigator, moment.believed, corners=False)
    return way.leads(clearances(still, size) > navigator.costmap.inflation_radius)


def _near(case: Case, navigator: Navigator, cells: Cells, moment: Moment) -> Cells:
    """Return cells that may represent true ones, within cell size and pose error."""
    size = navigator.costmap.resolution
    near: Cells = _to_nearest(cells, size) <= GHOST_CELLS * size + np.linalg.norm(moment.error)
    return near


def turning_radius(case: Case, navigator: Navigator) -> float:
    """Return the inflation radius of the disc about the whole body, m."""
    body = body_of(case.mission)
    return navigator.costmap.inflation_radius + body.circumscribed_radius - min(body.radii)


def _swept(case: Case, navigator: Navigator, number: int) -> Cells:
    """Return the cells of the costmap with movers at a decision or just before."""
    since_ns = case.moments[number].time_ns - round(JUST_NOW * 1e9)
    swept = np.zeros(navigator.costmap.shape, np.bool_)
    for moment in case.moments[: number + 1]:
        if moment.time_ns >= since_ns and moment.truth.movers:
            case.space.place_movers(moment.truth)
            swept |= true_occupancy(case, navigator, moving=True)
    return swept


def _to_nearest(occupied: Cells, size: float) -> Array:
    """Return the distance to the nearest occupied cell, the edge of the grid excluded, m."""
    if not occupied.any():
        return np.full(occupied.shape, np.inf)
    return distances(occupied) * size


def _nearest_cell(
    navigator: Navigator, cells: Cells, about: tuple[int, ...]
) -> tuple[float, float, float]:
    places = np.argwhere(cells)
    if not len(places):
        return 0.0, 0.0, 0.0
    nearest = places[((places - about) ** 2).sum(axis=1).argmin()]
    costmap = navigator.costmap
    x, y, z = (costmap.origin + (nearest + 0.5) * costmap.resolution).tolist()
    return x, y, z
