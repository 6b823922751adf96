"""From where the body should be to how fast it should walk."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from models.robots.quadruped.parameters import Tracking
from models.robots.robot import Setpoint

Array = NDArray[np.float64]


class Tracker:
    """Velocity feed-forward plus proportional feedback, clipped to what the gait can do.

    A setpoint at rest counts as reached inside a small circle and as lost outside a larger one,
    so that the robot stands still there instead of stepping after millimetres.
    """

    def __init__(self, tracking: Tracking, resting_speed: float) -> None:
        """Start on the way.

        Args:
            tracking: Gains and limits.
            resting_speed: A setpoint slower than this is at rest, m/s and rad/s.
        """
        self._tracking = tracking
        self._resting_speed = resting_speed
        self._arrived = False

    def velocity_command(self, position: Array, yaw: float, setpoint: Setpoint) -> Array:
        """Forward m/s, left m/s and yaw rate rad/s, (3,), in the body's yaw frame.

        Args:
            position: (3,) base origin, world, m.
            yaw: Heading of the base, rad.
            setpoint: Where it should be now.

        Raises:
            ValueError: The setpoint is not finite.
        """
        t = self._tracking
        ((to_x, to_y, _), (vx, vy, _), heading, yaw_rate), (x, y, _) = setpoint, position.tolist()
        dx, dy = to_x - x, to_y - y
        turn = heading - yaw
        turn = math.atan2(math.sin(turn), math.cos(turn))
        moving = max(math.hypot(vx, vy), abs(yaw_rate)) > self._resting_speed
        if self._stays(moving, math.hypot(dx, dy), abs(turn)):
            return np.zeros(3)
        vx += t.position_gain * dx
        vy += t.position_gain * dy
        rate = yaw_rate + t.heading_gain * turn
        if not math.isfinite(vx + vy + rate):
            raise ValueError(f"setpoint: got {setpoint}, expected finite numbers")
        c, s = math.cos(yaw), math.sin(yaw)
        forward = min(max(c * vx + s * vy, t.forward_low), t.forward_high)
        left = min(max(c * vy - s * vx, -t.lateral), t.lateral)
        return np.array([forward, left, min(max(rate, -t.yaw_rate), t.yaw_rate)])

    def _stays(self, moving: bool, distance: float, angle: float) -> bool:
        t = self._tracking
        if moving:
            self._arrived = False
        elif self._arrived:
            self._arrived = distance < t.depart_distance and angle < t.depart_angle
        else:
            self._arrived = distance < t.arrive_distance and angle < t.arrive_angle
        return self._arrived

    def state(self) -> dict[str, NDArray[np.bool_]]:
        """What one call hands to the next."""
        return {"arrived": np.array(self._arrived)}

    def restore(self, state: dict[str, NDArray[np.bool_]]) -> None:
        """Go on from what `state` returned."""
        self._arrived = bool(state["arrived"])
