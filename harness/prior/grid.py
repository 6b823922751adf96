"""Grids of states in a frame of their own, and their sampling on the lattice of a map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.maps import OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window
from wayproof.maps.elementary import sines_cosines
from wayproof.maps.grid import FLOOR_LAYER

Array = NDArray[np.float64]
States = NDArray[np.uint8]


class Placement(NamedTuple):
    """Pose T_world_grid of a grid.

    Attributes:
        x: m.
        y: m.
        z: m.
        yaw: rad.
    """

    x: float
    y: float
    z: float
    yaw: float

    def after(self, first: Placement) -> Placement:
        """Return the placement of a grid that is placed by `first`, and then by this one."""
        c, s = _turn(self.yaw)
        return Placement(
            self.x + c * first.x - s * first.y,
            self.y + s * first.x + c * first.y,
            self.z + first.z,
            self.yaw + first.yaw,
        )


UNTURNED = Placement(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Grid:
    """States of cells.

    Attributes:
        states: (nx, ny, nz) unknown, free or occupied.
        origin: (3,) corner of the first cell in the frame of the grid, m.
        resolution: Edge of a cell, m.
        height: Of a flat map, nz = 1, the height of its walls above the floor, m: occupied cells
            stand on the floor and free ones are a floor with free space above it; None of a grid in
            space.
        placement: Pose of the grid's frame in the frame of its map.
    """

    states: States
    origin: Array
    resolution: float
    height: float | None = None
    placement: Placement = UNTURNED


def resampled(grid: Grid, placement: Placement, window: Window) -> States:
    """Return the states (nx, ny, nz) of the cells of a window.

    A cell is what the cell of the grid is that holds its centre; and it is occupied if the centre
    of an occupied one lies in it, so that nothing falls between the cells of a coarser map.
    """
    if grid.height is not None:
        return _extruded(grid, placement, window)
    states = np.empty(window.shape, np.uint8)
    _, ny, nz = window.shape
    size, corner = window.resolution, window.origin
    y, z = np.meshgrid(*((np.arange(n) + 0.5) * size for n in (ny, nz)), indexing="ij")
    plane = np.stack([np.zeros_like(y), y, z], axis=-1).reshape(-1, 3) + corner
    for i in range(window.shape[0]):  # a slice at a time: all centres at once take gigabytes
        plane[:, 0] = corner[0] + (i + 0.5) * size
        states[i] = _at(grid, _into_grid(plane, placement)).reshape(ny, nz)
    centres = _out_of_grid(_centres(grid, OCCUPIED), placement)
    cells = np.floor((centres - corner) / size).astype(np.int64)
    inside = ((cells >= 0) & (cells < window.shape)).all(axis=1)
    states[tuple(cells[inside].T)] = OCCUPIED
    return states


def _extruded(grid: Grid, placement: Placement, window: Window) -> States:
    """Return the states of a flat map's columns, from the floor to the height of its walls."""
    assert grid.height is not None
    (nx, ny, nz), size = window.shape, window.resolution
    flat = Window(size, (*window.first[:2], 0), (nx, ny, 1))
    middle = flat.origin[2] + 0.5 * size - 0.5 * grid.resolution  # the one layer is in its midst
    bare = Grid(grid.states, np.array([*grid.origin[:2], middle]), grid.resolution)
    states = resampled(bare, placement._replace(z=0.0), flat)[:, :, 0]
    floor = FLOOR_LAYER + round(placement.z / window.resolution) - window.first[2]
    top = floor + math.ceil(grid.height / window.resolution)
    columns = np.zeros(window.shape, np.uint8)
    above = slice(max(floor + 1, 0), max(min(top + 1, nz), 0))
    columns[:, :, above] = states[:, :, None]
    if 0 <= floor < nz:
        columns[:, :, floor] = np.where(states == UNKNOWN, UNKNOWN, OCCUPIED)
    return columns


def _turn(yaw: float) -> tuple[float, float]:
    """Return the cosine and sine of a yaw."""
    sines, cosines = sines_cosines(np.array([yaw]))
    return float(cosines[0]), float(sines[0])


def _at(grid: Grid, points: Array) -> States:
    """Return the states (n,) at points (n, 3) in the frame of the grid; unknown outside."""
    cells = np.floor((points - grid.origin) / grid.resolution).astype(np.int64)
    inside = ((cells >= 0) & (cells < grid.states.shape)).all(axis=1)
    states = np.full(len(points), UNKNOWN, np.uint8)
    states[inside] = grid.states[tuple(cells[inside].T)]
    return states


def _centres(grid: Grid, state: int) -> Array:
    centres: Array = grid.origin + (np.argwhere(grid.states == state) + 0.5) * grid.resolution
    return centres


def _into_grid(points: Array, placement: Placement) -> Array:
    """Return points (n, 3) of the world in the frame of a placed grid."""
    c, s = _turn(placement.yaw)
    x, y = points[:, 0] - placement.x, points[:, 1] - placement.y
    return np.stack([c * x + s * y, c * y - s * x, points[:, 2] - placement.z], axis=1)


def _out_of_grid(points: Array, placement: Placement) -> Array:
    """Return points (n, 3) of a placed grid in the world."""
    c, s = _turn(placement.yaw)
    x, y = points[:, 0], points[:, 1]
    return np.stack(
        [placement.x + c * x - s * y, placement.y + s * x + c * y, placement.z + points[:, 2]],
        axis=1,
    )
