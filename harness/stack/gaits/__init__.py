"""Gaits: how bodies move along a path."""

from __future__ import annotations

from wayproof.harness.mission import Mission
from wayproof.harness.stack.gait import Gait
from wayproof.harness.stack.gaits.any_direction import AnyDirection
from wayproof.harness.stack.gaits.flight import Flight
from wayproof.harness.stack.gaits.turn_then_go import TurnThenGo
from wayproof.planners import MotionLimits

GAITS: tuple[type[Gait], ...] = (Flight, AnyDirection, TurnThenGo)
"""Gaits by precedence: one that may move more freely comes before one that may not."""


def gait_of(mission: Mission, limits: MotionLimits, omnidirectional: bool) -> Gait:
    """Return the first gait that suits a mission's body.

    Args:
        mission: Mission with the body.
        limits: Greatest speed, acceleration, jerk and yaw rate of a command.
        omnidirectional: Whether the sensors see all around, as `is_omnidirectional` says.
    """
    kind = next(gait for gait in GAITS if gait.suits(mission))
    return kind(limits, mission.body_discs, mission.sideways_speed, omnidirectional)
