"""Endpoints of the beams of a sweep as the kernels pack them, placed on all threads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import beams
from wayproof.maps.parallel import ThreadTeam
from wayproof.maps.sweep import Sweep
from wayproof.maps.voxel.frame import Cell, Frame, clipped

MAX_WINDOW_WORDS = 1 << 26
BEAM_US, END_US = 0.01, 0.008
"""About: to place a beam, to list an end."""


@dataclass(frozen=True)
class SweepEndpoints:
    """Endpoints of the beams of a sweep.

    Attributes:
        ends: Endpoints of informative beams as the kernels pack them; reused for each sweep.
        parts: [stripe][part] first and one past the last of those that are listed.
        counts: Beams by fate.
        box: Least and greatest cell of all beams within the bounds.
        frame: The bricks around that box.
    """

    ends: NDArray[np.int64]
    parts: list[list[tuple[int, int]]]
    counts: list[int]
    box: tuple[Cell, Cell]
    frame: Frame


class EndpointFinder:
    """Places the beams of sweeps, each thread a share of them; its memory is used again."""

    def __init__(self, team: ThreadTeam, bounds: NDArray[np.int64] | None) -> None:
        """Start without memory.

        Args:
            team: Threads that share the work.
            bounds: (2, 3) least and greatest cell that may be marked; None for no bounds.
        """
        self._team, self._bounds = team, bounds
        self._ends = np.empty(0, np.int64)

    def find(self, sweep: Sweep) -> SweepEndpoints:
        """Find the endpoints of a sweep.

        Raises:
            ValueError: A direction is not of unit length, or the beams span too much space.
        """
        count, size = len(sweep.ranges_mm), self._team.size
        stripes = 2 if self._team.worth_sharing(count, END_US) else 1  # even and odd ones, or all
        each = -(-count // size)
        boxes, counts = np.empty((size, 2, 3), np.int64), np.zeros((size, 4), np.int64)
        listed = np.empty((size, stripes), np.int64)
        self._place(sweep, each, boxes, counts, listed)
        lows, highs = zip(*boxes.tolist(), strict=True)
        # The first one twice: there may be no other.
        low = clipped(map(min, *lows, lows[0]), self._bounds)
        high = clipped(map(max, *highs, highs[0]), self._bounds)
        fates = [sum(fate) for fate in zip(*counts.tolist(), strict=True)]
        return SweepEndpoints(
            ends=self._ends,
            parts=_parts(listed.tolist(), each),
            counts=fates,
            box=(low, high),
            frame=_frame_of_beams(low, high),
        )

    def _place(
        self,
        sweep: Sweep,
        each: int,
        boxes: NDArray[np.int64],
        counts: NDArray[np.int64],
        listed: NDArray[np.int64],
    ) -> None:
        """Place the beams, `each` by one thread, and write what each thread found.

        Args:
            sweep: The beams.
            each: Number of beams of a thread.
            boxes: (threads, 2, 3) least and greatest cell; written.
            counts: (threads, 4) beams by fate; added to.
            listed: (threads, stripes) number of ends in each stripe; written.

        Raises:
            ValueError: A direction is not of unit length.
        """
        size, stripes = listed.shape
        if len(self._ends) < size * stripes * each:
            self._ends = np.empty(size * stripes * each, np.int64)
        ends = self._ends[: size * stripes * each].reshape(size, stripes * each)
        sweep_beams = beams.SweepBeams(
            sweep.origins,
            sweep.sensors,
            sweep.groups,
            sweep.directions.reshape(-1),
            sweep.ranges_mm,
            sweep.limits_mm,
            sweep.resolution,
        )
        whole = [True] * size

        def work(_: int, some: tuple[int, int]) -> None:
            for k in range(*some):
                whole[k] = beams.place_ends(
                    sweep_beams,
                    (each * k, each * (k + 1)),
                    beams.EndLists(ends[k], listed[k], boxes[k], counts[k]),
                    np.empty((4, beams.CHUNK), np.int64),
                    np.empty(beams.CHUNK, np.int64),
                )

        self._team.parallel_for(work, size, 1, BEAM_US * len(sweep.ranges_mm) / size)
        if not all(whole):
            squared = np.square(sweep.directions).sum(axis=1)
            strange = ~(np.abs(squared - 1.0) < beams.UNIT_TOLERANCE)  # also NaN
            raise ValueError(
                f"directions: got {sweep.directions[strange][0]}, expected unit length"
            )


def _parts(listed: list[list[int]], each: int) -> list[list[tuple[int, int]]]:
    """Return [stripe][part] first and one past the last of the ends that each thread listed.

    Args:
        listed: [thread][stripe] end of the ends of a stripe, from where the thread's begin.
        each: Number of beams of a thread.
    """
    stripes = len(listed[0])
    parts: list[list[tuple[int, int]]] = [[] for _ in range(stripes)]
    for worker, until in enumerate(listed):
        begin = each * stripes * worker
        for stripe, end in enumerate(until):
            parts[stripe].append((begin + each * stripe, begin + end))
    return parts


def _frame_of_beams(low: Cell, high: Cell) -> Frame:
    """Return the frame of the cells of beams.

    Raises:
        ValueError: The beams span too much space.
    """
    frame = Frame.around(low, high)
    words = math.prod(frame.shape)
    if words > MAX_WINDOW_WORDS:
        raise ValueError(
            f"beams: got {64 * words} cells around them, expected at most {64 * MAX_WINDOW_WORDS}: "
            "a shorter range or coarser cells"
        )
    return frame
