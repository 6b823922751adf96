"""Search around a prediction for the pose that a scan agrees with best."""

from __future__ import annotations

from math import cos, floor, inf, isfinite, sin

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.alignment import NEAR
from wayproof.harness.estimators.voxels import (
    EMPTY,
    Voxels,
    distance_from_plane,
    slot_of,
    voxel_key,
)
from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array


@allocating
def search_start(
    offsets: Array,
    predicted: Array,
    shift: float,
    shifts: int,
    turn: float,
    turns: int,
    voxels: Voxels,
    off: int,
    least: int,
    start: Array,
) -> tuple[int, int]:
    """Find the shift and turn that the points agree with best (Olson 2009, ICRA).

    Of equals the one of fewer steps is taken, of these the first.

    Args:
        offsets: As of `align`.
        predicted: As of `align`.
        shift: Step of the shift along x and y, m.
        shifts: Number of steps to either side.
        turn: Step of the turn about the vertical, rad.
        turns: Number of steps to either side.
        voxels: The map.
        off: As of `score_of`.
        least: Score below which nothing is found.
        start: (3,) shift along x and y, m, and turn, rad; written where something is found.

    Returns:
        The best score, `least - 1` if nothing is found; and the number of candidates.
    """
    most, fewest, count = least - 1, 0, 0
    scores = np.empty((2 * shifts + 1, 2 * shifts + 1), np.int64)
    for k in range(-turns, turns + 1):
        score_shifts(offsets, predicted, k * turn, shift, voxels, off, scores)
        for i in range(-shifts, shifts + 1):
            for j in range(-shifts, shifts + 1):
                score, steps = scores[i + shifts, j + shifts], abs(i) + abs(j) + abs(k)
                if score > most or (score == most and score >= least and steps < fewest):
                    most, fewest = score, steps
                    start[0], start[1], start[2] = i * shift, j * shift, k * turn
                count += 1
    return most, count


@allocating
def score_shifts(
    offsets: Array,
    predicted: Array,
    turn: float,
    shift: float,
    voxels: Voxels,
    off: int,
    scores: NDArray[np.int64],
) -> None:
    """Compute the score, as of `score_of`, at every shift along x and y.

    A voxel is looked up once for all shifts that move a point into it; most hold no plane.

    Args:
        offsets: As of `align`.
        predicted: As of `align`.
        turn: Turn of the points about the vertical, rad.
        shift: Step of the shift, m.
        voxels: The map.
        off: As of `score_of`.
        scores: (n, n) by steps along x and y, n odd, no shift in the middle; written.
    """
    scores[:] = 0
    n, viewer, c, s = len(scores), predicted.copy(), cos(turn), sin(turn)
    inverse = voxels.inverse
    moved = (np.arange(n) - n // 2) * shift
    slots = np.empty(n, np.int64)
    for index in range(len(offsets)):
        ox, oy, z = offsets[index, 0], offsets[index, 1], predicted[2] + offsets[index, 2]
        ys, column, planar = predicted[1] + moved + s * ox + c * oy, inf, False
        for i in range(n):
            viewer[0] = predicted[0] + moved[i]
            x = viewer[0] + c * ox - s * oy
            if floor(x * inverse + 0.5) != column:
                column = floor(x * inverse + 0.5)
                planar = find_planes(x, ys, z, voxels, slots)
            if not planar:
                continue
            for j in range(n):
                if slots[j] >= 0:
                    viewer[1] = predicted[1] + moved[j]
                    distance = distance_from_plane(voxels, slots[j], x, ys[j], z, viewer)
                    scores[i, j] += worth(distance, off)


@kernel
def find_planes(x: float, ys: Array, z: float, voxels: Voxels, slots: NDArray[np.int64]) -> bool:
    """Find the slot of the voxel at each y (n,) m, -1 for one without a plane.

    Args:
        x: World, m.
        ys: World, m, in order.
        z: World, m.
        voxels: The map.
        slots: (n,); written.

    Returns:
        Whether any has a plane.
    """
    row, slot, planar, inverse = inf, np.int64(-1), False, voxels.inverse
    for j in range(len(ys)):
        if floor(ys[j] * inverse + 0.5) != row:
            row = floor(ys[j] * inverse + 0.5)
            slot = slot_of(voxels.keys, voxel_key(x, ys[j], z, inverse))
            if voxels.keys[slot] == EMPTY or voxels.planes[slot, 3] == 0.0:
                slot = np.int64(-1)
            if slot >= 0:
                planar = True
        slots[j] = slot
    return planar


@kernel
def score_of(offsets: Array, viewer: Array, c: float, s: float, voxels: Voxels, off: int) -> int:
    """Count the points that agree with a plane, less `off` times those that lie off one.

    Args:
        offsets: (n, 3) points from the base, m.
        viewer: (3,) position of the base, world, m.
        c: Cosine of the turn of the points about the vertical.
        s: Its sine.
        voxels: The map.
        off: Weight of a point that lies off the plane of its voxel.
    """
    score = 0
    for index in range(len(offsets)):
        ox, oy = offsets[index, 0], offsets[index, 1]
        x, y = viewer[0] + c * ox - s * oy, viewer[1] + s * ox + c * oy
        z = viewer[2] + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, voxels.inverse))
        score += worth(distance_from_plane(voxels, slot, x, y, z, viewer), off)
    return score


@kernel
def worth(distance: float, off: int) -> int:
    """Return a point's share of a score by its distance from a plane, m; infinite without one."""
    distance = abs(distance)
    if distance <= NEAR:
        return 1
    return -off if isfinite(distance) else 0
