"""Controller of the quadrotor: setpoint, smooth reference, attitude, rotor thrusts."""

from __future__ import annotations

from math import cos, sin

import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.linear_algebra import rotation_from_quaternion
from wayproof.models.robots.packed import packed
from wayproof.models.robots.quadrotor.drag import air_drag
from wayproof.models.robots.quadrotor.flight import MEMORY, fly
from wayproof.models.robots.quadrotor.model import ROTORS
from wayproof.models.robots.quadrotor.parameters import GRAVITY, Parameters
from wayproof.models.robots.robot import Setpoint


class QuadrotorController:
    """Controller that tracks setpoints behind a filter, `parameters.smoothing.lag` seconds late.

    Only the setpoint's position and heading are used: its rates, and the derivatives of the
    feed-forward, come out of the filter, so that they are consistent with one another.

    Attributes:
        parameters: Airframe, gains and smoothing.
        reference: (5, 4) tracked position, velocity, acceleration, jerk and snap by row, world
            frame; the fourth column is heading, unwrapped.
        body: Body id of the base.
        wind: (3,) velocity of the air, world frame, m/s; unknown to the control law.
    """

    def __init__(
        self, model: mujoco.MjModel, prefix: str = "", parameters: Parameters | None = None
    ) -> None:
        """Bind to a compiled model.

        Raises:
            KeyError: The model lacks one of the robot's names.
        """
        self.parameters = parameters or Parameters()
        self.wind = np.zeros(3)
        self._packed = packed(self.parameters, timestep=float(model.opt.timestep))
        self._model = model
        joint = model.joint(prefix + "root")
        position, velocity = int(joint.qposadr[0]), int(joint.dofadr[0])
        self.body = int(joint.bodyid[0])
        self._qpos = slice(position, position + 7)
        self._qvel = slice(velocity, velocity + 6)
        motors = [model.actuator(prefix + name) for name, *_ in ROTORS]
        self._controls = np.array([motor.id for motor in motors])
        self._activations = np.array([int(motor.actadr[0]) for motor in motors])
        self._command = np.zeros(4)
        self._rest(np.zeros(3), 0.0)

    def _rest(self, position: Array, heading: float) -> None:
        hover = self.parameters.airframe.mass * GRAVITY / 4
        self._data: mujoco.MjData | None = None  # of the views
        self._memory = np.zeros(1, MEMORY)
        self._integral = self._memory["integral"][0]
        self._lag = self._memory["lag"][0]
        self._lag[0] = hover
        self.reference = self._memory["reference"][0]
        self.reference[0] = *position, heading

    def reset(self, data: mujoco.MjData, position: Array, heading: float) -> None:
        """Hover with the base origin at `position` (3,), facing `heading`, rotors turning."""
        self._rest(position, heading)
        pose = data.qpos[self._qpos]
        pose[:3] = position
        pose[3:] = cos(heading / 2), 0.0, 0.0, sin(heading / 2)
        data.qvel[self._qvel] = 0.0
        data.qacc_warmstart[self._qvel] = 0.0
        data.xfrc_applied[self.body] = 0.0
        data.act[self._activations] = self._lag[0]
        data.ctrl[self._controls] = self._lag[0]
        mujoco.mj_forward(self._model, data)

    def state(self) -> dict[str, Array]:
        """Return copies of the state between steps; the rotors' thrust is the model's own."""
        return {
            "integral": self._integral.copy(),
            "lag": self._lag.copy(),
            "reference": self.reference.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned, bit by bit."""
        self._integral[:] = state["integral"]
        self._lag[:] = state["lag"]
        self.reference[:] = state["reference"]

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Write rotor commands and drag of one physics step; call before `mj_step`.

        Raises:
            ValueError: The setpoint is not finite.
        """
        if data is not self._data:
            self._bind(data)
        if not fly(
            setpoint.row,
            self._packed,
            self._memory,
            self._pose,
            self._velocity,
            self.wind,
            self._command,
            self._drag,
        ):
            raise ValueError(f"setpoint: got {setpoint}, expected finite numbers")
        self._written[self._controls] = self._command

    def _bind(self, data: mujoco.MjData) -> None:
        """Slice the simulation's arrays; at every step that would take as long as the kernel."""
        self._data, self._written = data, data.ctrl
        self._pose = data.qpos[self._qpos]
        self._velocity = data.qvel[self._qvel]
        self._drag = data.xfrc_applied[self.body, :3]

    def apply_drag(self, data: mujoco.MjData) -> None:
        """Write the drag on the body as the external force on the base; no part of control."""
        R_world_body = np.empty((3, 3))
        rotation_from_quaternion(data.qpos[self._qpos][3:], R_world_body)
        airspeed = data.qvel[self._qvel][:3] - self.wind
        data.xfrc_applied[self.body, :3] = air_drag(
            self.parameters.airframe, R_world_body, airspeed
        )
