"""Termination of an episode, by the simulator's truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.ending import Limits, Verdict
from wayproof.harness.goals import distance_left
from wayproof.harness.result import Contact, Outcome
from wayproof.harness.scenario.scenario import Scenario, decision_period
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.scene import Scene
from wayproof.models.truth import Truth

FALLEN_SHARE = 0.5
"""Share of its standing height below which the base of a walking robot has fallen."""


class TerminationMonitor:
    """Checks one episode's decisions and physics against its goal, its limits and the truth."""

    def __init__(self, scenario: Scenario, data: mujoco.MjData, truth: Truth) -> None:
        """Monitor the simulation in `data`."""
        self._scenario = scenario
        self._truth = truth
        config = scenario.config.episode
        self._limits = Limits(config, scenario.mission, decision_period(scenario))
        base = scenario.scene.base
        self._position, self._rotation = data.xpos[base], data.xmat[base]  # views
        self._min_uprightness = math.cos(scenario.spec.max_tilt)

    def check_decision(
        self,
        decision: pb.Decision,
        positions: Sequence[NDArray[np.float64]],
        reached: int = 0,
    ) -> Verdict | None:
        """Return the verdict of the newest decision, if it ends the episode.

        Args:
            decision: The newest.
            positions: True positions (3,) of the base at each decision so far, m.
            reached: Number of goals reached before it.
        """
        return self._limits.ending_at(decision, positions, reached)

    def check_physics(self) -> Verdict | None:
        """Return the verdict of a physics step; called outside `safe_limits` or after a contact."""
        mission, truth = self._scenario.mission, self._truth
        if truth.collisions:
            return "collision", f"touched {truth.touched} at {self._place()}"
        if truth.hits_by_movers:
            return "collision", f"was hit by {truth.touched} while at rest at {self._place()}"
        if not self._rotation[8] > self._min_uprightness:  # z axis along the world's
            return "fall", f"tilted beyond {self._scenario.spec.max_tilt:g} rad at {self._place()}"
        x, y, z = self._position.tolist()
        spec = self._scenario.spec
        if spec.motion == "ground" and z < FALLEN_SHARE * spec.rest_height:
            return "fall", f"lies on the floor at {self._place()}"
        (x0, y0, z0), (x1, y1, z1) = mission.low, mission.high
        if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
            finite = all(map(math.isfinite, (x, y, z)))
            outcome: Outcome = "out_of_bounds" if finite else "error"
            return outcome, f"left the geofence at {self._place()}"
        return None

    def distance_left(self, reached: int) -> float:
        """Return the true straight distance through all goals left, m; see `goals`."""
        return distance_left(self._limits.mission, reached, self._position)

    def _place(self) -> str:
        return "(" + ", ".join(f"{value:.2f}" for value in self._position) + ")"


def safe_limits(scenario: Scenario) -> NDArray[np.float64]:
    """Return limits (7,) of the base within which no place ends an episode.

    Least and greatest x, y and z, m, and the least cosine of the tilt.
    """
    spec, (x, y, z) = scenario.spec, scenario.mission.low
    if spec.motion == "ground":
        z = max(z, FALLEN_SHARE * spec.rest_height)
    return np.array([x, y, z, *scenario.mission.high, math.cos(spec.max_tilt)])


def first_contact(scene: Scene, truth: Truth, data: mujoco.MjData) -> Contact | None:
    """Return the robot's first contact with what it must not touch; a mover by its body's name."""
    model = scene.model
    for pair, position in zip(data.contact.geom, data.contact.pos, strict=True):
        mine = truth.is_robot[pair]
        if mine[0] == mine[1]:
            continue
        other = int(pair[1] if mine[0] else pair[0])
        if not truth.is_obstacle[other]:
            continue
        x, y, z = position.tolist()
        body = int(model.geom_bodyid[other])
        moves = model.body_mocapid[body] >= 0
        name = model.body(body).name if moves else model.geom(other).name
        return Contact(name or f"geom {other}", (x, y, z))
    return None
