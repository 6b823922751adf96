"""States of the columns of cells that a body walks over where it climbs, by simple code.

The definition is that of `maps.costmap.terrain.Terrain`; nothing is shared with it, so that the
audit is independent of what it checks.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, states_in
from wayproof.maps.columns import WORD_BITS, ColumnMap

Layers = NDArray[np.int64]
Mask = NDArray[np.bool_]

T = TypeVar("T", bound=np.generic)

BASELINE = 8
"""Distance over which a slope is measured, cells."""

NOWHERE = -1
"""Layer of a column without ground."""

ROUNDING = 1e-6
"""Part of a cell by which rounding may miss a whole number."""

AXES = ((1, 0), (-1, 0), (0, 1), (0, -1))
DIAGONALS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


class SlopingColumns(NamedTuple):
    """Columns over the whole operating area.

    Attributes:
        states: (nx, ny).
        first: (2,) index of the first column among those of all space.
    """

    states: NDArray[np.uint8]
    first: Layers

    def within(self, first: Layers, end: Layers) -> NDArray[np.uint8]:
        """Return the states (mx, my) from one index (2,) up to another; unknown outside."""
        found = np.full(end - first, UNKNOWN, np.uint8)
        low = np.maximum(first, self.first)
        high = np.minimum(end, self.first + self.states.shape)
        if (low < high).all():
            there = tuple(slice(a, b) for a, b in zip(low - first, high - first, strict=True))
            here = tuple(
                slice(a, b) for a, b in zip(low - self.first, high - self.first, strict=True)
            )
            found[there] = self.states[here]
        return found


def sloping_columns(
    voxel_map: ColumnMap, config: Config, mission: Mission, feet: tuple[float, ...] | None
) -> SlopingColumns:
    """Find the ground from the floor z = 0 and from the feet, and what stands on it or is a hole.

    Args:
        voxel_map: Map of the decision.
        config: Settings.
        mission: Body and operating area.
        feet: (3,) on the ground below the centre of the body, m; None for logs of before they
            counted.
    """
    size = voxel_map.resolution
    shift = np.array([0.0, 0.0, 0.75])
    first = np.floor(np.array(mission.low) / size + shift + ROUNDING).astype(np.int64)
    end = np.ceil(np.array(mission.high) / size + shift - ROUNDING).astype(np.int64)
    end[2] = first[2] + -(-(end[2] - first[2]) // WORD_BITS) * WORD_BITS
    states = states_in(
        voxel_map, (first - shift + 0.25) * size, (end - shift - 0.25) * size
    )  # (nx, ny, nz)
    foot = math.floor(mission.step_height / size + 0.75 + ROUNDING)
    tall = math.ceil(mission.height / size + 0.75 - ROUNDING)
    slope, step = math.tan(config.costmap.max_slope), mission.step_height / size
    limits = [
        [
            math.ceil(max(step + slope * across * d, slope * across * (d + 1)) - ROUNDING)
            for d in range(BASELINE + 1)
        ]
        for across in (1.0, math.sqrt(2.0))
    ]
    surfaces = _surfaces(states, foot, tall)
    ground = np.where(surfaces[:, :, -first[2]], -first[2], NOWHERE)
    if feet is not None:
        at = np.floor(np.array(feet) / size + shift).astype(np.int64) - first
        _stand(ground, surfaces, at, limits[1])
    _spread(ground, surfaces, limits[0][1])
    seen = ground != NOWHERE
    _spread(ground, None, 0)
    ground[ground == NOWHERE] = -first[2]
    blocked = _steep(ground, seen, limits) & seen
    layers = np.arange(states.shape[2])
    above = layers - ground[:, :, None]
    fall = np.where(seen | (feet is None), 0, limits[0][BASELINE])[:, :, None]
    holes = ((states == FREE) & (above < -fall)).any(axis=2)
    blocked |= holes & ~(seen & (ground != -first[2]))
    band = (above >= foot) & (above < tall)
    blocked |= ((states == OCCUPIED) & band).any(axis=2)
    standing = ((states == OCCUPIED) & (above >= 0) & (above < foot)).any(axis=2)
    fits = ground + tall <= states.shape[2]
    passable = standing & fits & ((states == FREE) | ~band).all(axis=2)
    found = np.where(blocked, OCCUPIED, np.where(passable, FREE, UNKNOWN)).astype(np.uint8)
    return SlopingColumns(found, first[:2])


def _surfaces(states: NDArray[np.uint8], foot: int, tall: int) -> Mask:
    """Return which cells (nx, ny, nz) a body can stand on."""
    occupied = states == OCCUPIED
    met = np.zeros_like(occupied)
    for rise in range(foot, tall):
        met[:, :, : max(occupied.shape[2] - rise, 0)] |= occupied[:, :, rise:]
    return np.asarray(occupied & ~met)


def _stand(ground: Layers, surfaces: Mask, feet: Layers, rises: list[int]) -> None:
    """Let the lowest surfaces about the feet be ground (nx, ny), where there is none yet."""
    from_x, from_y = (max(int(one) - BASELINE, 0) for one in feet[:2])
    to_x, to_y = (max(int(one) + BASELINE + 1, 0) for one in feet[:2])
    for i, j in np.argwhere(ground[from_x:to_x, from_y:to_y] == NOWHERE):
        x, y = i + from_x, j + from_y
        away = max(abs(x - feet[0]), abs(y - feet[1]))
        low, high = max(feet[2] - rises[away], 0), max(feet[2] + rises[away] + 1, 0)
        found = np.flatnonzero(surfaces[x, y, low:high])
        if len(found):
            ground[x, y] = low + found[0]


def _spread(ground: Layers, surfaces: Mask | None, rise: int) -> None:
    """Let the ground (nx, ny) spread to its neighbours, round by round, until nothing changes.

    Args:
        ground: Layers, changed in place; NOWHERE where there is none yet.
        surfaces: (nx, ny, nz) cells it may spread to; None: to each column, at the same layer.
        rise: Greatest difference of layers to a neighbour.
    """
    while True:
        coming = np.full(ground.shape, np.iinfo(np.int64).max)
        for x, y in AXES:
            near = _shifted(ground, x, y, NOWHERE)
            i, j = np.nonzero((ground == NOWHERE) & (near != NOWHERE))
            if not len(i):
                continue
            for offset in range(rise, -rise - 1, -1):  # the lowest is written last
                layer = near[i, j] + offset
                fits = np.ones(len(layer), np.bool_)
                if surfaces is not None:
                    fits = (layer >= 0) & (layer < surfaces.shape[2])
                    fits &= surfaces[i, j, np.clip(layer, 0, surfaces.shape[2] - 1)]
                coming[i[fits], j[fits]] = np.minimum(coming[i[fits], j[fits]], layer[fits])
        reached = coming < np.iinfo(np.int64).max
        if not reached.any():
            return
        ground[reached] = coming[reached]


def _steep(ground: Layers, seen: Mask, limits: list[list[int]]) -> Mask:
    """Return where the ground (nx, ny) falls by more than a ramp does, any way."""
    steep = np.zeros(ground.shape, np.bool_)
    for steps, limit in ((AXES, limits[0]), (DIAGONALS, limits[1])):
        for x, y in steps:
            going, before = seen.copy(), ground
            for distance in range(1, BASELINE + 1):
                there = _shifted(ground, distance * x, distance * y, 0)
                going &= _shifted(seen, distance * x, distance * y, False)
                steep |= going & (ground - there > limit[distance])
                going &= np.abs(there - before) <= limit[1]
                before = there
    return steep


def _shifted(values: NDArray[T], x: int, y: int, outside: int) -> NDArray[T]:
    """Return the values (nx, ny) at an offset of each place; `outside` beyond the edge."""
    nx, ny = values.shape
    shifted = np.full_like(values, outside)
    to = slice(max(-x, 0), max(min(nx, nx - x), 0)), slice(max(-y, 0), max(min(ny, ny - y), 0))
    by = slice(max(x, 0), max(min(nx, nx + x), 0)), slice(max(y, 0), max(min(ny, ny + y), 0))
    shifted[to] = values[by]
    return shifted
