"""Kernels of lidar odometry: planes in a hash of voxels, and the alignment of a sweep with them."""

from __future__ import annotations

from math import cos, floor, inf, isfinite, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
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

LEAST_INLIERS = 20
"""Number of points below which a sweep is not registered."""

ITERATIONS = 10
COARSE = 3
"""Number of the first iterations, in which the gate is twice as wide."""

GATE = 0.15
"""Largest distance of a point from its plane, m."""

NEAR = 2.0 * FLATNESS
"""Distance from its plane up to which a point agrees with it, m: points that are scattered over a
voxel lie within the gate of any plane through it."""

SCALE = 0.02
"""Scale of the Cauchy weight of that distance, m."""

CONVERGED = 1e-5
"""Step of the pose, m and rad, below which the iteration ends."""

FIXED = 1e3
"""Weight, in all points, with which the prediction stays along a direction that is not held."""


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
    """

    keys: NDArray[np.int64]
    counts: NDArray[np.int64]
    means: Array
    squares: Array
    planes: Array
    sweeps: NDArray[np.int64]


@kernel
def voxel_key(x: float, y: float, z: float, inverse: float) -> np.int64:
    """Key of the voxel of a point, of three indices in 21 bits each.

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
    """Slot of a key, or the empty one where it would be."""
    mask = len(keys) - 1
    spread = key * np.int64(SPREADING)
    slot = (spread ^ (spread >> 32)) & mask
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


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
    """Whether a cell has a chosen point nearer than `spacing` to a point; see `spread_out`."""
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


@kernel
def add_points(points: Array, viewer: Array, inverse: float, voxels: Voxels, sweep: int) -> int:
    """Add points to the voxels that they lie in, and fit the planes of these again.

    Points seen from behind a plane are those of the other face of a thin wall, and left out.

    Args:
        points: (n, 3) world, m.
        viewer: (3,) from where they were seen, world, m.
        inverse: One by the edge of a voxel, 1/m.
        voxels: With at least n empty slots; written.
        sweep: Its number.

    Returns:
        Number of new voxels.
    """
    new = 0
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        key = voxel_key(x, y, z, inverse)
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
    """Whether a number of points is `LEAST_POINTS`, or that doubled once or more."""
    least = LEAST_POINTS
    while least < count:
        least *= 2
    return least == count


@kernel
def seen_from(voxels: Voxels, slot: np.int64, viewer: Array) -> bool:
    """Whether a position (3,) lies where a voxel's points were seen from, before its plane."""
    plane, mean = voxels.planes[slot], voxels.means[slot]
    x, y, z = viewer[0] - mean[0], viewer[1] - mean[1], viewer[2] - mean[2]
    return bool(plane[0] * x + plane[1] * y + plane[2] * z >= 0.0)


@kernel
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


@kernel
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
def diagonalize(matrix: Array, vectors: Array) -> None:
    """Diagonalize a symmetric matrix (3, 3) in place; its eigenvectors are the columns (3, 3).

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 4th edition, section 8.5).
    """
    for row in range(3):
        for column in range(3):
            vectors[row, column] = 1.0 if row == column else 0.0
    for _ in range(12):
        off = matrix[0, 1] ** 2 + matrix[0, 2] ** 2 + matrix[1, 2] ** 2
        if off < 1e-30:
            return
        for p in range(2):
            for q in range(p + 1, 3):
                if matrix[p, q] != 0.0:
                    rotate_away(matrix, vectors, p, q)


@kernel
def rotate_away(matrix: Array, vectors: Array, p: int, q: int) -> None:
    """Rotate in the plane of two axes so that their product vanishes."""
    slope = 0.5 * (matrix[q, q] - matrix[p, p]) / matrix[p, q]
    sign = 1.0 if slope >= 0.0 else -1.0
    t = sign / (abs(slope) + sqrt(slope * slope + 1.0))
    c = 1.0 / sqrt(t * t + 1.0)
    s = t * c
    for row in range(3):
        x, y = matrix[row, p], matrix[row, q]
        matrix[row, p], matrix[row, q] = c * x - s * y, s * x + c * y
    for column in range(3):
        x, y = matrix[p, column], matrix[q, column]
        matrix[p, column], matrix[q, column] = c * x - s * y, s * x + c * y
    for row in range(3):
        x, y = vectors[row, p], vectors[row, q]
        vectors[row, p], vectors[row, q] = c * x - s * y, s * x + c * y


@kernel
def align(
    offsets: Array,
    predicted: Array,
    inverse: float,
    held: float,
    prior: Array,
    voxels: Voxels,
    correction: Array,
    information: Array,
    axes: Array,
) -> tuple[int, int, int]:
    """Align a sweep with the planes of the map, by Gauss-Newton on the distances from them.

    Args:
        offsets: (n, 3) points from the predicted position of the base, world axes, m.
        predicted: (3,) that position, m.
        inverse: One by the edge of a voxel, 1/m.
        held: Least information of a direction that the scene holds.
        prior: (4, 4) by which the prediction counts, in terms of the mean of g g' over the points,
            g the gradient of the distance by the pose.
        voxels: The map.
        correction: (4,) shift, m, and turn about the vertical through the base, rad; written.
        information: (3,) eigenvalues of the mean of n n'; written.
        axes: (3, 3) their directions, in columns; written.

    Returns:
        Number of points within the gate of a plane, of those that agree with it, and of points in
        known voxels. With less than `LEAST_INLIERS` of the first there is no correction.
    """
    correction[:] = 0.0
    information[:] = 0.0
    diagonalize(np.zeros((3, 3)), axes)
    equations, right, moment = np.empty((4, 4)), np.empty(4), np.empty((3, 3))
    inliers, near, known = 0, 0, 0
    for iteration in range(ITERATIONS):
        gate = 2.0 * GATE if iteration < COARSE else GATE
        inliers, near, known, weight = sum_up(
            offsets, predicted, correction, inverse, gate, voxels, equations, right, moment
        )
        if inliers < LEAST_INLIERS:
            correction[:] = 0.0
            information[:] = 0.0
            diagonalize(np.zeros((3, 3)), axes)
            return inliers, near, known
        diagonalize(moment, axes)
        for axis in range(3):
            information[axis] = moment[axis, axis]
            if information[axis] < held:
                hold_to_prediction(equations, right, correction, axes[:, axis], FIXED * weight)
        for i in range(4):
            for j in range(4):
                equations[i, j] += prior[i, j] * weight
                right[i] -= prior[i, j] * weight * correction[j]
        solve(equations, right)
        largest = 0.0
        for row in range(4):
            correction[row] += right[row]
            largest = max(largest, abs(right[row]))
        if largest < CONVERGED:
            break
    return inliers, near, known


@kernel
def is_known(voxels: Voxels, slot: np.int64, viewer: Array) -> bool:
    """Whether a voxel has points enough to say if a surface is there, seen from this side."""
    if voxels.keys[slot] == EMPTY or voxels.counts[slot] < LEAST_POINTS:
        return False
    return bool(voxels.planes[slot, 3] == 0.0 or seen_from(voxels, slot, viewer))


@kernel
def count_near(points: Array, viewer: Array, inverse: float, voxels: Voxels) -> tuple[int, int]:
    """Count the points (n, 3), m, that agree with a plane, and those in known voxels."""
    near, known = 0, 0
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, inverse))
        known += is_known(voxels, slot, viewer)
        near += abs(distance_from_plane(voxels, slot, x, y, z, viewer)) <= NEAR
    return near, known


@kernel
def count_on_planes(
    points: Array, viewer: Array, inverse: float, voxels: Voxels, least: int
) -> tuple[int, int, int]:
    """Count points (n, 3), m, that agree with a plane, that have one, and in known voxels.

    Known are those of `least` points and more.
    """
    near, planar, known = 0, 0, 0
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, inverse))
        known += voxels.counts[slot] >= least and is_known(voxels, slot, viewer)
        distance = abs(distance_from_plane(voxels, slot, x, y, z, viewer))
        planar += isfinite(distance)
        near += distance <= NEAR
    return near, planar, known


@kernel
def search_start(
    offsets: Array,
    predicted: Array,
    inverse: float,
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
        inverse: As of `align`.
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
        score_shifts(offsets, predicted, k * turn, inverse, shift, voxels, off, scores)
        for i in range(-shifts, shifts + 1):
            for j in range(-shifts, shifts + 1):
                score, steps = scores[i + shifts, j + shifts], abs(i) + abs(j) + abs(k)
                if score > most or (score == most and score >= least and steps < fewest):
                    most, fewest = score, steps
                    start[0], start[1], start[2] = i * shift, j * shift, k * turn
                count += 1
    return most, count


@kernel
def score_shifts(
    offsets: Array,
    predicted: Array,
    turn: float,
    inverse: float,
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
        turn: Of the points about the vertical, rad.
        inverse: As of `align`.
        shift: Step of the shift, m.
        voxels: The map.
        off: As of `score_of`.
        scores: (n, n) by steps along x and y, n odd, no shift in the middle; written.
    """
    scores[:] = 0
    n, viewer, c, s = len(scores), predicted.copy(), cos(turn), sin(turn)
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
                planar = find_planes(x, ys, z, inverse, voxels, slots)
            if not planar:
                continue
            for j in range(n):
                if slots[j] >= 0:
                    viewer[1] = predicted[1] + moved[j]
                    distance = distance_from_plane(voxels, slots[j], x, ys[j], z, viewer)
                    scores[i, j] += worth(distance, off)


@kernel
def find_planes(
    x: float, ys: Array, z: float, inverse: float, voxels: Voxels, slots: NDArray[np.int64]
) -> bool:
    """Find the slot of the voxel at each y (n,) m, -1 for one without a plane.

    Args:
        x: World, m.
        ys: World, m, in order.
        z: World, m.
        inverse: As of `align`.
        voxels: The map.
        slots: (n,); written.

    Returns:
        Whether any has a plane.
    """
    row, slot, planar = inf, np.int64(-1), False
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
def worth(distance: float, off: int) -> int:
    """What a point adds to a score by its distance from a plane, m, infinite if there is none."""
    distance = abs(distance)
    if distance <= NEAR:
        return 1
    return -off if isfinite(distance) else 0


@kernel
def score_of(
    offsets: Array,
    viewer: Array,
    c: float,
    s: float,
    inverse: float,
    voxels: Voxels,
    off: int,
    most: int,
) -> int:
    """Number of points that agree with a plane, less `off` times those that lie off one.

    Args:
        offsets: (n, 3) points from the base, m.
        viewer: (3,) position of the base, world, m.
        c: Cosine of the turn of the points about the vertical.
        s: Its sine.
        inverse: One by the edge of a voxel, 1/m.
        voxels: The map.
        off: Weight of a point that lies off the plane of its voxel.
        most: Score below which it does not matter by how much: then it is any number below.
    """
    score, rest = 0, len(offsets)
    for index in range(len(offsets)):
        if score + rest < most:
            return score + rest
        rest -= 1
        ox, oy = offsets[index, 0], offsets[index, 1]
        x, y = viewer[0] + c * ox - s * oy, viewer[1] + s * ox + c * oy
        z = viewer[2] + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, inverse))
        score += worth(distance_from_plane(voxels, slot, x, y, z, viewer), off)
    return score


@kernel
def distance_from_plane(
    voxels: Voxels, slot: np.int64, x: float, y: float, z: float, viewer: Array
) -> float:
    """Signed distance of a point from the plane of a voxel, m.

    Infinite where it has none, or one that was seen from the other side: the two faces of a board,
    a wall or a shelf are a few centimetres apart, and the one is no evidence of the other.
    """
    plane = voxels.planes[slot]
    if voxels.keys[slot] == EMPTY or plane[3] == 0.0 or not seen_from(voxels, slot, viewer):
        return inf
    mean = voxels.means[slot]
    return float(plane[0] * (x - mean[0]) + plane[1] * (y - mean[1]) + plane[2] * (z - mean[2]))


@kernel
def examine(
    offsets: Array,
    predicted: Array,
    correction: Array,
    inverse: float,
    voxels: Voxels,
    distances: Array,
    moment: Array,
    scatter: Array,
    shares: Array,
) -> int:
    """Measure how an aligned sweep lies on the planes of the map.

    Args:
        offsets: As of `align`.
        predicted: As of `align`.
        correction: (4,) of `align`.
        inverse: As of `align`.
        voxels: The map.
        distances: (n,) of the points near a plane from it, without sign, m; the first ones are
            written.
        moment: (4, 4) mean of g g' over these points, g the gradient of the distance by the pose;
            written.
        scatter: (4, 4) mean of w^2 d^2 g g' over them by the square of the mean of w, m^2: d the
            distance, w its weight in `align`; written.
        shares: (k, 4) by the sweeps of their voxels: sum of the squares of g; added to.

    Returns:
        Number of these points.
    """
    moment[:], scatter[:] = 0.0, 0.0
    c, s = cos(correction[3]), sin(correction[3])
    bx, by = predicted[0] + correction[0], predicted[1] + correction[1]
    bz = predicted[2] + correction[2]
    viewer, row = np.array((bx, by, bz)), np.empty(4)
    inliers, total = 0, 0.0
    for index in range(len(offsets)):
        ox, oy = offsets[index, 0], offsets[index, 1]
        rx, ry = c * ox - s * oy, s * ox + c * oy
        x, y, z = bx + rx, by + ry, bz + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, inverse))
        distance = abs(distance_from_plane(voxels, slot, x, y, z, viewer))
        if distance > GATE:
            continue
        distances[inliers] = distance
        inliers += 1
        plane = voxels.planes[slot]
        row[0], row[1], row[2] = plane[0], plane[1], plane[2]
        row[3] = plane[1] * rx - plane[0] * ry
        weight = 1.0 / (1.0 + (distance / SCALE) ** 2)
        total += weight
        sweep = voxels.sweeps[slot]
        for i in range(4):
            shares[sweep, i] += row[i] * row[i]
            for j in range(4):
                moment[i, j] += row[i] * row[j]
                scatter[i, j] += (weight * distance) ** 2 * row[i] * row[j]
    moment /= max(inliers, 1)
    scatter *= inliers / max(total, 1.0) ** 2
    return inliers


@kernel
def sum_up(
    offsets: Array,
    predicted: Array,
    correction: Array,
    inverse: float,
    gate: float,
    voxels: Voxels,
    equations: Array,
    right: Array,
    moment: Array,
) -> tuple[int, int, int, float]:
    """Sum up the normal equations (4, 4) and (4,), and the weighted mean of n n' (3, 3).

    Returns:
        The three numbers of `align`, and the sum of the weights.
    """
    equations[:], right[:], moment[:] = 0.0, 0.0, 0.0
    c, s = cos(correction[3]), sin(correction[3])
    bx, by = predicted[0] + correction[0], predicted[1] + correction[1]
    bz = predicted[2] + correction[2]
    viewer, row = np.array((bx, by, bz)), np.empty(4)
    inliers, near, known, total = 0, 0, 0, 0.0
    for index in range(len(offsets)):
        ox, oy = offsets[index, 0], offsets[index, 1]
        rx, ry = c * ox - s * oy, s * ox + c * oy
        x, y, z = bx + rx, by + ry, bz + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, inverse))
        known += is_known(voxels, slot, viewer)
        distance = distance_from_plane(voxels, slot, x, y, z, viewer)
        if abs(distance) > gate:
            continue
        near += abs(distance) <= NEAR
        plane = voxels.planes[slot]
        weight = 1.0 / (1.0 + (distance / SCALE) ** 2)
        row[0], row[1], row[2] = plane[0], plane[1], plane[2]
        row[3] = plane[1] * rx - plane[0] * ry
        for i in range(4):
            right[i] -= weight * row[i] * distance
            for j in range(4):
                equations[i, j] += weight * row[i] * row[j]
        inliers += 1
        total += weight
    for i in range(3):
        for j in range(3):
            moment[i, j] = equations[i, j] / total if total > 0.0 else 0.0
    return inliers, near, known, total


@kernel
def hold_to_prediction(
    equations: Array, right: Array, correction: Array, axis: Array, weight: float
) -> None:
    """Add to the normal equations that the prediction stays along an axis (3,)."""
    along = axis[0] * correction[0] + axis[1] * correction[1] + axis[2] * correction[2]
    for i in range(3):
        right[i] -= weight * axis[i] * along
        for j in range(3):
            equations[i, j] += weight * axis[i] * axis[j]


@kernel
def solve(matrix: Array, right: Array) -> None:
    """Solve a positive definite system (n, n) by Cholesky in place; the solution is `right`."""
    size = len(right)
    for j in range(size):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = sqrt(max(matrix[j, j], 1e-12))
        for i in range(j + 1, size):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
