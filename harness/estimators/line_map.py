"""Map of a lidar odometry by planar lasers: a line in each voxel, as an upright plane.

A planar laser among furniture differs from a lidar of many rings in three ways:

- A scan has a hundred returns, and many of them are of legs and corners, which make no line. A
  voxel without one says nothing of the pose, so it counts neither for a scan nor against it.
- What predicts between two scans is an odometry of wheels, off by degrees and, where these slip or
  are pushed, by all of the motion. A scan that does not lie in the map where that puts it is looked
  for around there, and has to agree by more than what chance gives the best of so many poses.
- Voxels that were filled from wrong poses, or where things stood that have moved, hold no line for
  good. They are started anew.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimators.kernels import (
    FLATNESS,
    LEAST_INLIERS,
    NEAR,
    align,
    count_on_planes,
    search_start,
)
from wayproof.harness.estimators.registration import Registration
from wayproof.harness.estimators.surface_map import (
    CHANCE,
    NO_PRIOR,
    SurfaceMap,
    unregistered,
)
from wayproof.models.arrays import Array

LINE_POINTS = 16
"""Number of points, two for each beam, from which a voxel may hold a line. With a noise of 4.5 cm
across it a line through three beams, the least for a plane, is flat enough by chance in 66 % of
the voxels, one through eight beams in 13 % (chi-squared of one and of six degrees of freedom)."""

FORGOTTEN = 24
"""Number of points from which a voxel without a line is started anew."""

SEARCH_SHIFT, SEARCH_SHIFTS = 0.1, 3
"""Step, m, and number of steps to either side of the search along x and y: a step is twice `NEAR`
at most, and 0.3 m is what a robot of 1.5 m/s goes between two scans 0.2 s apart."""

SEARCH_TURN, SEARCH_TURNS = 0.03, 10
"""The same of the heading, rad: a step moves what is 4 m away by twice `NEAR`, and 0.3 rad is what
a robot turns at 1.5 rad/s."""


class LineMap(SurfaceMap):
    """Lines of walls by voxel, in the frame of the estimate."""

    def add(self, points: Array, viewer: Array) -> None:
        """Add the points of a scan, as upright walls: (n, 3), two of each return, world, m.

        Args:
            points: Each above and below the middle of a voxel.
            viewer: (3,) from where they were seen, world, m.
        """
        voxels = self.voxels
        vague = (voxels.counts >= FORGOTTEN) & (voxels.planes[:, 3] == 0.0)
        voxels.counts[vague], voxels.means[vague], voxels.squares[vague] = 0, 0.0, 0.0
        super().add(points, viewer)
        voxels = self.voxels  # may be a new table
        voxels.planes[voxels.counts < LINE_POINTS, 3] = 0.0

    def contradicts(self, points: Array, viewer: Array, registered: bool = False) -> bool:
        """Whether points (n, 3), m, lie in known voxels, but the scan was not registered there.

        Those in voxels without a line count here: where noise hides the lines, scans that were
        mapped where the wheels put them would make some by chance.
        """
        known = count_on_planes(points, viewer, self._inverse, self.voxels, LINE_POINTS)[2]
        return known >= 2 * LEAST_INLIERS and not registered  # two points for each beam

    def register(self, points: Array, predicted: Array, prior: Array | None = None) -> Registration:
        """Align a scan with the map, and where the prediction does not lead there, search.

        Args:
            points: (n, 3) placed by the predicted poses, in the middle of a voxel's height, world,
                m.
            predicted: (3,) position of the base at the end of the scan, m.
            prior: (4, 4) as of `align`; if none, the predicted heading counts a little.
        """
        offsets = points - predicted
        weight = NO_PRIOR if prior is None else prior
        found = self._aligned(offsets, predicted, weight, self._share, CHANCE)
        if math.isfinite(found.deviation):
            return found
        known = count_on_planes(points, predicted, self._inverse, self.voxels, LINE_POINTS)[2]
        if known < LEAST_INLIERS:
            return found
        return self._searched(offsets, predicted)

    def _searched(self, offsets: Array, predicted: Array) -> Registration:
        """Register where most points agree; the prediction, which failed, does not count.

        By chance a point of a voxel agrees with its line in 2 `NEAR` of its width. Of n poses the
        best one has the square root of 2 ln n deviations more (the largest of n Gaussians).
        """
        start = np.zeros(3)
        count = search_start(
            offsets,
            predicted,
            self._inverse,
            SEARCH_SHIFT,
            SEARCH_SHIFTS,
            SEARCH_TURN,
            SEARCH_TURNS,
            self.voxels,
            start,
        )
        x, y, turn = start.tolist()
        there = predicted + np.array([x, y, 0.0])
        chance = min(1.0, 2.0 * NEAR * self._inverse)
        deviations = math.sqrt(2.0 * math.log(count))
        found = self._aligned(_turned(offsets, turn), there, NO_PRIOR, chance, deviations)
        if math.isfinite(found.deviation):
            found.correction[:] += np.array([x, y, 0.0, turn])
        return found

    def _aligned(
        self, offsets: Array, predicted: Array, prior: Array, share: float, deviations: float
    ) -> Registration:
        """Align from here, and judge by the points in voxels with a line.

        Args:
            offsets: As of `align`.
            predicted: As of `align`.
            prior: As of `align`.
            share: Of the points in voxels with a line that has to agree with it.
            deviations: Of a binomial count that have to be on top.
        """
        correction, information, axes = np.empty(4), np.empty(3), np.empty((3, 3))
        inliers, _, _ = align(
            offsets,
            predicted,
            self._inverse,
            self._held,
            prior,
            self.voxels,
            correction,
            information,
            axes,
        )
        if inliers < LEAST_INLIERS:
            return unregistered(inliers)
        there = predicted + correction[:3]
        points = _turned(offsets, float(correction[3])) + there
        near, on_lines, _ = count_on_planes(points, there, self._inverse, self.voxels, LINE_POINTS)
        least = share * on_lines + deviations * math.sqrt(share * (1.0 - share) * on_lines)
        if on_lines < LEAST_INLIERS or near < least:
            return unregistered(inliers)
        found = self._examined(offsets, predicted, correction, information, axes, inliers)
        return found if found.deviation <= FLATNESS else unregistered(inliers)


def _turned(offsets: Array, angle: float) -> Array:
    """Offsets (n, 3) turned about the vertical."""
    c, s = math.cos(angle), math.sin(angle)
    x, y = offsets[:, 0], offsets[:, 1]
    return np.stack([c * x - s * y, s * x + c * y, offsets[:, 2]], axis=1)


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    lines, viewer = LineMap(0.3, held=0.04, registered_share=0.5), np.array([0.0, 1.0, 0.0])
    along, up = np.arange(60) * 0.05, np.array([0.0, 0.0, 0.075])
    wall = np.stack([along, np.zeros(60), np.zeros(60)], axis=1)
    lines.add(np.concatenate([wall + up, wall - up]), viewer)
    lines.register(wall + np.array([0.0, 0.2, 0.0]), viewer)
    lines.contradicts(wall, viewer)
