"""Map of a lidar odometry: one plane in each voxel that sweeps have met."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayproof.harness.estimators.alignment import (
    LEAST_INLIERS,
    Alignment,
    align,
    count_on_planes,
    examine,
)
from wayproof.harness.estimators.matrices import diagonalize, inverse
from wayproof.harness.estimators.voxels import (
    EMPTY,
    LEAST_POINTS,
    Voxels,
    add_points,
    slot_of,
    spread_out,
)
from wayproof.models.arrays import Array

SLOTS = 1 << 14
"""Number of slots at the start."""

GOLDEN = 0.6180339887498949
"""The golden ratio less 1, by whose multiples places are spread evenly (Knuth, as in `kernels`)."""

FULL = 0.5
"""Share of used slots above which the table doubles."""

CHANCE = 2.0
"""Standard deviations of a binomial count beyond which it is not by chance."""

NO_PRIOR = np.diag([0.0, 0.0, 0.0, 1e-3])
"""Prior of the heading, which the scene always turns but for a round one."""

DEVIATIONS_OF_MEDIAN = 1.4826
"""Standard deviation of a Gaussian by the median of its absolute values."""


class SurfaceMap:
    """Planes of surfaces by voxel, in the frame of the estimate.

    After Yuan et al. 2022, RA-L 7, "Efficient and probabilistic adaptive voxel mapping for accurate
    online LiDAR odometry", with voxels of one size.

    Attributes:
        voxels: The table.
        count: Number of voxels in it.
        sweeps: Number of sweeps that were added.
    """

    def __init__(self, voxel: float, held: float, registered_share: float) -> None:
        """Start empty.

        Args:
            voxel: Edge of a voxel, m.
            held: Least information of a direction that the scene holds.
            registered_share: Least share of the points in known voxels that agree with a plane; a
                sweep with less contradicts the map.
        """
        self._held, self._share = held, registered_share
        self.voxels = _table(SLOTS, 1.0 / voxel)
        self.count = 0
        self.sweeps = 0

    def add(self, points: Array, viewer: Array) -> None:
        """Add the points (n, 3) of a sweep, seen from `viewer` (3,), world, m."""
        while self.count + len(points) > FULL * len(self.voxels.keys):
            self._double()
        self.count += add_points(points, viewer, self.voxels, self.sweeps)
        self.sweeps += 1

    def contradicts(self, points: Array, viewer: Array, registered: bool = False) -> bool:
        """Return whether points (n, 3) lie in known voxels, m, but too few of them on a plane.

        Args:
            points: Placed where the sweep was found to be, world, m.
            viewer: (3,) from where they were seen, m.
            registered: Whether the sweep was registered; it is judged again all the same.
        """
        near, _, known = count_on_planes(points, viewer, self.voxels, LEAST_POINTS)
        return known >= LEAST_INLIERS and near < self._least_near(known)

    def register(
        self,
        points: Array,
        predicted: Array,
        prior: Array | None = None,
        reach: tuple[float, float] = (0.0, 0.0),
    ) -> Registration:
        """Align points with the map.

        Args:
            points: (n, 3) placed by the predicted poses, world, m.
            predicted: (3,) position of the base at the end of the sweep, m.
            prior: (4, 4) as of `align`; if none, the predicted heading counts a little.
            reach: Greatest error of the prediction, m and rad, where a map searches.
        """
        offsets, found = points - predicted, not_aligned()
        prior = NO_PRIOR if prior is None else prior
        inliers, near, known = align(offsets, predicted, self._held, prior, self.voxels, found)
        if inliers < LEAST_INLIERS or near < self._least_near(known):
            return unregistered(inliers)
        return self._examined(offsets, predicted, found, inliers)

    def _examined(
        self, offsets: Array, predicted: Array, found: Alignment, inliers: int
    ) -> Registration:
        """Return the registration of an aligned sweep, by arguments and results of `align`."""
        correction, information, axes = found
        unheld = np.ascontiguousarray(axes[:, information < self._held].T)
        distances, shares = np.empty(len(offsets)), np.zeros((self.sweeps, 4))
        moment, scatter = np.empty((4, 4)), np.empty((4, 4))
        count = examine(
            offsets, predicted, correction, self.voxels, distances, moment, scatter, shares
        )
        if count == 0:
            return unregistered(inliers)
        return Registration(
            correction=correction,
            information=information,
            unheld=unheld,
            inliers=inliers,
            deviation=DEVIATIONS_OF_MEDIAN * float(np.median(distances[:count])),
            moment=moment,
            scatter=scatter,
            anchors=shares / np.maximum(shares.sum(axis=0), 1e-12),
        )

    def _least_near(self, known: int) -> float:
        """Count the points that agree with a plane, of those in known voxels, beyond chance."""
        share = self._share
        return share * known + CHANCE * math.sqrt(share * (1.0 - share) * known)

    def _double(self) -> None:
        old = self.voxels
        self.voxels = _table(2 * len(old.keys), old.inverse)
        for slot in np.flatnonzero(old.keys != EMPTY).tolist():
            new = slot_of(self.voxels.keys, old.keys[slot])
            for was, now in zip(old[:-1], self.voxels[:-1], strict=True):
                now[new] = was[slot]


def thinned(points: Array, spacing: float) -> Array:
    """Return points, no two nearer than `spacing`, (k, 3) m.

    They are taken by strides of the golden ratio. Taken as a sensor lists them, outwards over a
    floor, those would be chosen that noise put farther out, which is below it.
    """
    count = len(points)
    if count == 0:
        return points
    stride = round(count * GOLDEN)
    while math.gcd(stride, count) != 1:
        stride += 1
    points = points[np.arange(count) * stride % count]
    slots = 1 << int(2 * count + 1).bit_length()
    keys, heads = np.empty(slots, np.int64), np.empty(slots, np.int64)
    following, chosen = np.empty(count, np.int64), np.empty(count, np.int64)
    kept: Array = points[chosen[: spread_out(points, spacing, keys, heads, following, chosen)]]
    return kept


def not_aligned() -> Alignment:
    """Return an alignment to be written."""
    return Alignment(np.empty(4), np.empty(3), np.empty((3, 3)))


def _table(slots: int, inverse: float) -> Voxels:
    return Voxels(
        keys=np.full(slots, EMPTY, np.int64),
        counts=np.zeros(slots, np.int64),
        means=np.zeros((slots, 3)),
        squares=np.zeros((slots, 6)),
        planes=np.zeros((slots, 4)),
        sweeps=np.zeros(slots, np.int64),
        inverse=inverse,
    )


def unregistered(inliers: int = 0) -> Registration:
    """Return the registration of a sweep that does not lie in the map: no information."""
    return Registration(
        correction=np.zeros(4),
        information=np.zeros(3),
        unheld=np.eye(3),
        inliers=inliers,
        deviation=math.inf,
        moment=np.zeros((4, 4)),
        scatter=np.zeros((4, 4)),
        anchors=np.zeros((0, 4)),
    )


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.25)
    floor = np.stack([*np.indices((8, 8)).reshape(2, -1) * 0.07, np.zeros(64)], axis=1)
    corner = np.concatenate([floor, np.roll(floor, 1, axis=1), np.roll(floor, 2, axis=1)])
    viewer = np.array([1.0, 1.0, 1.0])
    surfaces.add(thinned(corner, 0.01), viewer)
    surfaces.register(corner, viewer)
    surfaces.contradicts(corner, viewer)
    # A kernel that another one calls is not loaded with it for calls from Python.
    diagonalize(np.eye(3), np.empty((3, 3)))
    inverse(np.eye(3))


@dataclass(frozen=True)
class Registration:
    """Registration of a sweep in the map.

    Attributes:
        correction: (4,) shift from the predicted position, m, and turn about the vertical, rad.
        information: (3,) eigenvalues of the mean of n n' over the normals of the registered points;
            they sum to 1, and all are 0 where too few were registered.
        unheld: (k, 3) unit directions along which the scene does not hold the pose.
        inliers: Number of registered points.
        deviation: Standard deviation of their distances from the planes, by the median, m;
            infinite without any.
        moment: (4, 4) mean of g g' over these points, g the gradient of the distance by the pose:
            x, y, z and heading.
        scatter: (4, 4) mean of w^2 d^2 g g' over them by the square of the mean of w, m^2: d the
            distance, w its weight.
        anchors: (k, 4) share of the voxels that are by each sweep before, in what
            was measured of x, y, z and the heading; each column sums to 1, or is 0.
    """

    correction: Array
    information: Array
    unheld: Array
    inliers: int
    deviation: float
    moment: Array
    scatter: Array
    anchors: Array
