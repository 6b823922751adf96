"""Map of a lidar odometry by planar lasers: a line in each voxel, as an upright plane.

A planar laser among furniture differs from a lidar of many rings in three ways:

- A scan has a hundred returns, and many of them are of legs and corners, which make no line. A
  voxel without one says nothing of the pose, so it counts neither for a scan nor against it.
- What predicts between two scans is an odometry of wheels, off by degrees and, where these slip or
  are pushed, by all of the motion. Half of a scan may lie in the map there when 0.2 m beside all of
  it does. So each scan is looked for around where it was put, as far as the odometry may be off,
  and taken from where it clearly agrees better; a scan that was not registered also has to agree by
  more than what chance gives the best of so many poses.
- Voxels that were filled from wrong poses, or where things stood that have moved, hold no line for
  good. They are started again.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimators.alignment import (
    LEAST_INLIERS,
    NEAR,
    align,
    count_on_planes,
)
from wayproof.harness.estimators.scan_search import score_of, search_start
from wayproof.harness.estimators.surface_map import (
    CHANCE,
    NO_PRIOR,
    Registration,
    SurfaceMap,
    not_aligned,
    unregistered,
)
from wayproof.harness.estimators.voxels import FLATNESS
from wayproof.models.arrays import Array

LINE_POINTS = 16
"""Number of points, two for each beam, from which a voxel may hold a line. With a noise of 4.5 cm
across it a line through three beams, the least for a plane, is flat enough by chance in 66 % of
the voxels, one through eight beams in 13 % (chi-squared of one and of six degrees of freedom)."""

FORGOTTEN = 24
"""Number of points from which a voxel without a line is started again."""

SEARCH_SHIFT, SEARCH_SHIFTS = 0.1, 3
"""Step, m, and number of steps to either side of the search along x and y: a step is twice `NEAR`
at most, and 0.3 m is what a robot of 1.5 m/s goes between two scans 0.2 s apart."""

SEARCH_TURN, SEARCH_TURNS = 0.03, 10
"""Step, rad, and number of steps to either side of the search of the heading: a step moves what is
4 m away by twice `NEAR`, and 0.3 rad is what a robot turns at 1.5 rad/s in 0.2 s."""


MOST_SHIFTS, MOST_TURNS = 15, 20
"""Number of steps to either side at most, 1.5 m and 0.6 rad: the time grows with the cube."""

OFF = 2
"""Weight of a point that lies off the line of its voxel, against one that agrees with it: the ratio
of their log likelihoods if 0.9 agree at the true pose, and 2 `NEAR` of the width elsewhere."""

CLEARLY = 12
"""Score by which another pose has to be better: 10 nats by those likelihoods, as 1,029 poses are
looked at and wheels slip in 1 scan of 20."""


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
        """Return whether points (n, 3), m, lie in known voxels where the scan was not registered.

        Those in voxels without a line count here: where noise hides the lines, scans that were
        mapped where the wheels put them would make some by chance.
        """
        known = count_on_planes(points, viewer, self.voxels, LINE_POINTS)[2]
        return known >= 2 * LEAST_INLIERS and not registered  # two points for each beam

    def register(
        self,
        points: Array,
        predicted: Array,
        prior: Array | None = None,
        reach: tuple[float, float] = (0.0, 0.0),
    ) -> Registration:
        """Align a scan with the map, unless it lies clearly better elsewhere around.

        Args:
            points: (n, 3) placed by the predicted poses, in the middle of a voxel's height, world,
                m.
            predicted: (3,) position of the base at the end of the scan, m.
            prior: (4, 4) as of `align`; if none, the predicted heading counts a little.
            reach: Greatest error of the prediction, m and rad; it is searched around there, and at
                least `SEARCH_SHIFT` times `SEARCH_SHIFTS` and likewise of the turn.
        """
        offsets = points - predicted
        weight = NO_PRIOR if prior is None else prior
        found = self._aligned(offsets, predicted, weight, self._share, CHANCE)
        known = count_on_planes(points, predicted, self.voxels, LINE_POINTS)[2]
        registered = math.isfinite(found.deviation)
        if not registered and known < LEAST_INLIERS:
            return found
        least = CLEARLY
        if registered:
            least += self._score(offsets, predicted, found.correction)
        elsewhere = self._searched(offsets, predicted, least, reach)
        return elsewhere if math.isfinite(elsewhere.deviation) else found

    def _searched(
        self, offsets: Array, predicted: Array, least: int, reach: tuple[float, float]
    ) -> Registration:
        """Register where the points agree best; the prediction does not count.

        By chance a point of a voxel agrees with its line in 2 `NEAR` of its width. Of n poses the
        best one has the square root of 2 ln n deviations more (the largest of n Gaussians).

        Args:
            offsets: As of `align`.
            predicted: As of `align`.
            least: Score of a pose that is taken.
            reach: As of `register`.
        """
        shifts = min(max(SEARCH_SHIFTS, math.ceil(reach[0] / SEARCH_SHIFT)), MOST_SHIFTS)
        turns = min(max(SEARCH_TURNS, math.ceil(reach[1] / SEARCH_TURN)), MOST_TURNS)
        start = np.zeros(3)
        best, count = search_start(
            offsets,
            predicted,
            SEARCH_SHIFT,
            shifts,
            SEARCH_TURN,
            turns,
            self.voxels,
            OFF,
            least // 2,  # steps are coarser than what agrees
            start,
        )
        if best < least // 2:
            return unregistered()
        x, y, turn = start.tolist()
        there = predicted + np.array([x, y, 0.0])
        chance = min(1.0, 2.0 * NEAR * self.voxels.inverse)
        deviations = math.sqrt(2.0 * math.log(count))
        turned = _turned(offsets, turn)
        found = self._aligned(turned, there, NO_PRIOR, chance, deviations)
        if not math.isfinite(found.deviation):
            return found
        if self._score(turned, there, found.correction) < least:
            return unregistered(found.inliers)
        found.correction[:] += np.array([x, y, 0.0, turn])
        return found

    def _score(self, offsets: Array, predicted: Array, correction: Array) -> int:
        """Score of an aligned scan, as of `score_of`."""
        c, s = math.cos(float(correction[3])), math.sin(float(correction[3]))
        there = predicted + correction[:3]
        return score_of(offsets, there, c, s, self.voxels, OFF)

    def _aligned(
        self, offsets: Array, predicted: Array, prior: Array, share: float, deviations: float
    ) -> Registration:
        """Align from here, and judge by the points in voxels with a line.

        Args:
            offsets: As of `align`.
            predicted: As of `align`.
            prior: As of `align`.
            share: Share of the points in voxels with a line that has to agree with it.
            deviations: Standard deviations of a binomial count that have to be on top.
        """
        aligned = not_aligned()
        correction = aligned.correction
        inliers, _, _ = align(offsets, predicted, self._held, prior, self.voxels, aligned)
        if inliers < LEAST_INLIERS:
            return unregistered(inliers)
        there = predicted + correction[:3]
        points = _turned(offsets, float(correction[3])) + there
        near, on_lines, _ = count_on_planes(points, there, self.voxels, LINE_POINTS)
        least = share * on_lines + deviations * math.sqrt(share * (1.0 - share) * on_lines)
        if on_lines < LEAST_INLIERS or near < least:
            return unregistered(inliers)
        found = self._examined(offsets, predicted, aligned, inliers)
        return found if found.deviation <= FLATNESS else unregistered(inliers)


def _turned(offsets: Array, angle: float) -> Array:
    """Return offsets (n, 3) turned about the vertical."""
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
