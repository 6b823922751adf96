"""The quadruped's controller: setpoint, velocity command, gait, forces, torques."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.robots.packed import packed
from wayproof.models.robots.quadruped.admm import solve_forces
from wayproof.models.robots.quadruped.bindings import views_of, wire
from wayproof.models.robots.quadruped.gait import advance, begin, follow, observe
from wayproof.models.robots.quadruped.mpc import condense
from wayproof.models.robots.quadruped.parameters import Parameters, standing_joints
from wayproof.models.robots.quadruped.reference import look_ahead
from wayproof.models.robots.quadruped.rigid_body import composite_rigid_body
from wayproof.models.robots.quadruped.state import MEMORY, OBSERVATION, record
from wayproof.models.robots.quadruped.torque import joint_torques
from wayproof.models.robots.robot import Setpoint

INERTIA_PERIOD = 0.01
"""Time between reads of the legs' inertia, which changes with the joint angles only, s."""


class QuadrupedController:
    """Trots after setpoints or velocity commands; stands still when neither asks for motion.

    The whole state is `memory`, the forces' warm start and the tick count, so equal inputs give
    equal torques, bit for bit.

    Attributes:
        parameters: What it is tuned by.
        body: The robot as one rigid body.
        observation: The `OBSERVATION` record, to read.
        memory: The `MEMORY` record, to read.
    """

    def __init__(
        self, model: mujoco.MjModel, prefix: str = "", parameters: Parameters | None = None
    ) -> None:
        """Bind to a compiled model.

        Raises:
            KeyError: The model lacks one of the robot's names.
            ValueError: The model holds them in another order than the robot's MJCF.
        """
        self.parameters = parameters or Parameters()
        gait, prediction = self.parameters.gait, self.parameters.prediction
        self._geometry = packed(self.parameters.geometry)
        self._gait = packed(gait)
        self._tracking = packed(self.parameters.tracking)
        self._legs = packed(self.parameters.legs)
        self._motors = packed(self.parameters.actuators)
        self._model = model
        self._wiring = wire(model, prefix)
        self._standing = np.array(4 * standing_joints(self.parameters.geometry, gait.height))
        root = self._wiring.qpos.start, self._wiring.dofs.start
        self.body = composite_rigid_body(model, *root, self._standing)
        self._inverse_inertia = np.linalg.inv(self.body.inertia).astype(np.float64)
        self._timestep = float(model.opt.timestep)
        self._ticks_per_plan = max(1, round(prediction.period / self._timestep))
        self._ticks_per_inertia = max(1, round(INERTIA_PERIOD / self._timestep))
        self._mass_matrix = np.zeros((model.nv, model.nv))
        self._leg_inertia = np.zeros((4, 3, 3))
        self._state = np.zeros(12)
        self._reference = np.zeros((prediction.steps, 12))
        self._contact = np.zeros((prediction.steps, 4), np.bool_)
        self._lever = np.zeros((prediction.steps, 4, 3))
        self._restart()

    def _restart(self) -> None:
        self._tick = 0
        self._data: mujoco.MjData | None = None  # that the kernels' arguments are of
        self.observation, self._observation = record(OBSERVATION)
        self.memory, self._memory = record(MEMORY)
        self._force = self._memory["force"][0]  # to read a record's attribute takes longer
        self._warm = np.zeros((2, self.parameters.prediction.steps, 4, 3))

    def reset(self, data: mujoco.MjData, position: Array, heading: float) -> None:
        """Place the robot at rest with its base origin at `position` (3,), facing `heading`."""
        pose = data.qpos[self._wiring.qpos]
        pose[:3] = position
        pose[3:7] = math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)
        pose[7:] = self._standing
        data.qvel[self._wiring.dofs] = 0.0
        data.qacc_warmstart[self._wiring.dofs] = 0.0
        data.ctrl[self._wiring.controls] = 0.0
        mujoco.mj_forward(self._model, data)
        self._restart()

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of what one step hands to the next."""
        return {
            "arrived": np.array(self._memory["arrived"][0]),
            "tick": np.array(self._tick),
            "memory": np.frombuffer(self._memory.tobytes(), np.uint8).copy(),
            "warm": self._warm.copy(),
            "leg_inertia": self._leg_inertia.copy(),
        }

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from what `state` returned, bit by bit."""
        self._tick = int(state["tick"])
        memory = np.frombuffer(state["memory"].tobytes(), MEMORY)[0]
        for name in MEMORY.names or ():
            self.memory[name] = memory[name]
        # Logs from before it was part of the memory hold it apart alone.
        self.memory.arrived = bool(state["arrived"])
        self._warm[:] = state["warm"]
        self._leg_inertia[:] = state["leg_inertia"]

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Write the torques of one physics step towards a setpoint; call before `mj_step`.

        Raises:
            ValueError: The setpoint is not finite.
        """
        self._prepare(data)
        if not follow(setpoint.row, self._tracking, *self._walking):
            raise ValueError(f"setpoint: got {setpoint}, expected finite numbers")
        self._act(data)

    def walk(self, data: mujoco.MjData, velocity_command: Array) -> None:
        """Write the torques of one physics step; call before `mj_step`.

        Args:
            data: State after the last step.
            velocity_command: (3,) forward m/s, left m/s, yaw rate rad/s, in the body's yaw frame.
        """
        self._prepare(data)
        self._observe()
        records = self._observation, self._memory
        gait = self._gait, self._geometry, self._timestep
        advance(*gait, velocity_command, self._touch, *records)
        self._act(data)

    def _prepare(self, data: mujoco.MjData) -> None:
        if data is not self._data:
            self._bind(data)
        if self._tick == 0:
            self._observe()
            begin(self._geometry, self._observation, self._memory)

    def _observe(self) -> None:
        observe(self._geometry, *self._body, self._observation)

    def _bind(self, data: mujoco.MjData) -> None:
        """Put the kernels' arguments together; at every step that would take as long as they do."""
        joints, records = views_of(data, self._wiring), (self._observation, self._memory)
        self._data = data
        self._body = self.body.centre, joints.qpos, joints.qvel
        self._touch = joints.touch
        self._walking = (
            self._gait,
            self._geometry,
            self._timestep,
            *self._body,
            self._touch,
            *records,
        )
        self._pushing = (
            self._gait,
            self._legs,
            self._motors,
            joints.rates,
            joints.bias,
            joints.passive,
            self._leg_inertia,
            *records,
            joints.torques,
        )

    def _act(self, data: mujoco.MjData) -> None:
        if self._tick % self._ticks_per_plan == 0:
            self._plan_forces()
        if self._tick % self._ticks_per_inertia == 0:
            self._read_leg_inertia(data)
        joint_torques(*self._pushing)
        self._tick += 1

    def _plan_forces(self) -> None:
        p = self.parameters
        look_ahead(
            self._gait,
            p.prediction,
            self._geometry,
            self._observation,
            self._memory,
            self._state,
            self._reference,
            self._contact,
            self._lever,
        )
        slots, hessian, gradient = condense(
            p.prediction,
            self.body.mass,
            self._inverse_inertia,
            self._state,
            self._reference,
            self._contact,
            self._lever,
        )
        solve_forces(p.prediction, slots, hessian, gradient, self._warm)
        self._force[:] = self._warm[0, 0]

    def _read_leg_inertia(self, data: mujoco.MjData) -> None:
        mujoco.mj_fullM(self._model, data, self._mass_matrix)
        for leg in range(4):
            first = self._wiring.dofs.start + 6 + 3 * leg
            self._leg_inertia[leg] = self._mass_matrix[first : first + 3, first : first + 3]
