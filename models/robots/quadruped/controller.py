"""Controller of the quadruped: setpoint, velocity command, gait, forces, torques."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.robots.kernel_data import packed
from wayproof.models.robots.quadruped.body import (
    MEMORY,
    OBSERVATION,
    Views,
    composite_rigid_body,
    record,
    views_of,
    wire,
)
from wayproof.models.robots.quadruped.gait import advance, begin, follow
from wayproof.models.robots.quadruped.legs import joint_torques, observe
from wayproof.models.robots.quadruped.mpc import condense, solve_forces
from wayproof.models.robots.quadruped.parameters import Parameters, standing_joints
from wayproof.models.robots.quadruped.reference import Horizon, predict_horizon
from wayproof.models.robots.robot import Setpoint

INERTIA_PERIOD = 0.01
"""Time between reads of the legs' inertia, which changes with the joint angles only, s."""


class QuadrupedController:
    """Controller that trots after setpoints or velocity commands, and stands still at rest.

    The whole state is `memory`, the forces' warm start and the tick count, so equal inputs give
    equal torques, bit for bit.

    Attributes:
        parameters: Gains, gait and limits.
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
        self._model = model
        self._wiring = wire(model, prefix)
        self._standing = np.array(4 * standing_joints(self.parameters.geometry, gait.height))
        root = self._wiring.qpos.start, self._wiring.dofs.start
        self.body = composite_rigid_body(model, *root, self._standing)
        self._inverse_inertia = np.linalg.inv(self.body.inertia).astype(np.float64)
        timestep = float(model.opt.timestep)
        centre = tuple(self.body.centre.tolist())
        self._packed = packed(self.parameters, timestep=timestep, com_in_body=centre)
        self._ticks_per_plan = max(1, round(prediction.period / timestep))
        self._ticks_per_inertia = max(1, round(INERTIA_PERIOD / timestep))
        self._mass_matrix = np.zeros((model.nv, model.nv))
        self._leg_inertia = np.zeros((4, 3, 3))
        self._horizon = Horizon.zeros(prediction.steps)
        self._restart()

    def _restart(self) -> None:
        self._tick = 0
        self._data: mujoco.MjData | None = None  # of `_views`
        self.observation, self._observation = record(OBSERVATION)
        self.memory, self._memory = record(MEMORY)
        self._force = self._memory["force"][0]  # reading a record's attribute takes longer
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
        """Return copies of the state that one step hands to the next."""
        return {
            "arrived": np.array(self._memory["arrived"][0]),
            "tick": np.array(self._tick),
            "memory": np.frombuffer(self._memory.tobytes(), np.uint8).copy(),
            "warm": self._warm.copy(),
            "leg_inertia": self._leg_inertia.copy(),
        }

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from what `state` returned, bit by bit."""
        self._tick = int(state["tick"])
        memory = np.frombuffer(state["memory"].tobytes(), MEMORY)[0]
        for name in MEMORY.names or ():
            self.memory[name] = memory[name]
        self.memory.arrived = bool(state["arrived"])
        self._warm[:] = state["warm"]
        self._leg_inertia[:] = state["leg_inertia"]

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Write the torques of one physics step towards a setpoint; call before `mj_step`.

        Raises:
            ValueError: The setpoint is not finite.
        """
        views = self._prepare(data)
        if not follow(
            setpoint.row,
            self._packed,
            views.qpos,
            views.qvel,
            views.touch,
            self._observation,
            self._memory,
        ):
            raise ValueError(f"setpoint: got {setpoint}, expected finite numbers")
        self._act(data, views)

    def walk(self, data: mujoco.MjData, velocity_command: Array) -> None:
        """Write the torques of one physics step; call before `mj_step`.

        Args:
            data: State after the last step.
            velocity_command: (3,) forward m/s, left m/s, yaw rate rad/s, in the body's yaw frame.
        """
        views = self._prepare(data)
        observe(self._packed, views.qpos, views.qvel, self._observation)
        advance(self._packed, velocity_command, views.touch, self._observation, self._memory)
        self._act(data, views)

    def _prepare(self, data: mujoco.MjData) -> Views:
        """Return the robot's views of the simulation; at the first tick, start from standing."""
        if data is not self._data:
            self._data, self._views = data, views_of(data, self._wiring)
        views = self._views
        if self._tick == 0:
            observe(self._packed, views.qpos, views.qvel, self._observation)
            begin(self._packed, self._observation, self._memory)
        return views

    def _act(self, data: mujoco.MjData, views: Views) -> None:
        if self._tick % self._ticks_per_plan == 0:
            self._plan_forces()
        if self._tick % self._ticks_per_inertia == 0:
            self._read_leg_inertia(data)
        joint_torques(
            self._packed,
            views.rates,
            views.bias,
            views.passive,
            self._leg_inertia,
            self._observation,
            self._memory,
            views.torques,
        )
        self._tick += 1

    def _plan_forces(self) -> None:
        prediction = self.parameters.prediction
        predict_horizon(self._packed, self._observation, self._memory, self._horizon)
        slots, hessian, gradient = condense(
            prediction, self.body.mass, self._inverse_inertia, self._horizon
        )
        solve_forces(prediction, slots, hessian, gradient, self._warm)
        self._force[:] = self._warm[0, 0]

    def _read_leg_inertia(self, data: mujoco.MjData) -> None:
        mujoco.mj_fullM(self._model, data, self._mass_matrix)
        for leg in range(4):
            first = self._wiring.dofs.start + 6 + 3 * leg
            self._leg_inertia[leg] = self._mass_matrix[first : first + 3, first : first + 3]
