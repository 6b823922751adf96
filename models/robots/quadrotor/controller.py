"""Controller of the quadrotor: setpoint, smooth reference, attitude, rotor thrusts."""

from __future__ import annotations

from math import cos, isfinite, sin, sqrt
from typing import Any

import mujoco
import numpy as np

from wayproof.kernel_compiler import allocating
from wayproof.models.arrays import Array
from wayproof.models.robots.kernel_data import dot, packed, rotation_from_quaternion
from wayproof.models.robots.quadrotor.control_law import (
    air_drag,
    allocate,
    desired_attitude,
    desired_force,
    desired_rates,
    desired_torque,
    invert_lag,
    smooth_setpoint,
)
from wayproof.models.robots.quadrotor.model import ROTORS
from wayproof.models.robots.quadrotor.parameters import GRAVITY, Airframe, Gains, Parameters
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


MEMORY = np.dtype(
    [
        ("reference", "f8", (5, 4)),  # by `smooth_setpoint`
        ("integral", "f8", 3),  # of the position error, m/s^2
        ("lag", "f8", (2, 4)),  # by `invert_lag`
    ],
    align=True,
)
"""State of the controller, kept from tick to tick."""


@allocating
def fly(
    setpoint: Array,
    parameters: Any,
    memories: Any,
    qpos: Array,
    qvel: Array,
    wind: Array,
    command: Array,
    drag: Array,
) -> bool:
    """Advance one tick: smooth the reference, track it, and compute the drag on the body.

    Args:
        setpoint: (8,) row of the setpoint; position and heading count.
        parameters: (1,) record of the controller's parameters.
        memories: (1,) `MEMORY` record; advanced.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        wind: (3,) velocity of the air, world frame, m/s.
        command: (4,) rotor commands, N; written.
        drag: (3,) on the body, world frame, N; written.

    Returns:
        Whether the setpoint was finite; nothing is written where it was not.
    """
    x, y, z, heading = setpoint[0], setpoint[1], setpoint[2], setpoint[6]
    if not isfinite(x + y + z + heading):
        return False
    airframe, gains, timestep = parameters[0].airframe, parameters[0].gains, parameters[0].timestep
    memory = memories[0]
    target = np.array((x, y, z, heading))
    smooth_setpoint(parameters[0].smoothing, memory.reference, target, timestep)
    track(airframe, gains, memory, qpos, qvel, timestep, command)
    R_world_body = np.empty((3, 3))
    rotation_from_quaternion(qpos[3:], R_world_body)
    drag[:] = air_drag(airframe, R_world_body, qvel[:3] - wind)
    return True


@allocating
def track(
    airframe: Airframe,
    gains: Gains,
    memory: Any,
    qpos: Array,
    qvel: Array,
    timestep: float,
    command: Array,
) -> None:
    """Compute the rotor commands of one tick.

    Args:
        airframe: Body and rotors.
        gains: Gains of the controller.
        memory: `MEMORY` record; `integral` and `lag` are advanced.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        timestep: s.
        command: (4,) rotor commands, N; written.
    """
    reference = memory.reference
    R_world_body = np.empty((3, 3))
    rotation_from_quaternion(qpos[3:], R_world_body)
    force = desired_force(
        airframe, gains, reference, qpos[:3], qvel[:3], R_world_body, memory.integral, timestep
    )
    R_world_desired = desired_attitude(force, reference[0, 3])
    rates = desired_rates(reference, R_world_desired, sqrt(dot(force, force)))
    thrust = airframe.mass * dot(force, R_world_body[:, 2])
    torque = desired_torque(airframe, gains, R_world_desired, R_world_body, rates, qvel[3:], thrust)
    rotors = allocate(airframe, gains, thrust, torque)
    command[:] = invert_lag(airframe, gains, rotors, memory.lag, timestep)
