"""Faults of the body: it differs from the stack's model, or leaves its path."""

from __future__ import annotations

from typing import Any

import mujoco

from tests.tools.faults.breaks.broken import Broken, Edit, Kind, Rng
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import ROBOT_GROUP


def _slim(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the stack plan for a smaller body."""
    share = float(rng.uniform(0.1, 0.4))
    discs = tuple((offset, share * radius) for offset, radius in sound.mission.discs)
    mission: dict[str, Any] = {"radius": share * sound.mission.radius, "discs": discs}
    return Broken(mission=mission)


def _bulky(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the body carry a pole across, which the stack does not model."""
    half = sound.mission.radius + float(rng.uniform(0.15, 0.35))
    return Broken(
        edit=_loaded(
            mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.02, half, 0.02],
            place=[0, 0, 0],
            kilograms=0.01,
            touches=True,
        )
    )


def _strict(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Tolerate a smaller tracking error than any body achieves."""
    return Broken(settings=(f"behaviour.tracking_tolerance={rng.uniform(0.01, 0.04):.3f}",))


def _overrated(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the stack plan for a faster body."""
    share = rng.uniform(2.0, 3.0)
    mission = {
        "max_speed": share * sound.mission.max_speed,
        "max_acceleration": share * share * sound.mission.max_acceleration,
        "max_jerk": 10.0 * share * sound.mission.max_jerk,
    }
    return Broken(mission=mission)


def _loaded(
    shape: mujoco.mjtGeom, size: list[float], place: list[float], kilograms: float, touches: bool
) -> Edit:
    """Return an edit that adds a load to the base of the robot; size and place in its frame, m."""

    def load(spec: mujoco.MjSpec) -> None:
        spec.body(ROBOT_PREFIX + "base").add_geom(
            name=ROBOT_PREFIX + "load", type=shape, size=size, pos=place, mass=kilograms,
            contype=int(touches), conaffinity=int(touches), group=ROBOT_GROUP,
        )  # fmt: skip

    return load


NARROW = (
    ("forest", "drone"), ("maze", "drone"), ("office", "drone"), ("cylinders", "drone"),
    ("construction", "drone"), ("maze", "quadruped"), ("office", "quadruped"),
)  # fmt: skip
"""Worlds and robots whose paths pass close to obstacles."""

SHORT = ("planner.clearance_weight=0",)
"""Settings for the shortest paths, which pass close to obstacles."""

KINDS = {
    "slim": Kind("margin_too_small", _slim, NARROW, (*SHORT, "costmap.localization_margin=0.05")),
    "bulky": Kind("margin_too_small", _bulky, NARROW, SHORT),
    "strict": Kind("tracking", _strict),
    "overrated": Kind("tracking", _overrated),
}
