"""Motion that a body measures between two sweeps: inertial sensors and standing feet.

Simulated from MuJoCo's state with the errors of the sensors. The attitude's tilt is taken as exact:
gravity gives it, and what it is off by is in the accelerometer's bias.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.perturbations import UNPERTURBED, Perturbation
from wayproof.harness.perturbations.inertial_bias import InertialBias
from wayproof.models.arrays import Array
from wayproof.models.poses import rotation_matrices
from wayproof.models.random_streams import stream
from wayproof.models.snapshot import Kept

DRAW_BLOCK = 128
"""Number of measurements whose random numbers come from one generator, which takes 30 us to make.
"""

DRAWS = 7
"""Random numbers of one measurement: accelerometer, feet, gyroscope."""


class Motion(NamedTuple):
    """Motion between two measurements.

    Attributes:
        velocity_change: (3,) change of velocity by the accelerometer, without gravity, in true
            world axes, m/s.
        turn: Turn about the vertical by the gyroscope, rad.
        foot_velocity: (3,) velocity of the base by the feet that stand, in true world axes, m/s;
            None if no foot does.
        axes: (3, 3) rotation of the base in true world axes, in which the accelerometer's bias
            stays; none without an accelerometer.
        step: (3,) step of the base by an odometry, in true world axes, m; None without one.
    """

    velocity_change: Array
    turn: float
    foot_velocity: Array | None
    axes: Array | None = None
    step: Array | None = None


class MotionSource(Protocol):
    """Sensors of the motion of a body.

    Attributes:
        period: Time between two measurements, s.
    """

    period: float

    def measure(self, turn: float) -> Motion:
        """Measure the motion since the last measurement; the true turn is given, rad."""

    def state(self) -> dict[str, Array]:
        """Return the state kept between measurements."""

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""


@dataclass(frozen=True)
class Body:
    """The simulated body that carries the sensors.

    Attributes:
        model: MuJoCo's.
        data: Its state.
        base: Body id of the base.
        is_robot: (geoms,) whether a geom is the robot's.
        legs: Whether the body stands on legs.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    base: int
    is_robot: NDArray[np.bool_]
    legs: bool


class MotionSensors(Kept):
    """The inertial sensors and the legs of one body.

    Attributes:
        period: Time between two measurements, s.
    """

    KEPT = ("_sequence", "_before")
    """Biases and noise follow from the seed."""

    def __init__(
        self,
        config: EstimateConfig,
        seed: int,
        period: float,
        body: Body,
        perturbation: Perturbation = UNPERTURBED,
    ) -> None:
        """Draw the biases of an episode.

        Args:
            config: Errors of the sensors.
            seed: The episode's.
            period: Time between two measurements, s.
            body: That carries them.
            perturbation: May add to the biases.
        """
        self._config, self._seed, self.period, self._body = config, seed, period, body
        biases = stream(seed, "estimate/bias", 0).standard_normal(4)
        self._own = InertialBias(
            config.accelerometer_bias * biases[:3], config.gyro_bias * float(biases[3])
        )
        self._perturbation, self._added = perturbation, perturbation.inertial_bias(seed)
        self._sequence, self._block = 0, -1
        joint = body.model.body_jntadr[body.base]
        speeds, places = int(body.model.jnt_dofadr[joint]), int(body.model.jnt_qposadr[joint])
        # Views of the state: they stay the same arrays.
        self._velocity: Array = body.data.qvel[speeds : speeds + 3]
        self._quaternion: Array = body.data.qpos[places + 3 : places + 7]
        self._before = self._velocity.copy()

    def measure(self, turn: float) -> Motion:
        """Measure the motion since the last measurement.

        Args:
            turn: True turn about the vertical since then, rad.
        """
        noise = self._draws()
        config, period = self._config, self.period
        root = math.sqrt(period)
        bias = self._bias()
        axes = rotation_matrices(self._quaternion[None])[0]
        change = self._velocity - self._before
        change = change + turned_by(axes, bias.acceleration) * period
        change = change + config.accelerometer_noise * root * noise[:3]
        self._before = self._velocity.copy()
        turned = turn + bias.turn_rate * period + config.gyro_noise * root * float(noise[6])
        feet = self._foot_velocity() if self._body.legs else None
        if feet is not None:
            feet = feet + config.leg_noise * noise[3:6]
        self._sequence += 1
        return Motion(change, turned, feet, axes)

    def _bias(self) -> InertialBias:
        """Return the biases of this instant."""
        time_ns = round((self._sequence + 1) * self.period * 1e9)
        if self._added is None or not self._perturbation.is_active(time_ns):
            return self._own
        acceleration = self._own.acceleration + self._added.acceleration
        return InertialBias(acceleration, self._own.turn_rate + self._added.turn_rate)

    def _foot_velocity(self) -> Array | None:
        """Return the velocity of the base if the points where the robot touches the world rest.

        From joint encoders and gyroscope: the base's velocity relative to these points (Bloesch et
        al. 2012, RSS, "State estimation for legged robots"). A foot that slips falsifies it.
        """
        body, data = self._body, self._body.data
        velocities = []
        twist = np.empty(6)
        for contact in data.contact:
            first, second = contact.geom
            mine = [one for one in (first, second) if body.is_robot[one]]
            if len(mine) != 1:
                continue
            link = int(body.model.geom_bodyid[mine[0]])
            mujoco.mj_objectVelocity(body.model, data, mujoco.mjtObj.mjOBJ_BODY, link, twist, 0)
            arm = contact.pos - data.xpos[link]
            velocities.append(twist[3:] + np.cross(twist[:3], arm))
        if not velocities:
            return None
        mean: Array = np.mean(velocities, axis=0)
        return self._velocity - mean

    def _draws(self) -> Array:
        block, row = divmod(self._sequence, DRAW_BLOCK)
        if block != self._block:
            self._block, rng = block, stream(self._seed, "estimate/motion", block)
            self._drawn: Array = rng.standard_normal((DRAW_BLOCK, DRAWS))
        drawn: Array = self._drawn[row]
        return drawn


def turned_by(rotation: Array, vector: Array) -> Array:
    """Return a vector (3,) turned by a rotation (3, 3)."""
    turned: Array = (rotation * vector).sum(axis=1)
    return turned
