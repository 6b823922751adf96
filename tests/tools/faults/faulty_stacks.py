"""Stacks on trial with one fault each, for the accuracy of the causes attributed to them.

Each begins like a good one: its fault comes at a decision that the seed of the task chooses.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time

import numpy as np

from wayproof.harness.interface.stacks.blind import Blind
from wayproof.harness.interface.types import (
    Array,
    Command,
    Observation,
    Samples,
    Task,
    Velocity,
    Waypoints,
)

CREEP = 0.2
"""Speed before a fault, m/s."""

AS_HIGH = 0.25
"""Height of a return above or below the base up to which the body runs into it, m."""

STDERR_FLOOD = 2**20
"""Bytes written to the standard error at each decision."""

FOREVER_S = 1e6


class Faulty:
    """Creeps ahead until its fault begins."""

    def start(self, task: Task) -> None:
        """Choose when the fault begins."""
        self.task = task
        self.rng = np.random.default_rng(task.seed)
        self.begins = int(self.rng.integers(3, 13))

    def step(self, observation: Observation) -> Command:
        """Creep, then fail."""
        if observation.sequence < self.begins:
            return Command(Velocity(CREEP))
        return self.fail(observation)

    def fail(self, observation: Observation) -> Command:
        """Answer with the fault."""
        raise NotImplementedError

    def close(self) -> None:
        """Do nothing: there is nothing to end."""


class IntoReturns(Faulty):
    """Drives at the nearest thing that it sees, and on."""

    LEAST, MOST = 1.5, 6.0
    """Distances of the return that it drives at, m."""

    def start(self, task: Task) -> None:
        """Have no target yet."""
        super().start(task)
        self.begins = 3
        self._target: Array | None = None

    def fail(self, observation: Observation) -> Command:
        """Return a velocity at the target, at full speed."""
        if self._target is None:
            self._target = self._nearest(observation)
        if self._target is None:
            return Command(Velocity(0.0), action="abort")
        return Command(_towards(self._target, observation, self.task.mission.max_speed))

    def _nearest(self, observation: Observation) -> Array | None:
        points = np.vstack([sweep.points for sweep in observation.sweeps])
        away = points - observation.position
        distances = np.hypot(away[:, 0], away[:, 1])
        within = (distances > self.LEAST) & (distances < self.MOST)
        points = points[within & (np.abs(away[:, 2]) < AS_HIGH)]
        if not len(points):
            return None
        nearest = np.hypot(*(points - observation.position)[:, :2].T).argmin()
        target: Array = points[nearest]
        return target


class IntoTheUnknown(IntoReturns):
    """Drives at returns nearer than the map takes them, where space stays unknown."""

    LEAST, MOST = 0.9, 3.0


class WrongFrame(Blind):
    """Confuses frames: sends velocities of the world as the body's, or turns y around."""

    def step(self, observation: Observation) -> Command:
        """Return the right velocity in the wrong frame."""
        command = super().step(observation)
        motion = command.motion
        assert isinstance(motion, Velocity)
        if self._task.seed % 2:
            return Command(Velocity(motion.forward, -motion.left, motion.up, -motion.yaw_rate))
        away = self._task.mission.goal - observation.position
        speed = math.hypot(motion.forward, motion.left)
        x, y = (away[:2] / max(math.hypot(*away[:2]), 1e-6) * speed).tolist()
        return Command(Velocity(x, y, motion.up, 0.3))


class AnswersLate(Faulty):
    """Thinks for longer than the deadline."""

    def fail(self, observation: Observation) -> Command:
        """Return a good command, too late."""
        time.sleep(self.task.deadline_s * float(self.rng.uniform(1.3, 2.0)))
        return Command(Velocity(CREEP))


class Dies(Faulty):
    """Ends by an exit code, a signal, or as if nothing were wrong; with children of its own."""

    def fail(self, observation: Observation) -> Command:
        """End the process."""
        subprocess.Popen(["sleep", "1000"])
        how = self.task.seed % 3
        if how == 0:
            os._exit(int(self.rng.integers(1, 100)))
        if how == 1:
            os.kill(os.getpid(), signal.SIGSEGV)
            time.sleep(FOREVER_S)
        os._exit(0)


class Hangs(Faulty):
    """Sleeps, computes for ever, or is stopped; deaf to SIGTERM, with children of its own."""

    def fail(self, observation: Observation) -> Command:
        """Never answer."""
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        subprocess.Popen(["sleep", "1000"])
        how = self.task.seed % 3
        if how == 0:
            time.sleep(FOREVER_S)
        if how == 1:
            os.kill(os.getpid(), signal.SIGSTOP)
        while True:
            self.begins += 1


class NotANumber(Faulty):
    """Sends NaN or infinities in a velocity, waypoints, samples or a planned path."""

    def fail(self, observation: Observation) -> Command:
        """Return one number that is none."""
        number = (math.nan, math.inf)[self.task.seed % 2]
        here = observation.reference.position
        points = np.array([here, here + 0.1, [number, *here[1:]]])
        return (
            Command(Velocity(0.1, number)),
            Command(Waypoints(points)),
            Command(Samples(0.1, points, np.zeros(3))),
            Command(Velocity(0.1), planned_path=points),
        )[self.task.seed // 2 % 4]


class StartsElsewhere(Faulty):
    """Sends a trajectory that starts elsewhere: beside the body, or at the origin of its frame."""

    def fail(self, observation: Observation) -> Command:
        """Return samples from a place where the body is not."""
        beside = self.rng.uniform(0.2, 2.0) * np.array([1.0, 0.0, 0.0])
        start = observation.reference.position + beside if self.task.seed % 2 else np.zeros(3)
        ahead = start + np.arange(5)[:, None] * np.array([0.02, 0.0, 0.0])
        return Command(Samples(0.1, ahead, np.full(5, observation.reference.heading)))


class FloodsStderr(Faulty):
    """Writes without end to its standard error, and then fails."""

    def step(self, observation: Observation) -> Command:
        """Complain much."""
        line = b"error: " + b"x" * 1000 + b"\n"
        for _ in range(STDERR_FLOOD // len(line)):
            os.write(2, line)
        return super().step(observation)

    def fail(self, observation: Observation) -> Command:
        """End with a last word."""
        print("planted: no more", file=sys.stderr, flush=True)
        os._exit(9)


def _towards(target: Array, observation: Observation, speed: float) -> Velocity:
    """Return a velocity at a place, at any heading."""
    x, y, _ = (target - observation.position).tolist()
    error = math.atan2(y, x) - observation.reference.heading
    return Velocity(speed * math.cos(error), speed * math.sin(error))
