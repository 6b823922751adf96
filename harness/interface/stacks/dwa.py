"""Dynamic window approach: the best admissible velocity over a local grid of recent returns.

Fox, Burgard and Thrun 1997, "The dynamic window approach to collision avoidance", IEEE Robotics and
Automation Magazine 4(1), pages 23 to 33: the search space V_r of the possible velocities V_s that
are admissible (V_a) and inside the dynamic window (V_d), and the objective function of heading,
distance and velocity. The heading is that of the shortest path through the local grid, by a
navigation function (Brock and Khatib 1999, "High-speed navigation using the global dynamic window
approach", ICRA), in place of the goal's own. Nav2's DWB controller scores likewise: base obstacle,
path align and goal distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.interface.returns import body_returns
from wayproof.harness.interface.types import Array, Command, Observation, Reference, Task, Velocity

CELL_M = 0.1
"""Side of a cell of the local grid, m."""

CELLS = 100
"""Cells along each side of the local grid, which is centred on the robot."""

DECAY_S = 5.0
"""Time after its last return at which a cell counts as free again, s."""

MARGIN_M, LEAST_MARGIN_M = 0.2, 0.08
"""Distance kept to occupied cells beyond the body, m: as a rule, and where nothing else fits."""

NARROWING_M, WIDENING_M = 0.01, 0.002
"""Change of the margin with each command that stands still, and with each that moves, m."""

STILL_MPS, STILL_RADPS = 0.05, 0.1
"""Speed and yaw rate below which a command stands still."""

COMFORT_M = 0.4
"""Clearance beyond the margin above which more of it is worth nothing, m."""

HOLD_S = 0.3
"""Time for which a velocity is commanded and for which the window reaches, s."""

HORIZON_S, STEP_S = 2.0, 0.1
"""Time for which each velocity is simulated, and the time between two of its poses, s."""

AHEAD_M = 0.8
"""Length of path to the point that sets the heading, m."""

HEADING, CLEARANCE, PROGRESS = 0.6, 0.3, 1.0
"""Weights of the objective function: its alpha, beta and gamma."""

REVERSE_MPS = 0.2
"""Fastest speed backwards of a robot that walks, m/s."""


@dataclass(frozen=True)
class Surroundings:
    """The local grid at one instant.

    Attributes:
        corner: (2,) low corner, world frame, m.
        distances: (CELLS, CELLS) from each cell to the nearest occupied one, m.
    """

    corner: Array
    distances: Array

    def cells(self, points: Array) -> NDArray[np.int64]:
        """Return cells (..., 2) of points (..., 2), world frame, m; outside the nearest ones."""
        cells = np.floor((points - self.corner) / CELL_M).astype(np.int64)
        return np.clip(cells, 0, CELLS - 1)

    def centres(self) -> Array:
        """Return centres (CELLS, CELLS, 2), world frame, m."""
        return self.corner + (np.moveaxis(np.indices((CELLS, CELLS)), 0, -1) + 0.5) * CELL_M

    def distances_at(self, points: Array) -> Array:
        """Return distances (...) of points (..., 2) to occupied cells, m, interpolated."""
        from scipy.ndimage import map_coordinates  # scipy is slow to load

        places = np.moveaxis((points - self.corner) / CELL_M - 0.5, -1, 0)
        at: Array = map_coordinates(self.distances, places, order=1, mode="nearest")
        return at


class LocalGrid:
    """Cells with a recent return around the robot."""

    def __init__(self) -> None:
        """Start without returns."""
        self._last_return: dict[tuple[int, int], float] = {}  # cell of the world -> time, s

    def update(self, position: Array, returns: Array, now_s: float) -> Surroundings:
        """Add returns (k, 3) at height of the body, and forget old ones."""
        from scipy.ndimage import distance_transform_edt

        cells = np.unique(np.floor(returns[:, :2] / CELL_M).astype(np.int64), axis=0)
        self._last_return.update(dict.fromkeys(map(tuple, cells.tolist()), now_s))
        low: NDArray[np.int64] = np.floor(position[:2] / CELL_M).astype(np.int64) - CELLS // 2
        x, y = low.tolist()
        self._last_return = {
            (i, j): seen
            for (i, j), seen in self._last_return.items()
            if now_s - seen < DECAY_S and 0 <= i - x < CELLS and 0 <= j - y < CELLS
        }
        free = np.ones((CELLS, CELLS), np.bool_)
        for i, j in self._last_return:
            free[i - x, j - y] = False
        far = np.full(free.shape, CELLS * CELL_M)
        distances = far if free.all() else distance_transform_edt(free) * CELL_M
        return Surroundings(low.astype(np.float64) * CELL_M, distances)


class NavigationFunction:
    """Cost of the shortest path from every cell of the surroundings to the goal.

    Beyond the border of the grid the way is taken to be straight.
    """

    def __init__(self, radius: float) -> None:
        """Join each cell to its eight neighbours.

        Args:
            radius: Radius of the body, inscribed, m.
        """
        self._radius = radius
        numbers = np.arange(CELLS**2).reshape(CELLS, CELLS)
        pairs = [
            (numbers[1:], numbers[:-1], 1.0),
            (numbers[:, 1:], numbers[:, :-1], 1.0),
            (numbers[1:, 1:], numbers[:-1, :-1], math.sqrt(2.0)),
            (numbers[1:, :-1], numbers[:-1, 1:], math.sqrt(2.0)),
        ]
        self._one = np.concatenate([one.ravel() for one, _, _ in pairs])
        self._other = np.concatenate([other.ravel() for _, other, _ in pairs])
        self._lengths = np.concatenate([np.full(one.size, step) for one, _, step in pairs]) * CELL_M
        edge = np.ones((CELLS, CELLS), np.bool_)
        edge[1:-1, 1:-1] = False
        self._border = numbers[edge]

    def solve(
        self, around: Surroundings, goal: Array, margin: float
    ) -> tuple[Array, NDArray[np.int32]]:
        """Return costs (CELLS^2 + 1,), m, and the next cell on the path to the goal, by cell.

        The last entry is the goal itself; the next cell of a cell that joins it is the goal.
        """
        room = (around.distances - self._radius - margin).ravel()
        factors = 1.0 + 3.0 * np.clip(1.0 - room / COMFORT_M, 0.0, 1.0)
        factors[room <= 0.0] = 100.0  # not forbidden: the robot may be in there
        weights = self._lengths * 0.5 * (factors[self._one] + factors[self._other])
        offset = goal[:2] - around.corner
        inside = bool(((offset >= 0.0) & (offset < CELLS * CELL_M)).all())
        i, j = around.cells(goal[:2]).tolist()
        joined = np.array([i * CELLS + j]) if inside else self._border
        away = around.centres().reshape(-1, 2)[joined] - goal[:2]
        far = np.sqrt(np.square(away).sum(axis=1)) + 1e-6
        one = np.concatenate([self._one, joined])
        other = np.concatenate([self._other, np.full(len(joined), CELLS**2)])
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra

        graph = coo_matrix(
            (np.concatenate([weights, far]), (one, other)), shape=(CELLS**2 + 1,) * 2
        )
        costs, following = dijkstra(
            graph.tocsr(), directed=False, indices=CELLS**2, return_predecessors=True
        )
        return costs, following


class Dwa:
    """Chooses the best velocity that the body reaches at once and can brake from in time."""

    def start(self, task: Task) -> None:
        """Keep the task; begin with an empty grid."""
        self._task = task
        mission = task.mission
        self._discs = mission.body_discs
        self._grid = LocalGrid()
        self._function = NavigationFunction(max(radius for _, radius in self._discs))
        self._turn, self._margin = 1.0, MARGIN_M
        self._yaw_acceleration = mission.max_acceleration * mission.max_yaw_rate / mission.max_speed

    def step(self, observation: Observation) -> Command:
        """Return the velocity of greatest objective in the search space V_r."""
        mission, reference = self._task.mission, observation.reference
        goal = observation.goal
        offset = (goal - reference.position)[: mission.axes]
        away = math.sqrt(float(np.square(offset).sum()))
        returns = body_returns(observation, mission)
        around = self._grid.update(reference.position, returns, observation.time_ns * 1e-9)
        if away <= 0.5 * self._task.goal_tolerance:
            return Command(Velocity(0.0))
        costs, following = self._function.solve(around, goal, self._margin)
        path = self._path(around, following, reference.position, goal)
        target = path[min(round(AHEAD_M / CELL_M), len(path) - 1), :2]
        x, y = (target - reference.position[:2]).tolist()
        bearing = wrap_angle(math.atan2(y, x) - reference.heading)
        twists = self._window(observation, away, bearing)
        poses = self._simulate(twists, reference)
        clearances = self._clearances(around, poses)
        admissible = self._admissible(twists, clearances)
        moving = np.abs(twists[:, :2]).max(axis=1) > STILL_MPS
        up = 0.0 if mission.planar else min(max(float(offset[2]), -0.5), 0.5)
        if not (admissible & moving).any():
            self._margin = max(self._margin - NARROWING_M, LEAST_MARGIN_M)
            return self._recover(bearing, up, path)
        self._turn = 1.0 if bearing >= 0.0 else -1.0
        score = self._objective(around, costs, bearing, poses, clearances)
        best = int(np.argmax(np.where(admissible, score, -np.inf)))
        forward, left, yaw_rate = twists[best].tolist()
        if moving[best] or abs(yaw_rate) > STILL_RADPS:
            self._margin = min(self._margin + WIDENING_M, MARGIN_M)
        else:
            self._margin = max(self._margin - NARROWING_M, LEAST_MARGIN_M)
        return Command(
            Velocity(forward, left, up, yaw_rate, HOLD_S),
            planned_path=path,
            scalars={"clearance_m": float(clearances[best].min()), "score": float(score[best])},
        )

    def close(self) -> None:
        """Do nothing: there is nothing to end."""

    def _path(
        self, around: Surroundings, following: NDArray[np.int32], position: Array, goal: Array
    ) -> Array:
        """Return the shortest path (n, 3) to the goal, world frame, m, a point for each cell."""
        i, j = around.cells(position[:2]).tolist()
        cells = [i * CELLS + j]
        while (cell := int(following[cells[-1]])) != CELLS**2:
            cells.append(cell)
        centres = around.corner + (np.stack(divmod(np.array(cells), CELLS), axis=-1) + 0.5) * CELL_M
        heights = np.full((len(cells), 1), position[2])
        return np.vstack([np.hstack([centres, heights]), [*goal[:2], position[2]]])

    def _window(self, observation: Observation, away: float, bearing: float) -> Array:
        """Return twists (m, 3) forward, left, m/s, and yaw rate, rad/s: in V_s and V_d.

        A robot that walks goes forward and turns; one that flies goes anywhere, headed to its path.
        """
        mission, reference = self._task.mission, observation.reference
        reach, turn = mission.max_acceleration * HOLD_S, self._yaw_acceleration * HOLD_S
        fastest = min(mission.max_speed, math.sqrt(mission.max_acceleration * away))
        now = _in_body(reference.velocity, reference.heading)
        if mission.planar:
            low = min(max(now[0] - reach, -REVERSE_MPS), fastest)
            speeds = np.linspace(low, max(min(now[0] + reach, fastest), low), 8)
            least = max(reference.yaw_rate - turn, -mission.max_yaw_rate)
            rates = np.linspace(least, min(reference.yaw_rate + turn, mission.max_yaw_rate), 15)
            grid = np.meshgrid(np.append(speeds, 0.0), 0.0, np.append(rates, 0.0), indexing="ij")
            return np.stack([part.ravel() for part in grid], axis=1)
        yaw_rate = min(max(2.0 * bearing, -mission.max_yaw_rate), mission.max_yaw_rate)
        courses = bearing + np.arange(24) * (math.pi / 12.0)
        speeds = np.linspace(0.0, fastest, 7)[1:, None]
        targets = np.stack([speeds * np.cos(courses), speeds * np.sin(courses)], axis=-1)
        changes = np.vstack([np.zeros((1, 2)), targets.reshape(-1, 2)]) - now
        sizes = np.sqrt(np.square(changes).sum(axis=1, keepdims=True))
        flat = now + changes * np.minimum(1.0, reach / np.maximum(sizes, 1e-9))
        return np.column_stack([flat, np.full(len(flat), yaw_rate)])

    def _simulate(self, twists: Array, reference: Reference) -> Array:
        """Roll out twists (m, 3) within the limits: poses (m, k, 3) x, y, m, and heading, rad."""
        largest = self._task.mission.max_acceleration * STEP_S
        turn = self._yaw_acceleration * STEP_S
        velocity = np.tile(reference.velocity[:2], (len(twists), 1))
        rate = np.full(len(twists), reference.yaw_rate)
        pose = np.tile([*reference.position[:2], reference.heading], (len(twists), 1))
        poses = [pose]
        for _ in range(round(HORIZON_S / STEP_S)):
            rate = rate + np.clip(twists[:, 2] - rate, -turn, turn)
            heading = pose[:, 2] + rate * STEP_S
            cosines, sines = np.cos(heading), np.sin(heading)
            forward, left = twists[:, 0], twists[:, 1]
            aimed = np.stack(
                [forward * cosines - left * sines, forward * sines + left * cosines], 1
            )
            change = aimed - velocity
            size = np.sqrt(np.square(change).sum(axis=1, keepdims=True))
            velocity = velocity + change * np.minimum(1.0, largest / np.maximum(size, 1e-9))
            pose = np.column_stack([pose[:, :2] + velocity * STEP_S, heading])
            poses.append(pose)
        return np.stack(poses, axis=1)

    def _clearances(self, around: Surroundings, poses: Array) -> Array:
        """Return the least clearance (m, k) of the body beyond the margin at poses (m, k, 3), m."""
        headings = poses[..., 2]
        axes = np.stack([np.cos(headings), np.sin(headings)], axis=-1)
        parts = [
            around.distances_at(poses[..., :2] + along * axes) - radius
            for along, radius in self._discs
        ]
        least: Array = np.min(parts, axis=0) - self._margin
        return least

    def _free_steps(self, clearances: Array) -> NDArray[np.int64]:
        """Return the number (m,) of the last pose before the body hits anything.

        A body that is within the margin already may move if it does not come nearer.
        """
        hit = clearances < np.minimum(0.0, clearances[:, :1] - 1e-9)
        last = clearances.shape[1] - 1
        steps: NDArray[np.int64] = np.where(
            hit.any(axis=1), np.maximum(hit.argmax(axis=1) - 1, 0), last
        )
        return steps

    def _admissible(self, twists: Array, clearances: Array) -> NDArray[np.bool_]:
        """Return whether (m,) the body comes to rest before it hits anything: V_a."""
        speeds = np.sqrt(np.square(twists[:, :2]).sum(axis=1))
        braking = 0.5 * speeds / self._task.mission.max_acceleration
        turning = 0.5 * np.abs(twists[:, 2]) / self._yaw_acceleration
        free_s = self._free_steps(clearances) * STEP_S
        fits: NDArray[np.bool_] = free_s >= HOLD_S + np.maximum(braking, turning)
        return fits

    def _objective(
        self, around: Surroundings, costs: Array, bearing: float, poses: Array, clearances: Array
    ) -> Array:
        """Return the objective (m,): heading, clearance, and progress in place of the velocity."""
        turned = poses[:, round(1.0 / STEP_S), 2] - poses[:, 0, 2]
        error = np.abs((turned - bearing + math.pi) % (2.0 * math.pi) - math.pi)
        kept = np.clip(clearances.min(axis=1) / COMFORT_M, 0.0, 1.0)
        cells = around.cells(poses[:, :, :2])
        cost = costs[cells[..., 0] * CELLS + cells[..., 1]]
        steps = np.minimum(np.arange(cost.shape[1]), self._free_steps(clearances)[:, None])
        best = np.minimum.accumulate(np.take_along_axis(cost, steps, axis=1), axis=1)
        gained = 2.0 * (cost[:, 0] - best.mean(axis=1))
        progress = np.clip(gained / (self._task.mission.max_speed * HORIZON_S), 0.0, 1.0)
        score: Array = HEADING * (1.0 - error / math.pi) + CLEARANCE * kept + PROGRESS * progress
        return score

    def _recover(self, bearing: float, up: float, path: Array) -> Command:
        """Rotate on the spot towards the path, and on beyond it, until a velocity is admissible."""
        if abs(bearing) > 0.5:
            self._turn = 1.0 if bearing >= 0.0 else -1.0
        rate = 0.5 * self._turn * self._task.mission.max_yaw_rate
        motion = Velocity(forward=0.0, left=0.0, up=up, yaw_rate=rate, duration_s=HOLD_S)
        return Command(motion, planned_path=path, scalars={"recovering": 1.0})


def _in_body(velocity: Array, heading: float) -> Array:
    """Return the horizontal part (2,) of a velocity of the world in the body's frame, m/s."""
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y = velocity[:2].tolist()
    return np.array([cosine * x + sine * y, cosine * y - sine * x])
