"""A stack that drives straight at the goal: a baseline for the referee and its guard alone."""

from __future__ import annotations

import math

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.interface.types import Command, Observation, Task, Velocity

TURN_FIRST_RAD = 0.5
"""Heading error beyond which it turns on the spot, rad."""

SLOW_DOWN_S = 1.0
"""Time to the goal below which it slows down, s."""


class Blind:
    """Drives straight at the goal."""

    def start(self, task: Task) -> None:
        """Keep the limits."""
        self._task = task

    def step(self, observation: Observation) -> Command:
        """Return a velocity towards the goal."""
        mission = self._task.mission
        reference = observation.reference
        dx, dy, dz = (observation.goal - reference.position).tolist()
        away = math.hypot(dx, dy) if mission.motion == "ground" else math.hypot(dx, dy, dz)
        if away <= 0.5 * self._task.goal_tolerance:
            return Command(Velocity(0.0))
        error = wrap_angle(math.atan2(dy, dx) - reference.heading)
        yaw_rate = max(-mission.max_yaw_rate, min(mission.max_yaw_rate, 2.0 * error))
        if mission.motion == "ground" and abs(error) > TURN_FIRST_RAD:
            return Command(Velocity(0.0, yaw_rate=yaw_rate))
        speed = min(mission.max_speed, away / SLOW_DOWN_S)
        cosine, sine = math.cos(error), math.sin(error)
        flat = math.hypot(dx, dy) / away
        up = 0.0 if mission.motion == "ground" else speed * dz / away
        return Command(
            Velocity(speed * flat * cosine, speed * flat * sine, up, yaw_rate),
            scalars={"away_m": away},
        )

    def close(self) -> None:
        """Do nothing: there is nothing to end."""
