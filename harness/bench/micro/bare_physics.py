"""The physics of an episode by itself: MuJoCo's steps and the controller, at the same setpoints."""

from __future__ import annotations

import time
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.episode import arrival_ns
from wayproof.harness.runner import OpenEpisode
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.simulation import Simulation
from wayproof.models.robots import Setpoint
from wayproof.planners import Trajectory

ROW = 8
"""Numbers of a setpoint."""


class Followed:
    """Trajectories that the robot of an episode followed; called after each decision.

    Attributes:
        start: Trajectory of the beginning.
        trajectories: Trajectories after it, each with its time of arrival, ns.
    """

    def __init__(self, opened: OpenEpisode) -> None:
        """Watch an episode that has not begun."""
        self._navigator = opened.navigator
        self.start = opened.navigator.trajectory
        self.trajectories: list[tuple[int, Trajectory]] = []

    def add(self, decision: pb.Decision) -> None:
        """Record a decision's committed trajectory, unless it was late and discarded."""
        if not decision.deadline_missed:
            trajectory = self._navigator.trajectory
            self.trajectories.append((arrival_ns(decision, trajectory), trajectory))


def setpoints_of(
    scenario: Scenario, followed: Followed, end_ns: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Simulate without sensors or decisions; return all setpoints (n, 8), and the last position.

    Args:
        scenario: Scenario of the episode.
        followed: Trajectories of it.
        end_ns: Its end, ns.
    """
    simulation = Simulation(scenario, followed.start)
    simulation.enqueue(followed.trajectories)
    rows = []
    while simulation.now_ns < end_ns:
        simulation.step(save=False)
        rows.append(simulation.drain_setpoints())
    setpoints = np.frombuffer(b"".join(rows)).reshape(-1, ROW)
    return setpoints, simulation.position.copy()


def bare_seconds(
    scenario: Scenario, setpoints: NDArray[np.float64], position: Sequence[float]
) -> float:
    """Return the processor time of the physics and the controller alone, s.

    Args:
        scenario: Scenario of the episode.
        setpoints: (n, 8) of each step.
        position: (3,) where the base is at the end, m: the bits of the episode.

    Raises:
        RuntimeError: It ends elsewhere, so it was another motion.
    """
    scene, mission = scenario.scene, scenario.mission
    rows = [Setpoint.of(row) for row in setpoints]
    start = np.array(mission.start)
    data = mujoco.MjData(scene.model)
    scene.controller.reset(data, start, mission.start_heading)
    scene.controller.follow(data, rows[0])  # compiles what the loop's steps do not need
    data = mujoco.MjData(scene.model)
    scene.controller.reset(data, start, mission.start_heading)
    began = time.process_time()
    for row in rows:
        scene.controller.follow(data, row)
        mujoco.mj_step(scene.model, data)
    seconds = time.process_time() - began
    if data.xpos[scene.base].tolist() != list(position):
        raise RuntimeError("the physics alone ended elsewhere than the episode")
    return seconds
