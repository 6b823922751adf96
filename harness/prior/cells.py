"""Cells of a prior map: as bytes in a config, and as a layer under the measured map."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np
import zstandard
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.mission import Mission
from wayproof.harness.prior.grid import UNTURNED, Grid, resampled
from wayproof.harness.prior_config import NO_PRIOR
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import MAX_CELLS, Window
from wayproof.maps.grid import cells_at
from wayproof.maps.overlay import CellLayer

HEAD = struct.Struct("<8sd3q3q")  # magic, edge of a cell, least cell, shape
MAGIC = b"wpprior1"

FARTHEST = 2**40
"""Greatest index of a cell along an axis."""

LEVEL = 9
"""Level of zstd."""


@dataclass(frozen=True)
class PriorCells:
    """States of a box of cells on the lattice of maps.

    Attributes:
        resolution: Edge of a cell, m.
        first: Least cell.
        states: (nx, ny, nz) uint8: unknown, free or occupied.
    """

    resolution: float
    first: tuple[int, int, int]
    states: NDArray[np.uint8]

    @property
    def window(self) -> Window:
        """The box as a window of a map."""
        nx, ny, nz = self.states.shape
        return Window(self.resolution, self.first, (nx, ny, nz))

    def states_at(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the states at points (n, 3), m, world: (n,); unknown outside the box."""
        cells = cells_at(points, self.resolution)[0] - self.first
        inside = ((cells >= 0) & (cells < self.states.shape)).all(axis=1)
        found = np.full(len(cells), UNKNOWN, np.uint8)
        found[inside] = self.states[tuple(cells[inside].T)]
        return found

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells."""
        return {
            "free": int(np.count_nonzero(self.states == FREE)),
            "occupied": int(np.count_nonzero(self.states == OCCUPIED)),
        }


def packed(cells: PriorCells) -> bytes:
    """Return the cells as bytes: equal cells give equal bytes."""
    bits = [np.packbits(cells.states == state).tobytes() for state in (OCCUPIED, FREE)]
    head = HEAD.pack(MAGIC, cells.resolution, *cells.first, *cells.states.shape)
    return head + zstandard.compress(b"".join(bits), LEVEL)


def unpacked(data: bytes) -> PriorCells:
    """Return the cells of bytes of unknown origin.

    Raises:
        ValueError: They are none.
    """
    if len(data) < HEAD.size or not data.startswith(MAGIC):
        raise ValueError("prior_map: expected the cells of a prior map")
    _, resolution, *numbers = HEAD.unpack_from(data)
    first, shape = numbers[:3], numbers[3:]
    if not 0.01 <= resolution <= 0.5:
        raise ValueError(f"prior_map: cells of {resolution:g} m, expected 0.01 to 0.5 m")
    if min(shape) < 1 or math.prod(shape) > MAX_CELLS or max(map(abs, first)) > FARTHEST:
        raise ValueError(f"prior_map: {shape} cells from {first} on, expected at most {MAX_CELLS}")
    count = math.prod(shape)
    size = -(-count // 8)
    try:
        if zstandard.get_frame_parameters(data[HEAD.size :]).content_size != 2 * size:
            raise ValueError(f"prior_map: not the states of {shape} cells")
        bits = zstandard.ZstdDecompressor().decompress(data[HEAD.size :])
    except zstandard.ZstdError as error:
        raise ValueError(f"prior_map: {error}") from None
    occupied, free = (
        np.unpackbits(np.frombuffer(half, np.uint8), count=count)
        for half in (bits[:size], bits[size:])
    )
    states = np.where(occupied, np.uint8(OCCUPIED), free * np.uint8(FREE)).astype(np.uint8)
    x, y, z = first
    return PriorCells(resolution, (x, y, z), states.reshape(shape))


def logged_cells(config: Config) -> PriorCells | None:
    """Return the cells of the prior map in the config of a log; None if there are none.

    Raises:
        InputError: They are none.
    """
    if not config.prior_map:
        return None
    try:
        return unpacked(config.prior_map)
    except ValueError as error:
        raise InputError(f"config: {error}") from None


def prior_layer(config: Config, mission: Mission) -> CellLayer | None:
    """Return the prior map of a config as a layer of the operating area; None without one.

    The cells in the config are those of the map that it was recorded with; for another resolution
    they are sampled.

    Raises:
        ValueError: The config has no cells for its source, or they are none.
    """
    prior = config.prior
    if prior.source == NO_PRIOR or prior.policy == "ignore":
        return None
    if not config.prior_map:
        raise ValueError(f"prior.source: got '{prior.source}' where no prior map is read")
    window = Window.covering(mission.low, mission.high, config.map.resolution)
    cells = unpacked(config.prior_map)
    layer = CellLayer(window)
    if cells.resolution != window.resolution:
        grid = Grid(cells.states, cells.window.origin, cells.resolution)
        layer.put(window.first, resampled(grid, UNTURNED, window))
        return layer
    low = np.maximum(cells.first, window.first)
    end = np.minimum(np.add(cells.first, cells.states.shape), np.add(window.first, window.shape))
    if (low < end).all():
        inner = tuple(
            slice(a, b) for a, b in zip(low - cells.first, end - cells.first, strict=True)
        )
        x, y, z = low.tolist()
        layer.put((x, y, z), cells.states[inner])
    return layer
