"""Voxels, each with the plane of its points, in a hash table; and points that keep a distance."""

from __future__ import annotations

from math import floor, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.matrices import diagonalize
from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array

EMPTY = -1
"""Key of a slot without a voxel."""

OFFSET = 1 << 20
"""Number added to the index of a voxel on each axis: 21 bits then hold it."""

SPREADING = -7046029254386353131
"""Multiplier of Fibonacci hashing, 2^64 divided by the golden ratio, as a signed number (Knuth, The
Art of Computer Programming, volume 3, section 6.4)."""

LEAST_POINTS = 6
"""Number of points from which a plane is fitted."""

MOST_POINTS = 60
"""Number of points after which a voxel stays as it is: the first ones had the least drift."""

FLATNESS = 0.03
"""Largest standard deviation of a plane's points from it, m."""

FLATTER = 9.0
"""Ratio of the middle to the least variance of the points from which they make a plane."""


class Voxels(NamedTuple):
    """Hash table of voxels by open addressing; slots without one have the key `EMPTY`.

    Attributes:
        keys: (m,) int64, m a power of 2.
        counts: (m,) number of points.
        means: (m, 3) world, m.
        squares: (m, 6) sums of products of deviations from the mean, xx xy xz yy yz zz, m^2.
        planes: (m, 4) unit normal to the side that its points were seen from, and 1 if they make a
            plane.
        sweeps: (m,) number of the sweep that they are by: the one that brought `LEAST_POINTS`, or
            the latest that doubled them.
        inverse: One by the edge of a voxel, 1/m.
    """

    keys: NDArray[np.int64]
    counts: NDArray[np.int64]
    means: Array
    squares: Array
    planes: Array
    sweeps: NDArray[np.int64]
    inverse: float


@kernel
def voxel_key(x: float, y: float, z: float, inverse: float) -> np.int64:
    """Return the key of the voxel of a point, of three indices in 21 bits each.

    The origin is in the middle of a voxel: floors and walls lie on round numbers. On a face between
    two voxels, noise would put the points of one surface into both, each with a plane of its own
    to its side, and a sweep would be held by these less than it seems.
    """
    i = np.int64(floor(x * inverse + 0.5)) + OFFSET
    j = np.int64(floor(y * inverse + 0.5)) + OFFSET
    k = np.int64(floor(z * inverse + 0.5)) + OFFSET
    return (i << 42) | (j << 21) | k


@kernel
def slot_of(keys: NDArray[np.int64], key: np.int64) -> np.int64:
    """Return the slot of a key, or the empty one where it would be."""
    mask = len(keys) - 1
    spread = key * np.int64(SPREADING)
    slot = (spread ^ (spread >> 32)) & mask
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@kernel
def add_points(points: Array, viewer: Array, voxels: Voxels, sweep: int) -> int:
    """Add points to the voxels that they lie in, and fit the planes of these again.

    Points seen from behind a plane are those of the other face of a thin wall, and left out.

    Args:
        points: (n, 3) world, m.
        viewer: (3,) from where they were seen, world, m.
        voxels: Map with at least n empty slots; written.
        sweep: Its number.

    Returns:
        Number of new voxels.
    """
    new = 0
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        key = voxel_key(x, y, z, voxels.inverse)
        slot = slot_of(voxels.keys, key)
        if voxels.keys[slot] == EMPTY:
            voxels.keys[slot] = key
            new += 1
        behind = voxels.planes[slot, 3] == 1.0 and not seen_from(voxels, slot, viewer)
        if voxels.counts[slot] < MOST_POINTS and not behind:
            add_point(voxels, int(slot), x, y, z, viewer)
            if is_doubled(voxels.counts[slot]):
                voxels.sweeps[slot] = sweep
    return new


@kernel
def is_doubled(count: int) -> bool:
    """Return whether a number of points is `LEAST_POINTS`, or that doubled once or more."""
    least = LEAST_POINTS
    while least < count:
        least *= 2
    return least == count


@allocating
def add_point(voxels: Voxels, slot: int, x: float, y: float, z: float, viewer: Array) -> None:
    """Update mean and products by one point (Welford 1962, Technometrics 4), and the plane."""
    count = voxels.counts[slot] + 1
    voxels.counts[slot] = count
    mean, squares = voxels.means[slot], voxels.squares[slot]
    dx, dy, dz = x - mean[0], y - mean[1], z - mean[2]
    mean[0] += dx / count
    mean[1] += dy / count
    mean[2] += dz / count
    ex, ey, ez = x - mean[0], y - mean[1], z - mean[2]
    squares[0] += dx * ex
    squares[1] += dx * ey
    squares[2] += dx * ez
    squares[3] += dy * ey
    squares[4] += dy * ez
    squares[5] += dz * ez
    if count >= LEAST_POINTS and (count < 2 * LEAST_POINTS or count % 8 == 0):
        fit_plane(squares, count, voxels.planes[slot])
        if not seen_from(voxels, np.int64(slot), viewer):
            voxels.planes[slot, :3] *= -1.0


@allocating
def fit_plane(squares: Array, count: int, plane: Array) -> None:
    """Write the direction of least variance into a plane (4,), and whether it is one."""
    matrix, vectors = np.empty((3, 3)), np.empty((3, 3))
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = squares[0], squares[3], squares[5]
    matrix[0, 1] = matrix[1, 0] = squares[1]
    matrix[0, 2] = matrix[2, 0] = squares[2]
    matrix[1, 2] = matrix[2, 1] = squares[4]
    matrix /= count
    diagonalize(matrix, vectors)
    least, most = 0, 0
    for axis in range(1, 3):
        if matrix[axis, axis] < matrix[least, least]:
            least = axis
        if matrix[axis, axis] > matrix[most, most]:
            most = axis
    small, large = matrix[least, least], matrix[most, most]
    middle = matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - small - large
    flat = small < FLATNESS * FLATNESS and middle > FLATTER * small + 1e-5
    for axis in range(3):
        plane[axis] = vectors[axis, least]
    plane[3] = 1.0 if flat else 0.0


@kernel
def seen_from(voxels: Voxels, slot: np.int64, viewer: Array) -> bool:
    """Return whether (3,) lies where a voxel's points were seen from, before its plane."""
    plane, mean = voxels.planes[slot], voxels.means[slot]
    x, y, z = viewer[0] - mean[0], viewer[1] - mean[1], viewer[2] - mean[2]
    return bool(plane[0] * x + plane[1] * y + plane[2] * z >= 0.0)


@kernel
def is_known(voxels: Voxels, slot: np.int64, viewer: Array) -> bool:
    """Return whether a voxel has points enough to say if a surface faces this side."""
    if voxels.keys[slot] == EMPTY or voxels.counts[slot] < LEAST_POINTS:
        return False
    return bool(voxels.planes[slot, 3] == 0.0 or seen_from(voxels, slot, viewer))


@kernel
def distance_from_plane(
    voxels: Voxels, slot: np.int64, x: float, y: float, z: float, viewer: Array
) -> float:
    """Return the signed distance of a point from the plane of a voxel, m.

    Infinite where it has none, or one that was seen from the other side: the two faces of a board,
    a wall or a shelf are a few centimetres apart, and the one is no evidence of the other.
    """
    plane = voxels.planes[slot]
    if voxels.keys[slot] == EMPTY or plane[3] == 0.0 or not seen_from(voxels, slot, viewer):
        return inf
    mean = voxels.means[slot]
    return float(plane[0] * (x - mean[0]) + plane[1] * (y - mean[1]) + plane[2] * (z - mean[2]))


@kernel
def spread_out(
    points: Array,
    spacing: float,
    keys: NDArray[np.int64],
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> int:
    """Choose each point in turn that no chosen one is near (dart throwing, Cook 1986, TOG 5).

    One point for each cell of a grid would be biased: where noise puts a few points of a wall into
    the next cell, these would count as much as all others.

    Args:
        points: (n, 3) m.
        spacing: Least distance between two chosen points, m.
        keys: (m,) scratch, m a power of 2 above n; written.
        heads: (m,) likewise.
        following: (n,) likewise.
        chosen: (n,) indices of the chosen points, in their order; written.

    Returns:
        Number of them.
    """
    keys[:] = EMPTY
    count, inverse = 0, 0.5 / spacing
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        key = voxel_key(x, y, z, inverse)
        i, j, k = beside(x, inverse) << 42, beside(y, inverse) << 21, beside(z, inverse)
        free = True
        for cell in range(8):  # as wide as two spacings: what is near lies in one of these
            other = key
            if cell & 1:
                other += i
            if cell & 2:
                other += j
            if cell & 4:
                other += k
            if is_near(points, index, spacing, other, keys, heads, following):
                free = False
                break
        if not free:
            continue
        slot = slot_of(keys, key)
        following[index] = EMPTY if keys[slot] == EMPTY else heads[slot]
        keys[slot], heads[slot] = key, index
        chosen[count] = index
        count += 1
    return count


@kernel
def beside(x: float, inverse: float) -> np.int64:
    """Step, 1 or -1, to the voxel that is nearer to a coordinate than the one on the other side."""
    place = x * inverse + 0.5
    return np.int64(1) if place - floor(place) >= 0.5 else np.int64(-1)


@kernel
def is_near(
    points: Array,
    index: int,
    spacing: float,
    key: np.int64,
    keys: NDArray[np.int64],
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
) -> bool:
    """Return whether a cell has a chosen point within `spacing` of a point; see `spread_out`."""
    slot = slot_of(keys, key)
    if keys[slot] == EMPTY:
        return False
    other = heads[slot]
    while other != EMPTY:
        dx = points[index, 0] - points[other, 0]
        dy = points[index, 1] - points[other, 1]
        dz = points[index, 2] - points[other, 2]
        if dx * dx + dy * dy + dz * dz < spacing * spacing:
            return True
        other = following[other]
    return False
