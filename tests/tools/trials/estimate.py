"""State estimates of a robot under trial: the true state with an estimator's errors.

A controller reads the state from `MjData`; under trial it is handed another one, filled with the
estimate, and everything that it takes from there (bias torques, inertia) follows from the estimate
on the nominal model. So neither the truth nor a payload leaks into it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.signal import lfilter

from wayproof.models.arrays import Array


class Error(NamedTuple):
    """White noise of every tick, and drift: a Gauss-Markov process of first order."""

    white: float = 0.0
    drift: float = 0.0
    drift_time: float = 1.0

    def draw(self, rng: np.random.Generator, count: int, axes: int, timestep: float) -> Array:
        """Draw errors (count, axes) of consecutive ticks; the drift starts in its steady state."""
        white = self.white * rng.standard_normal((count, axes))
        keep = math.exp(-timestep / self.drift_time)
        kicks = self.drift * rng.standard_normal((count, axes))
        kicks[1:] *= math.sqrt(1.0 - keep * keep)
        drift: Array = lfilter([1.0], [1.0, -keep], kicks, axis=0)
        return white + drift


class EstimateNoise(NamedTuple):
    """Errors of an onboard estimator; sizes assumed, drifts the greater part where drifts hurt."""

    position: Error = Error(0.002, 0.01, 2.0)
    orientation: Error = Error(0.002, 0.01, 1.0)
    velocity: Error = Error(0.03, 0.02, 0.5)
    angular_velocity: Error = Error(0.03)
    joint_position: Error = Error(0.002)
    joint_velocity: Error = Error(0.1)


class Estimate:
    """Estimated state of one robot through one run, tick by tick."""

    def __init__(
        self, model: mujoco.MjModel, noise: EstimateNoise, ticks: int, rng: np.random.Generator
    ) -> None:
        """Draw every error of the run at once."""
        self.data = mujoco.MjData(model)
        self._model = model
        self._ticks = ticks
        joints = model.nq - 7

        def draw(error: Error, axes: int) -> Array:
            return error.draw(rng, ticks, axes, float(model.opt.timestep))

        self._rotations = draw(noise.orientation, 3)
        self._places = np.hstack([draw(noise.position, 3), draw(noise.joint_position, joints)])
        self._rates = np.hstack([
            draw(noise.velocity, 3),
            draw(noise.angular_velocity, 3),
            draw(noise.joint_velocity, joints),
        ])  # fmt: skip

    def update(self, truth: mujoco.MjData, tick: int) -> None:
        """Set the estimate to the true state with this tick's errors, none on touch and rotors."""
        model, data, now = self._model, self.data, tick % self._ticks
        data.qpos[:] = truth.qpos
        data.qpos[:3] += self._places[now, :3]
        data.qpos[7:] += self._places[now, 3:]
        rotation = data.qpos[3:7].copy()
        mujoco.mju_quatIntegrate(rotation, self._rotations[now], 1.0)
        data.qpos[3:7] = rotation
        data.qvel[:] = truth.qvel
        data.qvel += self._rates[now]
        data.act[:] = truth.act
        data.sensordata[:] = truth.sensordata
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_passive(model, data)
        mujoco.mj_rne(model, data, 0, data.qfrc_bias)


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
