"""What of a map makes a cell of a costmap block: the cell of a column, and what it is."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np

from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, unpack

BlockerState = Literal["occupied", "unknown", "floor not seen", "no floor", "class margin"]

STATES: tuple[BlockerState, ...] = get_args(BlockerState)
"""Of a cell that blocks: something stands there, it was not seen, no floor was seen there though
all above is free, there is no floor or it falls too steeply, or it is near an object of a class."""


class Blocker(NamedTuple):
    """A cell of the map.

    Attributes:
        centre: (x, y, z) m, world.
        state: What it is.
    """

    centre: tuple[float, float, float]
    state: BlockerState | Literal["outside"]


class Band(NamedTuple):
    """Layers of a window that a body meets in one column.

    Attributes:
        floor: Layer of the floor.
        first: Lowest that the body passes through.
        end: One past the highest.
    """

    floor: int
    first: int
    end: int


def blocker_in(
    voxel_map: ColumnMap, window: Window, x: int, y: int, band: Band, occupied: bool
) -> Blocker:
    """Return the lowest cell of a column for which it blocks.

    Args:
        voxel_map: Map of the costmap.
        window: Its window of it.
        x: Index of the column.
        y: The other one.
        band: Layers that the body meets there.
        occupied: Whether the column is blocked, not unknown.
    """
    layers = window.shape[2]
    low = window.first[0] + x, window.first[1] + y, window.first[2]
    shape = 1, 1, -(-layers // WORD_BITS)
    filled, free = (unpack(bits, layers)[0, 0] for bits in voxel_map.columns(low, shape))
    blocks = filled if occupied else (filled | free) == 0
    state: BlockerState = "occupied" if occupied else "unknown"
    met = np.flatnonzero(blocks[band.first : band.end])
    kept_out = voxel_map.keep_out(low, shape) if occupied and not len(met) else None
    if kept_out is not None:
        met = np.flatnonzero(unpack(kept_out, layers)[0, 0, band.first : band.end])
        state = "class margin"
    layer = band.first + int(met[0]) if len(met) else band.floor
    if not len(met):
        state = "no floor" if occupied else "floor not seen"
    at = window.origin + (np.array([x, y, layer]) + 0.5) * window.resolution
    return Blocker((float(at[0]), float(at[1]), float(at[2])), state)
