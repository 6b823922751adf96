"""Free space of a robot's reference point: a thresholded distance field with costs."""

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.body import Disc
from wayproof.planners.kernels import headed, segment, sweep, sweep_cost
from wayproof.planners.kernels.grid import OUTSIDE, Cell, Discs, Floats, Grid, Point, Pose

CLEARANCE_WEIGHT = 2.0
"""Weight of the cell cost against length: in a warehouse paths are 8 % longer with it, and their
mean clearance is 0.84 m instead of 0.53 m."""


@dataclass(frozen=True)
class FreeSpace:
    """A distance field, the threshold that makes it free space, and the cost of coming near.

    A cell is forbidden if its squared distance is at or below `collision_distance_sq`, and
    everywhere outside the array. Cells are half-open boxes. Ground robots have nz == 1, and all
    their points carry the height of that layer's centre. All points are in the world frame, m.

    Attributes:
        distances: Squared cell distances to the nearest blocked cell, truncated; uint16
            (nx, ny, nz). Where one is large enough, the cells around it are free without a check
            of their own.
        origin: Low corner of the grid, m, shape (3,).
        resolution: Cell size, m.
        collision_distance_sq: Largest forbidden squared cell distance.
        cost_by_distance: Cost of a cell by its squared cell distance, shape (t,): 1 at the border
            of the forbidden cells, falling to 0; the last entry holds for all beyond.
        prices: Cells whose cost is not by distance: uint8 (nx, ny, nz) index of `cost_by_price`, 0
            of all others; None without any.
        cost_by_price: Cost of a cell by its price, shape (p,); the first is of none.
        discs: Discs of a body that is checked at its heading, each with a threshold of its own, the
            least of which is `collision_distance_sq`. Empty for a body that is one disc or ball.
        shape: The discs as a record of arrays.
        grid: The field and its costs as a record of arrays.

    Raises:
        ValueError: If an array has a wrong shape or type, or a free cell's cost is negative or
            not finite.
    """

    distances: NDArray[np.uint16]
    origin: Floats
    resolution: float
    collision_distance_sq: int
    cost_by_distance: Floats
    discs: tuple[Disc, ...] = ()
    prices: NDArray[np.uint8] | None = None
    cost_by_price: tuple[float, ...] = (0.0,)
    shape: Discs = dataclasses.field(init=False, repr=False, compare=False)
    grid: Grid = dataclasses.field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._check(self.distances)
        grid = Grid(
            np.ascontiguousarray(self.distances),
            _no_prices(self.distances.shape) if self.prices is None else self.prices,
            np.array(self.origin, dtype=np.float64),
            float(self.resolution),
            np.array(self.cost_by_distance, dtype=np.float64),
            np.array(self.cost_by_price, dtype=np.float64),
        )
        object.__setattr__(self, "grid", grid)
        discs = self.discs or (Disc(0.0, self.collision_distance_sq),)
        shape = Discs(
            np.array([disc.offset for disc in discs]),
            np.array([disc.collision_distance_sq for disc in discs]),
        )
        object.__setattr__(self, "shape", shape)

    def _check(self, field: NDArray[np.uint16]) -> None:
        if field.ndim != 3 or field.dtype != np.uint16:
            got = f"{field.dtype} {field.shape}"
            raise ValueError(f"space.distances: got {got}, expected uint16 (nx, ny, nz)")
        if np.shape(self.origin) != (3,):
            raise ValueError(f"space.origin: got shape {np.shape(self.origin)}, expected (3,)")
        if not self.resolution > 0.0:
            raise ValueError(f"space.resolution: got {self.resolution}, expected above 0")
        if self.collision_distance_sq < 0:
            got = f"{self.collision_distance_sq}"
            raise ValueError(f"space.collision_distance_sq: got {got}, expected 0 or more")
        least = min((disc.collision_distance_sq for disc in self.discs), default=None)
        if least not in (None, self.collision_distance_sq):
            raise ValueError(
                f"space.discs: got a least threshold of {least}, "
                f"expected collision_distance_sq, {self.collision_distance_sq}"
            )
        costs = self.cost_by_distance[self.collision_distance_sq + 1 :]
        if len(costs) == 0 or not (costs.min() >= 0.0 and costs.max() < math.inf):
            raise ValueError(
                f"space.cost_by_distance: got {costs} above squared distance "
                f"{self.collision_distance_sq}, expected finite costs of 0 or more"
            )
        if self.prices is not None and self.prices.shape != field.shape:
            got = f"{self.prices.shape}"
            raise ValueError(f"space.prices: got {got}, expected one a cell, {field.shape}")
        if not all(0.0 <= cost < math.inf for cost in self.cost_by_price):
            raise ValueError(
                f"space.cost_by_price: got {self.cost_by_price}, expected finite costs of 0 or more"
            )

    @property
    def flat(self) -> bool:
        """Whether it is a plane, for a robot on the ground."""
        return bool(self.grid.field.shape[2] == 1)

    def is_free(self, point: Floats) -> bool:
        """Return whether a point lies in a free cell."""
        return self.edge_free(point, point)

    def edge_free(self, a: Floats, b: Floats) -> bool:
        """Return whether every cell that the segment from `a` to `b` touches is free."""
        return bool(segment.edge_free(self.grid, self.collision_distance_sq, _point(a), _point(b)))

    def free_length(self, path: Floats) -> float:
        """Return the arc length along a polyline (n, 3) before its first forbidden cell, m.

        Ends two sub-cells (2/65536 of a cell) short of that cell's face; 0 if the start is
        forbidden, the whole length if nothing is. A body of discs heads along the path, nose or
        tail first, and turns at its points; for it the length ends with a whole edge.
        """
        if self.discs:
            points = np.ascontiguousarray(path, dtype=np.float64)
            return float(headed.walk_headed(self.grid, self.shape, points)[0])
        return float(self._walk(path, self.collision_distance_sq, 0.0)[0])

    def first_forbidden(self, path: Floats) -> NDArray[np.int64] | None:
        """Return the forbidden cell (3,) that ends the free length of a path (n, 3); None if none.

        The body's centre is in it, or that of one of its discs; it may lie outside of the array.
        """
        if self.discs:
            points = np.ascontiguousarray(path, dtype=np.float64)
            _, found, cell = headed.walk_headed(self.grid, self.shape, points)
        else:
            _, least, _, cell = self._walk(path, self.collision_distance_sq, 0.0)
            found = least <= self.collision_distance_sq
        return np.array(cell) if found else None

    def first_forbidden_pose(self, poses: Floats) -> tuple[int, NDArray[np.int64] | None]:
        """Return the first of poses (n, 4) that the body cannot get to, and the cell (3,) it meets.

        The last one and None if it can get to all.
        """
        _, reached, cell = self._walk_poses(poses)
        return (reached, np.array(cell)) if reached < len(poses) else (len(poses) - 1, None)

    def nearest_free(self, point: Floats, radius: float) -> Floats | None:
        """Return the centre (3,) of the nearest free cell at most `radius`, m, away, or None.

        Of several equally near the one of the lowest index.
        """
        found, *cell = segment.nearest_free(
            self.grid, self.collision_distance_sq, _point(point), radius / self.resolution
        )
        if not found:
            return None
        centre: Floats = self.grid.origin + (np.array(cell) + 0.5) * self.resolution
        return centre

    def least_clearance(self, path: Floats) -> float:
        """Return the least distance to a blocked cell over the cells that a path (n, 3) touches, m.

        Between cell centres, truncated where the field is; 0 if the path leaves the grid.
        """
        least = self._walk(path, OUTSIDE, 0.0)[1]
        return math.sqrt(max(least, 0)) * self.resolution

    def path_cost(self, path: Floats, clearance_weight: float = CLEARANCE_WEIGHT) -> float:
        """Return the integral of 1 + weight * cost along a path, m, exact cell by cell.

        Args:
            path: Polyline, m, shape (n, 3).
            clearance_weight: Weight of the cell cost against length.

        Returns:
            The cost, infinite if the path touches a forbidden cell.
        """
        _, least, cost, _ = self._walk(path, self.collision_distance_sq, clearance_weight)
        return float(cost) if least > self.collision_distance_sq else math.inf

    def sweep_free(self, a: Floats, b: Floats) -> bool:
        """Return whether the body is free all the way between two poses (x, y, z, heading).

        Position and heading change evenly, the heading by the shorter way round.
        """
        return bool(sweep.sweep_free(self.grid, self.shape, _pose(a), _pose(b)))

    def pose_free(self, point: Floats, heading: float) -> bool:
        """Return whether the body is free at a point and heading, rad."""
        pose = (*_point(point), float(heading))
        return bool(sweep.sweep_free(self.grid, self.shape, pose, pose))

    def turn_free(self, point: Floats, heading: float, target: float) -> bool:
        """Return whether the body can turn on the spot between two headings, the shorter way."""
        place = _point(point)
        before, after = (*place, float(heading)), (*place, float(target))
        return bool(sweep.sweep_free(self.grid, self.shape, before, after))

    def nearest_pose(self, point: Floats, radius: float, headings: Floats) -> Floats | None:
        """Return the pose (4,) nearest to a point and free at one of the headings, or None.

        At a cell's centre, at most `radius`, m, away.
        """
        pose = (*_point(point), 0.0)
        cells = radius / self.resolution
        found, pose = sweep.nearest_pose(self.grid, self.shape, pose, cells, headings)
        return np.array(pose) if found else None

    def turning_room(self) -> float:
        """Return the distance that the reference point needs to turn to any heading, cells."""
        rooms = (
            abs(offset) / self.resolution + math.sqrt(threshold)
            for offset, threshold in zip(self.shape.offsets, self.shape.thresholds, strict=True)
        )
        return float(max(rooms))

    def turnable(self, points: Floats) -> NDArray[np.bool_]:
        """Return whether the body can turn to any heading at each of points (n, 3): (n,)."""
        cells = np.floor((points - self.grid.origin) / self.resolution).astype(np.int64)
        cells = np.clip(cells, 0, np.array(self.grid.field.shape) - 1)
        room = self.turning_room()
        wide: NDArray[np.bool_] = self.distances[tuple(cells.T)] > room * room
        return wide

    def free_poses(self, poses: Floats) -> int:
        """Return the number of poses (n, 4) that the body reaches one after the other."""
        return self._walk_poses(poses)[1]

    def sweep_cost(self, poses: Floats, clearance_weight: float = CLEARANCE_WEIGHT) -> float:
        """Return the cost of a body's way through poses (n, 4), m; infinite if it is not free.

        The integral of 1 + weight * (mean cost of the discs' cells) along the reference point's
        path, more where it is not along the heading, and a cost of each turn (see
        `kernels.sweep_cost`).
        """
        poses = np.ascontiguousarray(poses, dtype=np.float64)
        return float(sweep_cost.poses_cost(self.grid, self.shape, float(clearance_weight), poses))

    def free_sweep_length(self, poses: Floats) -> float:
        """Return the length of a way through poses (n, 4) before a forbidden cell, m.

        Along the reference point's path, in whole steps of a sweep.
        """
        return self._walk_poses(poses)[0]

    def _walk(self, path: Floats, threshold: int, weight: float) -> segment.Walked:
        points = np.ascontiguousarray(path, dtype=np.float64)
        walked: segment.Walked = segment.walk_path(self.grid, threshold, float(weight), points)
        return walked

    def _walk_poses(self, poses: Floats) -> tuple[float, int, Cell]:
        poses = np.ascontiguousarray(poses, dtype=np.float64)
        walked: tuple[float, int, Cell] = sweep.walk_poses(self.grid, self.shape, poses)
        return walked


@functools.lru_cache(maxsize=4)
def _no_prices(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the prices of a grid without any, which nothing writes to."""
    return np.zeros(shape, np.uint8)


def _point(point: Floats) -> Point:
    return float(point[0]), float(point[1]), float(point[2])


def _pose(pose: Floats) -> Pose:
    return float(pose[0]), float(pose[1]), float(pose[2]), float(pose[3])
