"""Figures of one run of a robot under trial."""

from __future__ import annotations

from typing import NamedTuple


class Run(NamedTuple):
    """One run, with the figures that its trial has.

    Attributes:
        fallen: Whether it fell or crashed.
        seconds: Simulated time, s.
        arrived: Whether it crossed the course.
        errors: RMS errors of velocity: forward and left, m/s, and yaw rate, rad/s.
        error: RMS distance from the path or the moving setpoint, m.
        distance: Distance of a stop, m.
        creep: Greatest way of a foot on which it stood, m.
        top_speed: Greatest speed, m/s.
        energy: Energy of the rotors, J.
    """

    fallen: bool
    seconds: float = 0.0
    arrived: bool | None = None
    errors: tuple[float, float, float] | None = None
    error: float | None = None
    distance: float | None = None
    creep: float | None = None
    top_speed: float | None = None
    energy: float | None = None
