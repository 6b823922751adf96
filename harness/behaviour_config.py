"""Settings of the section `behaviour`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from wayproof.bounds import Bounds, check_fields

MIN_ADVANCE = 0.3
"""Shortest committed part worth leaving rest for, m; chosen: two to three cells."""

MAX_CORNER_ANGLE = 0.9
"""Sharpest corner taken without a stop, rad; chosen: a little more than half a right angle."""


@dataclass(frozen=True)
class BehaviourConfig:
    """When the stack waits, recovers and gives up.

    Attributes:
        wait_timeout: Time at rest before the robot explores, s.
        max_recoveries: Frontiers it explores before the action is `abort`.
        tracking_tolerance: Distance from its trajectory beyond which the robot has left it, m.
        rotate_in_place_angle: Heading error beyond which a ground robot at rest turns in place,
            rad.
        blend_length: Longest stretch on each side of a corner over which it is rounded, m.
        unknown_speed_fraction: Fraction of the speed while unknown space is entered under
            `penalize`.
        unknown_cost: Cost of unknown space to a global path; a cell at the edge of the inflation
            costs 1. The robot may have to stop before unknown space. A sixteenth of it to a robot
            that flies, on a path that it sees far enough ahead.
        goal_search_radius: Distance within which a goal inside the inflation is projected to the
            nearest free place, m.
        goal_wait_timeout: Time that the robot waits there for the goal to become free, s.
        max_backtracks: Times it goes back along its own trail before the action is `abort`.
        reverse_speed_fraction: Fraction of the speed at which an elongated body moves tail first.
        narrow_speed_fraction: Fraction of the speed with the oriented footprint: in clutter,
            obstacles are seen late.
        uncertain_sigma: Standard deviation of the position beyond which the robot slows down, m.
            For estimators that state a covariance, where the sweeps do not hold the position.
        uncertain_speed_fraction: Fraction of the speed beyond `uncertain_sigma` or `noisy_sigma`.
        noisy_sigma: Standard deviation of a sweep's ranges beyond which the robot slows down, m.
            Half a cell: echoes then fall into the cells beside theirs.
        lost_sigma: Standard deviation of the position beyond which the robot goes back to where the
            sweeps held it, or gives up, m.
        max_returns: Times it goes back for `lost_sigma` before the action is `abort`.

    Raises:
        ValueError: A value is out of its bounds.
    """

    wait_timeout: Annotated[float, Bounds(1e-9, 1e6, "s")] = 1.0
    max_recoveries: Annotated[int, Bounds(1, 1e6)] = 12
    tracking_tolerance: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.8
    rotate_in_place_angle: Annotated[float, Bounds(1e-9, 1e6, "rad")] = 0.6
    blend_length: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.6
    unknown_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.4
    unknown_cost: Annotated[float, Bounds(1e-9, 1e6)] = 4.0
    goal_search_radius: Annotated[float, Bounds(1e-9, 1e6, "m")] = 1.0
    goal_wait_timeout: Annotated[float, Bounds(1e-9, 1e6, "s")] = 5.0
    max_backtracks: Annotated[int, Bounds(1, 1e6)] = 2
    reverse_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.4
    narrow_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.7
    uncertain_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.1
    uncertain_speed_fraction: Annotated[float, Bounds(1e-9, 1.0)] = 0.5
    noisy_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.05
    lost_sigma: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.5
    max_returns: Annotated[int, Bounds(0, 1e6)] = 1

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "behaviour.")
