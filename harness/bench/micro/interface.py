"""`wayproof bench interface`: the cost per step of a stack in a process of its own."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.interface.types import Command, Observation, Task, Velocity
from wayproof.harness.log.reader import open_log
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build, sensor_info
from wayproof.harness.warm_up import warm_up

WORLD, ROBOT = "warehouse", "quadruped"

LIDARS = ("own", "ideal-lidar-dense")
"""The robot's own sensor of 20,000 beams, and one of 100,000."""

EPISODE_S = 20.0
"""Simulated time of one repeat, s: 200 steps."""

FIRST_STEPS = 5
"""Steps of each episode that are left out, as they import and compile."""


class Stands:
    """Stack that answers at once, so that all of a step is the interface."""

    def start(self, task: Task) -> None:
        """Take the task."""

    def step(self, observation: Observation) -> Command:
        """Command the body to stand."""
        return Command(Velocity(0.0))

    def close(self) -> None:
        """Do nothing: there is nothing to end."""


IN_PROCESS = f"{Stands.__module__}:{Stands.__name__}"
BEHIND_EXEC = f"exec:{sys.executable} -m wayproof serve {IN_PROCESS}"


@dataclass(frozen=True)
class InterfaceRow:
    """Wall time of the steps of a stack that answers at once, in episodes.

    From the observation's making to the answer as it is logged: `stages.answer_ms` of the log.

    Attributes:
        beams: Number of beams of an observation.
        steps: Number of steps by each way in.
        in_process_ms_p50: Median step of the class in the harness's process.
        in_process_ms_p99: 99 % of its steps are shorter.
        exec_ms_p50: Median step of the same class served behind `exec:`.
        exec_ms_p99: 99 % of its steps are shorter.
        overhead_ms_p50: Difference of both medians.
        overhead_ms_p99: Difference of both 99 % quantiles.
    """

    beams: int
    steps: int
    in_process_ms_p50: float
    in_process_ms_p99: float
    exec_ms_p50: float
    exec_ms_p99: float
    overhead_ms_p50: float
    overhead_ms_p99: float


def bench_interface(repeats: int, seed: int, progress: Progress) -> list[InterfaceRow]:
    """Time the steps of a stack in the harness's process and behind `exec:`; a row for each lidar.

    Args:
        repeats: Number of episodes of `EPISODE_S` by each way in, in turn.
        seed: Seed of the world.
        progress: Called with a line about what is under way.
    """
    rows = []
    for lidar in LIDARS:
        progress(f"interface: lidar {lidar}")
        warm_up(_config(seed, lidar, IN_PROCESS))
        rows.append(_measure(repeats, seed, lidar))
    return rows


def _measure(repeats: int, seed: int, lidar: str) -> InterfaceRow:
    pairs = [
        (_steps_ms(seed, lidar, IN_PROCESS), _steps_ms(seed, lidar, BEHIND_EXEC))
        for _ in range(repeats)
    ]
    here, there = (np.concatenate(each) for each in zip(*pairs, strict=True))
    here_p50, here_p99 = (float(one) for one in np.quantile(here, (0.5, 0.99)))
    there_p50, there_p99 = (float(one) for one in np.quantile(there, (0.5, 0.99)))
    return InterfaceRow(
        beams=_beams(seed, lidar),
        steps=len(there),
        in_process_ms_p50=here_p50,
        in_process_ms_p99=here_p99,
        exec_ms_p50=there_p50,
        exec_ms_p99=there_p99,
        overhead_ms_p50=there_p50 - here_p50,
        overhead_ms_p99=there_p99 - here_p99,
    )


def _steps_ms(seed: int, lidar: str, stack: str) -> NDArray[np.float64]:
    """Return the wall time of each step of one episode but the first, ms."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_episode(build(_config(seed, lidar, stack)), Path(folder) / "steps.mcap")
        decisions = open_log(Path(result.log)).decisions()
        return np.array([one.stages.answer_ms for one in decisions])[FIRST_STEPS:]


def _config(seed: int, lidar: str, stack: str) -> Config:
    settings = (
        f"sensors.lidar={lidar}",
        f"episode.time_limit={EPISODE_S:g}",
        f"episode.stuck_after={2.0 * EPISODE_S:g}",
        f"stack.name={stack}",
    )
    return override(Config(WORLD, ROBOT, seed), settings)


def _beams(seed: int, lidar: str) -> int:
    casters = build(_config(seed, lidar, IN_PROCESS)).scene.casters
    return sum(beams_from_info(sensor_info(one)).table.beams for one in casters)
