"""`wayproof bench gym`: steps a second of the Gymnasium environments, and of physics alone."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.scenario.scenario import build
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.warm_up import warm_up
from wayproof.planners import hold

WORLD = "warehouse"
ROBOTS = ("quadruped", "drone")

STEPS = 200
"""Steps of one repeat: 20 s of simulated time."""


@dataclass(frozen=True)
class GymRow:
    """Steps of an environment, each a tenth of a simulated second, on one thread.

    Attributes:
        robot: Name of the robot.
        beams: Number of beams of an observation.
        steps: Number of steps.
        episodes: Number of episodes that were begun for them.
        steps_per_s: Steps a second of wall time by an agent of seeded random velocities: physics,
            sensing, the referee's map and verdict, log, resets.
        physics_per_s: Steps a second of physics and control alone, at rest.
        realtime_factor: Simulated seconds a second of wall time of the environment.
    """

    robot: str
    beams: int
    steps: int
    episodes: int
    steps_per_s: float
    physics_per_s: float
    realtime_factor: float


def bench_gym(repeats: int, seed: int, progress: Progress) -> list[GymRow]:
    """Step an environment of each robot; one row for each.

    Args:
        repeats: Number of times `STEPS` steps.
        seed: First seed of the episodes, and of the actions.
        progress: Called with a line about what is under way.

    Raises:
        InputError: Gymnasium is not installed.
    """
    rows = []
    for robot in ROBOTS:
        progress(f"gym: {robot}")
        warm_up(Config(WORLD, robot, seed))
        rows.append(_measure(robot, repeats * STEPS, seed))
    return rows


def _measure(robot: str, steps: int, seed: int) -> GymRow:
    try:
        from wayproof.harness.gym.environment import WayproofEnv
    except ImportError as error:
        raise InputError(str(error)) from None
    env = WayproofEnv(WORLD, robot)
    rng = np.random.default_rng(seed)
    env.reset(seed=seed)
    episodes, began = 1, time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(rng.uniform(-1.0, 1.0, 4).astype(np.float32))
        if terminated or truncated:
            env.reset(seed=seed + episodes)
            episodes += 1
    spent_s = time.perf_counter() - began
    beams = sum(sensor.beams.table.beams for sensor in env.task.sensors.values())
    period_s = env.task.period_s
    env.close()
    return GymRow(
        robot=robot,
        beams=beams,
        steps=steps,
        episodes=episodes,
        steps_per_s=steps / spent_s,
        physics_per_s=steps / _physics_s(robot, steps, seed),
        realtime_factor=period_s * steps / spent_s,
    )


def _physics_s(robot: str, steps: int, seed: int) -> float:
    """Return the wall time of physics and control of some steps of a robot at rest, s."""
    scenario = build(Config(WORLD, robot, seed))
    mission = scenario.mission
    at_rest = hold(np.array(mission.start), 0, mission.start_heading)
    simulation = Simulation(scenario, at_rest)
    began = time.perf_counter()
    for _ in range(steps):
        for _ in range(simulation.steps_per_decision):
            simulation.step(save=False)
    return time.perf_counter() - began
