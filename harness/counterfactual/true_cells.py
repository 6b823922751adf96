"""Marking of a map with the true state of its cells, by synthetic beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case
from wayproof.harness.attribution.grids import true_occupancy
from wayproof.harness.inputs import Inputs
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps import Representation
from wayproof.maps.states import FREE, OCCUPIED
from wayproof.models.sensors.beams import NO_RETURN

Array = NDArray[np.float64]

BACK = 1.0
"""Length of a beam that marks a cell, m: beyond the minimum range of a map."""


@dataclass(frozen=True)
class TrueCells:
    """Centres of cells (n, 3), and whether each is occupied (n,)."""

    centres: Array
    occupied: NDArray[np.bool_]


def true_cells(case: Case, navigator: Navigator) -> TrueCells:
    """Return the true cells of the region of a map, with the movers as placed."""
    size, costmap = navigator.map.resolution, navigator.costmap
    corner = costmap.origin.copy()
    if not case.mission.planar:
        grid = true_occupancy(case, navigator)
    else:
        below = int(np.ceil(max(-case.mission.low[2], 0.0) / size))
        corner[2] += size * (np.floor(-corner[2] / size) - below)
        layers = int(np.ceil((case.mission.height - corner[2]) / size))
        grid = case.space.occupied(corner, (*costmap.shape[:2], layers), size)
        # The layer of the floor and those below: a free cell there is a hole to the stack.
        grid[:, :, : below + 1] |= _floor(case, corner, grid.shape[:2], size)[:, :, None]
    cells = np.moveaxis(np.indices(grid.shape), 0, -1).reshape(-1, 3)
    return TrueCells(corner + (cells + 0.5) * size, grid.ravel())


def _floor(
    case: Case, corner: Array, shape: tuple[int, ...], size: float
) -> NDArray[np.bool_]:  # (nx, ny)
    """Return which columns have a floor."""
    x, y = np.meshgrid(*((np.arange(n) + 0.5) * size for n in shape), indexing="ij")
    spots = np.stack([corner[0] + x, corner[1] + y, np.zeros_like(x)], axis=-1)
    return case.space.borne(spots.reshape(-1, 3)).reshape(shape)


def mark_truth(navigator: Navigator, truth: TrueCells, inputs: Inputs) -> None:
    """Mark the true state of cells in a map with synthetic beams.

    One beam ends in each occupied cell, and one beam without return, no longer than a cell, passes
    each free one; within a sweep occupied wins, so no beam clears another's cell.
    """
    voxel_map, size = navigator.map, navigator.map.resolution
    states = voxel_map.state_at(truth.centres)  # correct cells need no beam
    free = truth.centres[~truth.occupied & (states != FREE)]
    solid = truth.centres[truth.occupied & (states != OCCUPIED)]
    back = max(BACK, 1.1 * voxel_map.config.minimum_range)
    _cast(
        voxel_map,
        ends=free,
        back=0.2 * size,
        range_mm=int(NO_RETURN),
        limit=0.4 * size,
        time_ns=inputs.time_ns,
    )
    _cast(
        voxel_map,
        ends=solid,
        back=back,
        range_mm=round(back * 1e3),
        limit=2.0 * back,
        time_ns=inputs.time_ns,
    )


def _cast(
    voxel_map: Representation, ends: Array, back: float, range_mm: int, limit: float, time_ns: int
) -> None:
    """Integrate one sweep of vertical beams from `back` metres above points (n, 3)."""
    count = len(ends)
    if not count:
        return
    voxel_map.integrate(
        ends + np.array([0.0, 0.0, back]),
        np.tile([0.0, 0.0, -1.0], (count, 1)),
        np.full(count, range_mm, np.uint16),
        limit,
        time_ns,
        np.arange(count, dtype=np.int32),
    )
