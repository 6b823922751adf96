"""The prior map that is made of the geometry of a world."""

from __future__ import annotations

import numpy as np

from wayproof.harness.prior.grid import Grid, States
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.models.worlds import World
from wayproof.models.worlds.solids import Solid

HALF_CELL = 0.49
"""Distance of a solid from the centre of a cell within which the cell is occupied, cells."""


def grid_of_world(world: World, resolution: float) -> Grid:
    """Return the states of the cells in the operating area of a world, without its movers.

    What is solid is occupied, and so is the layer of the floor; above it all else is free, and so
    is a hole in the floor. What lies below a floor is unknown.
    """
    window = Window.covering(world.low, world.high, resolution)
    states = np.full(window.shape, FREE, np.uint8)
    floor = FLOOR_LAYER - window.first[2]
    if floor >= 0:
        _lay_floor(states[:, :, : floor + 1], world, window)
    for solid in (*world.solids, *getattr(world, "terrain", ())):
        _fill(states, solid, window)
    return Grid(states, window.origin, resolution)


def _lay_floor(below: States, world: World, window: Window) -> None:
    """Set the layers (nx, ny, n) up to that of the floor: a plane, or slabs with holes."""
    if world.floor is None:
        below[:] = UNKNOWN
        below[:, :, -1] = OCCUPIED
        return
    nx, ny, _ = below.shape
    x, y = np.meshgrid(*((np.arange(n) + 0.5) * window.resolution for n in (nx, ny)), indexing="ij")
    points = window.origin + np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    points[:, 2] = 0.0
    borne = np.zeros(len(points), np.bool_)
    for slab in world.floor:
        borne |= slab.distance(points) <= HALF_CELL * window.resolution
    held = borne.reshape(nx, ny)
    below[held] = UNKNOWN
    below[held, -1] = OCCUPIED


def _fill(states: States, solid: Solid, window: Window) -> None:
    """Make the cells that a solid fills or cuts occupied."""
    size = window.resolution
    low = np.floor((np.array(solid.low) - window.origin) / size).astype(int) - 1
    end = np.ceil((np.array(solid.high) - window.origin) / size).astype(int) + 1
    low, end = np.clip(low, 0, window.shape), np.clip(end, 0, window.shape)
    if (low >= end).any():
        return
    cells = np.stack(np.meshgrid(*map(np.arange, low, end), indexing="ij"), axis=-1)
    centres = window.origin + (cells.reshape(-1, 3) + 0.5) * size
    inside = solid.distance(centres) <= HALF_CELL * size
    box = tuple(slice(a, b) for a, b in zip(low.tolist(), end.tolist(), strict=True))
    states[box][inside.reshape(cells.shape[:3])] = OCCUPIED
