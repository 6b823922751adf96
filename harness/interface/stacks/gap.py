"""Follow the gap: steer into the free direction nearest to the goal's, without a map.

After Sezer and Gokasan 2012, "A novel obstacle avoidance algorithm: Follow the Gap Method",
Robotics and Autonomous Systems 60(9). Theirs takes the largest gap, and a heading between its
centre and the goal; here each bearing has a cost: the turn away from the goal, the turn away from
the last course, and the free range that it lacks. Returns are widened by the body.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.interface.types import Array, Command, Observation, Task, Velocity

BEARINGS = 180
"""Directions around the body that are kept apart."""

REACH_M = 4.0
"""Range within which returns count, m."""

MARGIN_M = 0.15
"""Distance kept to returns beyond the body's radius, m."""

KEEP = 0.5
"""Cost of a turn away from the last direction, as a share of one away from the goal's."""

AHEAD_S = 1.5
"""Time in which the free range ahead would be driven; it sets the speed, s."""


class Gap:
    """Steers into the free direction nearest to the goal's."""

    def start(self, task: Task) -> None:
        """Keep the goal, the limits and the size of the body, which goes along its axis."""
        self._task = task
        mission = task.mission
        self._length = mission.radius + MARGIN_M
        self._width = max([radius for _, radius in mission.discs] or [mission.radius]) + MARGIN_M
        self._course = mission.start_heading

    def step(self, observation: Observation) -> Command:
        """Return a velocity into the best gap."""
        mission, reference = self._task.mission, observation.reference
        dx, dy, dz = (observation.goal - reference.position).tolist()
        away = math.hypot(dx, dy)
        if away <= 0.5 * self._task.goal_tolerance:
            return Command(Velocity(0.0))
        free = self._free_ranges(observation)
        goal_bearing = wrap_angle(math.atan2(dy, dx) - reference.heading)
        bearings = (np.arange(BEARINGS, dtype=np.float64) + 0.5) * (
            2.0 * math.pi / BEARINGS
        ) - math.pi
        reach = min(REACH_M, max(away, 1.0))
        cost = _turns(bearings, goal_bearing) + 4.0 * np.maximum(1.0 - free / reach, 0.0)
        cost += KEEP * _turns(bearings, self._course - reference.heading)
        best = int(np.argmin(cost))
        bearing, room = float(bearings[best]), float(free[best])
        self._course = reference.heading + bearing
        yaw_rate = max(-mission.max_yaw_rate, min(mission.max_yaw_rate, 2.0 * bearing))
        up = 0.0 if mission.motion == "ground" else max(-0.5, min(0.5, dz))
        if abs(bearing) > 0.5:
            return Command(Velocity(0.0, 0.0, up, yaw_rate), scalars={"gap_m": room})
        speed = min(mission.max_speed, room / AHEAD_S, away)
        return Command(Velocity(speed, 0.0, up, yaw_rate), scalars={"gap_m": room})

    def close(self) -> None:
        """Do nothing: there is nothing to end."""

    def _free_ranges(self, observation: Observation) -> Array:
        """Return the free range of the body's centre by bearing in its frame, (BEARINGS,) m."""
        points = np.vstack([sweep.points for sweep in observation.sweeps] or [np.zeros((0, 3))])
        offsets = points - observation.position
        mission = self._task.mission
        low, high = -0.5 * mission.height, 0.5 * mission.height + 0.1
        if mission.motion == "ground":
            low, high = mission.step_height - observation.position[2], 0.3
        near = (offsets[:, 2] > low) & (offsets[:, 2] < high)
        offsets = offsets[near & (np.square(offsets[:, :2]).sum(axis=1) < REACH_M**2)]
        distances = np.sqrt(np.square(offsets[:, :2]).sum(axis=1))
        heading = observation.reference.heading
        angles = np.arctan2(offsets[:, 1], offsets[:, 0]) - heading
        free = np.full(BEARINGS, REACH_M)
        bins = np.floor(((angles + math.pi) % (2.0 * math.pi)) * BEARINGS / (2.0 * math.pi))
        nearest = np.full(BEARINGS, np.inf)
        np.minimum.at(nearest, np.clip(bins.astype(np.int64), 0, BEARINGS - 1), distances)
        for index in np.flatnonzero(np.isfinite(nearest)).tolist():
            distance = float(nearest[index])
            half = math.asin(min(1.0, self._width / max(distance, self._width)))
            spread = math.ceil(half * BEARINGS / (2.0 * math.pi))
            covered = (index + np.arange(-spread, spread + 1)) % BEARINGS
            free[covered] = np.minimum(free[covered], max(distance - self._length, 0.0))
        return free


def _turns(bearings: Array, bearing: float) -> Array:
    """Return angles (n,) between bearings (n,) and one of them, rad."""
    turns: Array = np.abs((bearings - bearing + math.pi) % (2.0 * math.pi) - math.pi)
    return turns
