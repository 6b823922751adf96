"""What ends an episode, by the simulator's truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.ending import Limits, Verdict, goal_distance
from wayproof.harness.result import Outcome
from wayproof.harness.scenario.scenario import Scenario, decision_period
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.truth import Truth

LYING = 0.5
"""A walking robot whose base is below this share of its standing height has fallen."""


class TerminationMonitor:
    """Holds one episode's decisions and physics against its goal, its limits and the truth."""

    def __init__(self, scenario: Scenario, data: mujoco.MjData, truth: Truth) -> None:
        """Watch what is simulated in `data`."""
        self._scenario = scenario
        self._truth = truth
        config = scenario.config.episode
        self._limits = Limits(config, scenario.mission, decision_period(scenario))
        base = scenario.scene.base
        self._position, self._rotation = data.xpos[base], data.xmat[base]  # views
        self._least_uprightness = math.cos(scenario.spec.max_tilt)

    def of_decision(
        self, decision: pb.Decision, positions: Sequence[NDArray[np.float64]]
    ) -> Verdict | None:
        """What the newest decision ends; `positions` are the true ones so far, (3,) m."""
        return self._limits.ending_at(decision, positions)

    def of_physics(self) -> Verdict | None:
        """What a physics step ends; called beyond `safe_limits` or where something is touched."""
        mission, truth = self._scenario.mission, self._truth
        if truth.collisions:
            return "collision", f"touched {truth.touched or 'an obstacle'} at {self._place()}"
        if truth.struck:
            return "collision", f"was hit by {truth.touched} while at rest at {self._place()}"
        if not self._rotation[8] > self._least_uprightness:  # z axis along the world's
            return "fall", f"tilted beyond {self._scenario.spec.max_tilt:g} rad at {self._place()}"
        x, y, z = self._position.tolist()
        spec = self._scenario.spec
        if spec.motion == "ground" and z < LYING * spec.rest_height:
            return "fall", f"lies on the floor at {self._place()}"
        (x0, y0, z0), (x1, y1, z1) = mission.low, mission.high
        if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
            finite = all(map(math.isfinite, (x, y, z)))
            outcome: Outcome = "out_of_bounds" if finite else "error"
            return outcome, f"left the geofence at {self._place()}"
        return None

    def goal_distance(self) -> float:
        """True distance from the goal, m; in the plane for a ground robot."""
        return goal_distance(self._limits.mission, self._position)

    def _place(self) -> str:
        return "(" + ", ".join(f"{value:.2f}" for value in self._position) + ")"


def safe_limits(scenario: Scenario) -> NDArray[np.float64]:
    """Inside them no place of the base ends an episode: (7,) as `models.step_kernels` takes them.

    Least and greatest x, y and z, m, and the least cosine of the tilt.
    """
    spec, (x, y, z) = scenario.spec, scenario.mission.low
    if spec.motion == "ground":
        z = max(z, LYING * spec.rest_height)
    return np.array([x, y, z, *scenario.mission.high, math.cos(spec.max_tilt)])
