"""Kernel of echoes by direction over sweeps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined, kernel
from wayproof.maps.kernels.beams import DROPPED_MM, NO_RETURN_MM

ACROSS = 16
"""Directions along each edge of a cube about the sensor."""

DIRECTIONS = 6 * ACROSS * ACROSS

ECHO_BITS = 32
ECHO = 1 << ECHO_BITS
"""More than the beams of a sweep."""


@inlined
def _within_edge(place: float) -> int:
    """Round a place along an edge down, into it: 0 of NaN too, as the map checks beams later."""
    if place >= ACROSS - 1:
        return ACROSS - 1
    return int(place) if place > 0.0 else 0


@inlined
def direction_index(x: float, y: float, z: float) -> int:
    """Return the index of the square of a cube about the sensor that a beam leaves by."""
    along_x, along_y, along_z = abs(x), abs(y), abs(z)
    if along_x >= along_y and along_x >= along_z:
        face, depth, u, v = 0 if x > 0.0 else 1, along_x, y, z
    elif along_y >= along_z:
        face, depth, u, v = 2 if y > 0.0 else 3, along_y, z, x
    else:
        face, depth, u, v = 4 if z > 0.0 else 5, along_z, x, y
    scale = 0.5 * ACROSS / depth
    row = _within_edge(u * scale + 0.5 * ACROSS)
    column = _within_edge(v * scale + 0.5 * ACROSS)
    return (face * ACROSS + row) * ACROSS + column


@kernel
def note_echoes(
    directions: NDArray[np.float64],  # (n, 3) unit vectors
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    step: int,  # from one beam that is looked at to the next
    most_sweeps: int,
    beams: NDArray[np.int64],  # (DIRECTIONS,) out: silent ones of each, and ECHO added for others
    silent_sweeps: NDArray[np.uint8],  # (DIRECTIONS,) in, out: in a row, up to `most_sweeps`
) -> tuple[int, int]:
    """Take in the echoes of a sweep.

    Returns:
        How many of these beams `find_recent` finds, and how many came back after fewer silent
        sweeps than `most_sweeps`.
    """
    for k in range(DIRECTIONS):
        beams[k] = 0
    for i in range(0, ranges_mm.shape[0], step):
        k = direction_index(directions[i, 0], directions[i, 1], directions[i, 2])
        if ranges_mm[i] == NO_RETURN_MM:
            beams[k] += 1
        elif ranges_mm[i] != DROPPED_MM:
            beams[k] += ECHO
    recent = returned = int(np.int64(0))
    for k in range(DIRECTIONS):
        silent, echoes = beams[k] & (ECHO - 1), beams[k] >> ECHO_BITS
        if echoes > 0:
            if 0 < silent_sweeps[k] < most_sweeps:
                returned += echoes
            silent_sweeps[k] = 0
        elif silent > 0 and silent_sweeps[k] < most_sweeps:
            silent_sweeps[k] += 1
        if silent_sweeps[k] < most_sweeps:
            recent += silent
    return recent, returned


@kernel
def find_recent(
    directions: NDArray[np.float64],  # (n, 3) unit vectors
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    most_sweeps: int,
    silent_sweeps: NDArray[np.uint8],  # (DIRECTIONS,)
    recent: NDArray[np.bool_],  # (n,) out
) -> None:
    """Find the beams without return in directions that were not silent for `most_sweeps` sweeps."""
    for i in range(ranges_mm.shape[0]):
        recent[i] = False
        if ranges_mm[i] == NO_RETURN_MM:
            k = direction_index(directions[i, 0], directions[i, 1], directions[i, 2])
            recent[i] = silent_sweeps[k] < most_sweeps
