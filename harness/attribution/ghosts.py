"""Occupied cells of a map that nothing stands in: what moved on, and ghosts."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.attribution.grids import (
    Array,
    Cells,
    cell_of,
    clearances,
    holes_in_floor,
    joined,
    true_occupancy,
)
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import OCCUPIED

GHOST_CELLS = 1.5
"""An occupied cell farther than this from anything true, pose error apart, is a ghost."""

JUST_NOW = 1.0
"""What left so long ago may still be in a map that unlearns as fast as it should, s: by default the
surest cell takes nine sweeps."""


def ghosts(case: Case, navigator: Navigator) -> dict[str, Any]:
    """Of the last map: its ghosts, and which ways it has without these or without what moves."""
    costmap, number = navigator.costmap, len(case.moments) - 1
    last, occupied = case.moments[-1], costmap.state == OCCUPIED
    case.space.place_movers(last.truth)
    truly = _near(case, navigator, true_occupancy(case, navigator), last)
    cells = occupied & ~truly & ~_near(case, navigator, _swept(case, navigator, number), last)
    believed = cell_of(navigator, last.true_position + last.error)
    return {
        "ghosts": int(cells.sum()),
        "holes": int((cells & holes_in_floor(case, navigator)).sum()),
        "ghost": _nearest_cell(navigator, cells, believed),
        "without_ghosts": _opens(case, navigator, occupied & ~cells, last),
        "without_movers": without_movers(case, navigator, number),
    }


def without_movers(case: Case, navigator: Navigator, number: int) -> bool:
    """Whether a decision's map has a way without what moves there, or stood there just before."""
    size, moment = navigator.costmap.resolution, case.moments[number]
    if not moment.truth.movers:
        return False
    moving = _near(case, navigator, _swept(case, navigator, number), moment)
    case.space.place_movers(moment.truth, present=False)
    moving &= _to_nearest(true_occupancy(case, navigator), size) > size
    return _opens(case, navigator, (navigator.costmap.state == OCCUPIED) & ~moving, moment)


def _near(case: Case, navigator: Navigator, cells: Cells, moment: Moment) -> Cells:
    """Cells that may stand for some true ones, as far off as cells and the pose's error make."""
    size = navigator.costmap.resolution
    near: Cells = _to_nearest(cells, size) <= GHOST_CELLS * size + np.linalg.norm(moment.error)
    return near


def _opens(case: Case, navigator: Navigator, occupied: Cells, moment: Moment) -> bool:
    """Whether some occupied cells leave a way from where a decision believed the robot to be."""
    costmap, (goal, reach) = navigator.costmap, goal_of(case, navigator)
    believed = cell_of(navigator, moment.true_position + moment.error)
    gaps = clearances(occupied, costmap.resolution)
    return joined(gaps > costmap.inflation_radius, believed, goal, reach)


def _swept(case: Case, navigator: Navigator, number: int) -> Cells:
    """Where anything that moves is at a decision, or was just before it; cells of the costmap."""
    since_ns = case.moments[number].time_ns - round(JUST_NOW * 1e9)
    swept = np.zeros(navigator.costmap.shape, np.bool_)
    for moment in case.moments[: number + 1]:
        if moment.time_ns >= since_ns and moment.truth.movers:
            case.space.place_movers(moment.truth)
            swept |= true_occupancy(case, navigator, moving=True)
    return swept


def _to_nearest(occupied: Cells, size: float) -> Array:
    """Distance to the nearest cell that is occupied, the grid's edge apart, m."""
    from scipy import ndimage

    if not occupied.any():
        return np.full(occupied.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(~occupied) * size)


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


def goal_of(case: Case, navigator: Navigator) -> tuple[tuple[int, ...], int]:
    """The goal's cell, and the cells about it that count as it."""
    reach = max(1, round(case.config.episode.goal_tolerance / navigator.costmap.resolution))
    return cell_of(navigator, np.array(case.mission.goal)), reach
