"""Collision checks of a body against single cells, and the margin that its pose asks for."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.decision import path_of
from wayproof.harness.inputs import Pose
from wayproof.harness.judge.cells import SPACING, Cells, Mask, cells_around
from wayproof.harness.judge.slopes import sloping_columns
from wayproof.harness.log.paths import SAME_PLACE, Array, arc_lengths, densely, length
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import UnknownPolicy
from wayproof.maps.columns import ColumnMap

PARTS = 4
"""Number of parts that the time between two samples is divided into."""

STILL = 0.02
"""Change of heading up to which a body does not turn, rad."""

BESIDE = 0.01
"""Greatest distance of a disc from straight lines between samples, m."""

ROUNDING = 1e-6
"""Distance up to which a point on the face or corner of a cell may lie in any of its cells, m."""

Discs = tuple[tuple[float, float], ...]
"""Offset along the x axis of the body, and radius, of each disc, m."""


@dataclass(frozen=True)
class Body:
    """Body of a mission under an unknown policy.

    Attributes:
        config: Settings of the decisions.
        mission: Mission of the decisions.
        policy: Unknown policy that paths are checked against.
        widening: Cells along x and y by which what is blocked is widened; empty if by none.
        feet: (3,) on the ground below the body, m; only of one that climbs, see `climbs`.
        windows: Cells that were read of each map of one decision, with the box that they hold all
            cells of; None where maps may change.
    """

    config: Config
    mission: Mission
    policy: UnknownPolicy
    widening: tuple[int, ...] = ()
    feet: tuple[float, ...] | None = None
    windows: dict[int, tuple[Array, Array, Cells]] | None = None

    def placed(self, pose: Pose) -> Body:
        """Return the body of one decision at a pose, among cells widened as the pose asks for."""
        _, widening = believed_of(pose, self.config.map.resolution, flat=self.flat)
        return replace(self.standing_at(pose), widening=widening, windows={})

    def standing_at(self, pose: Pose) -> Body:
        """Return the body with its feet, if it climbs."""
        height, (x, y, z) = self.mission.rest_height, pose.position.tolist()
        climbs = self.config.costmap.max_slope > 0.0 and height > 0.0
        return replace(self, feet=(x, y, z - height) if climbs else None)

    @property
    def flat(self) -> bool:
        """Whether the body moves in the plane."""
        return self.mission.planar

    @property
    def half_diagonal(self) -> float:
        """Half diagonal of a cell, cells: of a square on the ground, of a cube in the air."""
        return 0.5 * math.sqrt(2.0 if self.flat else 3.0)

    @property
    def discs(self) -> Discs:
        """Discs that represent the body at its heading; a single disc or ball for a round body."""
        return self.mission.body_discs

    @property
    def radius(self) -> float:
        """Radius of the circumscribed disc or ball, m."""
        return max(abs(offset) + radius for offset, radius in self.discs)

    @property
    def about(self) -> Discs:
        """Circumscribed disc or ball, which covers the body at any heading."""
        return ((0.0, self.radius),)

    def reach(self, radius: float) -> float:
        """Return the distance, cells, up to which a cell is in collision with a disc or ball.

        A surface lies anywhere in its cell, so half a diagonal is added to the radius, m.
        """
        return radius / self.config.map.resolution + self.half_diagonal

    def wrong(self, cells: Cells) -> Mask:
        """Return the mask of the cells that the body may not overlap by its policy."""
        return cells.wrong(unknown_blocks=self.policy == "forbid")

    @property
    def slack(self) -> float:
        """Lateral tolerance of a track, m: an overlap within it does not count."""
        return BESIDE if self.mission.discs else ROUNDING

    def moves(self, trajectory: pb.Trajectory) -> bool:
        """Return whether the body moves, or an elongated one turns in place.

        Of a stack on trial any motion counts, however small: it could creep anywhere.
        """
        headings = trajectory.heading if self.mission.discs else ()
        way, turn = length(path_of(trajectory.path)), float(np.ptp(headings)) if headings else 0.0
        if self.config.stack.name != BUILTIN:
            return way > 0.0 or turn > 0.0
        return way >= SAME_PLACE or turn > STILL

    def poses(self, trajectory: pb.Trajectory, from_ns: int) -> Array:
        """Return the poses of a trajectory: x, y, z, m, and heading, rad, (n, 4).

        Those of a body of discs are the logged samples from a simulated time on, and the corners of
        the path. Those of a round body are all points of the path.
        """
        path = path_of(trajectory.path)
        if not self.mission.discs:
            return np.column_stack((path, np.zeros(len(path))))
        arcs, headings = np.array(trajectory.arc_length), np.array(trajectory.heading)
        late_ns = from_ns - trajectory.start.ToNanoseconds()
        first = max(late_ns // round(trajectory.sample_period_s * 1e9), 0)
        first = min(first, len(arcs) - 1)
        lengths = arc_lengths(path)
        times = np.arange(float(first), len(arcs) - 1 + 1e-9, 1.0 / PARTS)
        corners = lengths[(lengths > arcs[first]) & (lengths < arcs[-1])]
        times = np.sort(np.append(times, np.interp(corners, arcs, np.arange(len(arcs)))))
        along = np.interp(times, np.arange(len(arcs)), arcs)
        places = [np.interp(along, lengths, path[:, axis]) for axis in range(3)]
        facing = np.interp(times, np.arange(len(arcs)), headings)
        poses = np.column_stack((*places, facing))
        beyond = path[lengths > arcs[-1] + SAME_PLACE]  # no sample excludes that it is driven
        return np.vstack((poses, np.column_stack((beyond, np.full(len(beyond), headings[-1])))))

    def cells(self, voxel_map: ColumnMap, track: Array, reach: float) -> Cells:
        """Return the cells within a reach, m, of a track (n, 3), m, and maybe more."""
        config, mission = self.config, self.mission
        axes = mission.axes
        low, high = track[:, :axes].min(axis=0) - reach, track[:, :axes].max(axis=0) + reach
        if self.windows is not None and id(voxel_map) in self.windows:
            first, end, cells = self.windows[id(voxel_map)]
            if (first <= low).all() and (high <= end).all():
                return cells
        sloping = None
        if mission.planar and config.costmap.max_slope > 0.0:
            if self._sloping.get("map") is not voxel_map:
                columns = sloping_columns(voxel_map, config, mission, self.feet)
                self._sloping.update(map=voxel_map, columns=columns)
            sloping = self._sloping["columns"]
        cells = cells_around(
            voxel_map,
            path=track,
            reach=reach,
            config=config,
            mission=mission,
            widening=self.widening,
            sloping=sloping,
        )
        if self.windows is not None:
            self.windows[id(voxel_map)] = low, high, cells
        return cells

    @cached_property
    def _sloping(self) -> dict[str, Any]:
        """The columns of one map: they take as long as the rest of a decision's audit."""
        return {}

    def first_blocked(
        self, voxel_map: ColumnMap, poses: Array, margin: float
    ) -> tuple[Array, str] | None:
        """Return the first position where the body, or one of its discs, is in collision.

        Where the circumscribed disc has room, the heading does not matter.

        Args:
            voxel_map: Map of the decision.
            poses: (n, 4) x, y, z, m, and heading, rad.
            margin: Margin around the body, m.

        Returns:
            Position (3,), m, and the state of the cell in collision; None without a collision.
        """
        if self.mission.discs:
            around = self.radius + margin
            if self.first_overlap(voxel_map, poses[:, :3], around, ROUNDING) is None:
                return None
        for offset, radius in self.discs:
            track = track_of(poses, offset)
            found = self.first_overlap(voxel_map, track, radius + margin, self.slack)
            if found is not None:
                return found
        return None

    def first_overlap(
        self, voxel_map: ColumnMap, path: Array, radius: float, slack: float = 0.0
    ) -> tuple[Array, str] | None:
        """Return the first position on a path where a disc or ball collides, and the cell's state.

        With a slack, m, it must be in collision that far to both sides as well.
        """
        reach = self.reach(radius)
        cells = self.cells(voxel_map, path, reach * voxel_map.resolution)
        places = densely(path, SPACING * cells.size)
        wrong = self.wrong(cells)
        sides = np.zeros((2**cells.axes, 3))
        sides[:, : cells.axes] = list(itertools.product((-slack, slack), repeat=cells.axes))
        for place in places[cells.within(cells.of(places), wrong, reach)]:
            if slack == 0.0 or cells.within(cells.of(place + sides), wrong, reach).all():
                occupied = cells.within(cells.of(place[None]), cells.occupied, reach)[0]
                return place[: cells.axes], "occupied" if occupied else "unknown"
        return None


def track_of(poses: Array, offset: float) -> Array:
    """Return the track of the centre of a disc, (n, 3) m, for poses (n, 4)."""
    track = poses[:, :3].copy()
    track[:, 0] += offset * np.cos(poses[:, 3])
    track[:, 1] += offset * np.sin(poses[:, 3])
    return track


SIGMAS = 2.0
"""Standard deviations of the estimated position that the margin covers."""

DIFFERS = 0.02
"""Difference of the margins of two axes from which they differ, m."""

MOST_CELLS, MOST_MORE = 100, 400
"""Greatest margin for a stated covariance, and what may lack along one axis, cells."""


def believed_of(pose: Pose, size: float, flat: bool) -> tuple[float, tuple[int, ...]]:
    """Return the margin for the stated error of a pose, m, and the cells more along x and y.

    Of an estimator that states a covariance and is less sure along x or y: the standard deviations
    of the other axes, and what lacks along that one in whole cells.

    Args:
        pose: Pose that the decision was made on.
        size: Edge of a cell, m.
        flat: Whether the body moves in the plane.
    """
    if pose.covariance is None:
        return SIGMAS * pose.position_sigma, ()
    along = SIGMAS * np.sqrt(np.diagonal(pose.covariance))
    worse = 0 if along[0] > along[1] else 1
    others = [float(along[1 - worse])] if flat else [float(along[1 - worse]), float(along[2])]
    more = float(along[worse]) - max(others)
    if more <= DIFFERS:
        return min(SIGMAS * pose.position_sigma, MOST_CELLS * size), ()
    cells = [0, 0]
    cells[worse] = min(math.ceil(more / size), MOST_MORE)
    return min(max(others), MOST_CELLS * size), tuple(cells)
