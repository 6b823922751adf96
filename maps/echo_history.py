"""Echoes by direction over the sweeps of a sensor.

A sensor that loses echoes in a part of its view, another one in each sweep, reports no return where
there is a wall. Its own sweeps show it: what lies in a direction does not come and go.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import echo_history as kernels
from wayproof.maps.kernels.beams import NO_RETURN_MM
from wayproof.maps.kernels.echo_history import DIRECTIONS
from wayproof.maps.representation import Representation
from wayproof.maps.states import OCCUPIED
from wayproof.maps.sweep import Ranges

SILENT_SWEEPS = 10
"""Sweeps in a row without an echo after which nothing is there, 1 s at 10 Hz: of echoes of which
60 % are lost again in each sweep, one direction loses so many once in 165 times."""

MOST_RETURNED = 5
"""Percentage of the beams of a sweep that may have an echo again after fewer silent sweeps. In
clean sweeps of five built-in worlds at most 3.4 of a lidar did, at edges, and 11 of a depth
camera."""

MOST_CONTRADICTED = 6
"""Percentage of the beams of a sweep that may have fallen silent across occupied cells: at most 3
of a lidar, 9 of a depth camera and 29 of one that people walked past. More of
both had 6 of 5,146 clean sweeps of eight built-in worlds."""

SAMPLE = 128
"""Greatest number of beams that are compared with the map."""

MOST_BEAMS = 1 << 15
"""Greatest number of beams of a sweep that are looked at, at equal steps."""


class EchoHistory:
    """Sweeps without an echo by direction, in the world frame.

    Attributes:
        silent_sweeps: (DIRECTIONS,) uint8 sweeps in a row without an echo, up to `SILENT_SWEEPS`.
        steady_sweeps: Sweeps since echoes last came and went, up to `SILENT_SWEEPS`.
    """

    def __init__(self) -> None:
        """Start before the first sweep."""
        self.silent_sweeps = np.zeros(DIRECTIONS, np.uint8)
        self.steady_sweeps = SILENT_SWEEPS

    def __eq__(self, other: object) -> bool:
        """Return whether another history holds the same."""
        return (
            isinstance(other, EchoHistory)
            and self.steady_sweeps == other.steady_sweeps
            and np.array_equal(self.silent_sweeps, other.silent_sweeps)
        )

    @property
    def loses_echoes(self) -> bool:
        """Whether echoes came back within `SILENT_SWEEPS` sweeps in one of as many sweeps."""
        return self.steady_sweeps < SILENT_SWEEPS

    def take_in(self, directions: NDArray[np.float64], ranges_mm: Ranges) -> int:
        """Take in the next sweep; return about how many of its beams `recently_silent` finds.

        Args:
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) mm.
        """
        step = max(1, -(-len(ranges_mm) // MOST_BEAMS))  # a recorded sweep may be empty
        recent, returned = kernels.note_echoes(
            directions,
            ranges_mm,
            step,
            SILENT_SWEEPS,
            beams=np.empty(DIRECTIONS, np.int64),
            silent_sweeps=self.silent_sweeps,
        )
        if 100 * step * returned > MOST_RETURNED * len(ranges_mm):
            self.steady_sweeps = 0
        elif self.steady_sweeps < SILENT_SWEEPS:
            self.steady_sweeps += 1
        return step * recent

    def recently_silent(
        self, directions: NDArray[np.float64], ranges_mm: Ranges
    ) -> NDArray[np.bool_]:
        """Find the beams without return whose direction had an echo in the last `SILENT_SWEEPS`.

        Or was looked at in fewer so far.

        Args:
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) mm, of the sweep that was taken in last.

        Returns:
            (n,) whether each is one.
        """
        recent = np.empty(len(ranges_mm), np.bool_)
        kernels.find_recent(directions, ranges_mm, SILENT_SWEEPS, self.silent_sweeps, recent)
        return recent

    def restore(self, silent_sweeps: NDArray[np.uint8], steady_sweeps: int) -> None:
        """Take over another history.

        Args:
            silent_sweeps: (DIRECTIONS,).
            steady_sweeps: Sweeps.

        Raises:
            ValueError: They are of another shape, or above `SILENT_SWEEPS`.
        """
        if silent_sweeps.shape != (DIRECTIONS,):
            raise ValueError(f"{silent_sweeps.shape} directions, expected {(DIRECTIONS,)}")
        if (most := max(int(silent_sweeps.max()), steady_sweeps)) > SILENT_SWEEPS:
            raise ValueError(f"{most} silent or steady sweeps, expected up to {SILENT_SWEEPS}")
        self.silent_sweeps, self.steady_sweeps = silent_sweeps.copy(), steady_sweeps


def are_contradicted(
    voxel_map: Representation,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    range_limit: float,
    beams: int,
) -> bool:
    """Return whether the map contradicts beams without return: too many cross occupied cells.

    Args:
        voxel_map: Map of the sweeps before.
        origins: (k, 3) where each begins, m.
        directions: (k, 3) unit vectors.
        range_limit: Range up to which it clears, m.
        beams: Number of all beams of the sweep.
    """
    step = -(-len(origins) // SAMPLE)
    starts, along = origins[::step], directions[::step]
    distances = np.arange(voxel_map.resolution, range_limit, voxel_map.resolution)
    points = starts[:, None] + along[:, None] * distances[:, None]
    states = voxel_map.state_at(points.reshape(-1, 3)).reshape(points.shape[:2])
    across = int(np.count_nonzero((states == OCCUPIED).any(axis=1)))
    return 100 * across * len(origins) > MOST_CONTRADICTED * beams * len(starts)


def warm_up() -> None:
    """Compile the kernels for a sweep of 16 bits."""
    history, directions = EchoHistory(), np.array([[1.0, 0.0, 0.0]])
    ranges_mm = np.array([NO_RETURN_MM], np.uint16)
    history.take_in(directions, ranges_mm)
    history.recently_silent(directions, ranges_mm)
