"""The simulated robot between two decisions: it follows what was committed, step by step."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.scenario.scenario import Scenario, decision_period
from wayproof.harness.sim.pose_estimate import Estimate
from wayproof.harness.sim.setpoint_buffer import SetpointBuffer
from wayproof.harness.sim.snapshot import Simulation, StepPoses
from wayproof.harness.sim.termination import safe_limits
from wayproof.models.poses import Trail
from wayproof.models.step_kernels import ask, look_and_ask
from wayproof.models.truth import Truth
from wayproof.models.worlds import Traffic
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


class Plant:
    """One scenario's physics: robot, controller, pose estimate, and whatever moves by itself.

    Attributes:
        data: MuJoCo's.
        simulation: Its state as it was before the last step, to be saved.
        truth: Contacts and clearance.
        estimate: What the body believes of its pose.
        traffic: What moves by itself, if anything does.
        rolling: Whether a sensor's shutter rolls, so that the way since its sweep began matters.
        steps_a_decision: Physics steps from one decision to the next.
        step_poses: The base's poses before each of these, for rolling shutters.
    """

    def __init__(self, scenario: Scenario, trajectory: Trajectory) -> None:
        """Place the robot at the start, to follow a trajectory until another arrives."""
        scene, mission = scenario.scene, scenario.mission
        self._scene = scene
        self.data = mujoco.MjData(scene.model)
        start, heading = np.array(mission.start), mission.start_heading
        scene.controller.reset(self.data, start, heading)
        self.truth = Truth(scene.model, scene.base, scene.floor)
        self.simulation = Simulation(scene.model, self.data)
        movers, radius = scenario.world.movers, scenario.spec.radius
        self.traffic = Traffic(scene.model, movers, scene.base, radius) if movers else None
        self._move_others(0)
        base = int(scene.model.body_jntadr[scene.base])
        first = int(scene.model.jnt_qposadr[base])
        self._pose = self.data.qpos[first : first + 7]  # of a simulation it stays the same array
        self._pose_position, self._pose_quaternion = self._pose[:3], self._pose[3:]
        self._timestep = timestep = float(scene.model.opt.timestep)
        self.steps_a_decision = steps = round(decision_period(scenario) / timestep)
        legs = mission.motion == "ground"
        self.estimate = Estimate(scenario.config, timestep, steps, start, heading, legs)
        self.rolling = any(caster.table.moments > 1 for caster in scene.casters)
        self.step_poses = StepPoses(steps)
        self._following = trajectory
        self._on_the_way: deque[tuple[int, Trajectory]] = deque()  # ns of their arrival
        self._ahead = SetpointBuffer(round(timestep * 1e9), steps)
        self._looked_at: tuple[Any, ...] = (
            self.truth.is_robot,
            self.truth.is_obstacle,
            self.data.xpos[scene.base],
            self.data.xmat[scene.base],
            safe_limits(scenario),
            self.truth.places,
            self.estimate.error_row,
            self.estimate.tracked,
            timestep,
            self._pose,
        )

    @property
    def now_ns(self) -> int:
        """Simulated time, ns."""
        return round(float(self.data.time) * 1e9)

    @property
    def position(self) -> Array:
        """True position of the base, (3,) m; a view."""
        position: Array = self.data.xpos[self._scene.base]
        return position

    @property
    def quaternion(self) -> Array:
        """True orientation of the base, (4,) w x y z; a view."""
        quaternion: Array = self.data.xquat[self._scene.base]
        return quaternion

    def expect(self, trajectories: Iterable[tuple[int, Trajectory]]) -> None:
        """Follow each of these from its arrival on, ns; in the order of their arrivals."""
        self._on_the_way.extend(trajectories)

    def step(self, remember: bool) -> bool:
        """One step of contact physics under the controller's torques and thrusts.

        Args:
            remember: A decision comes next, so the state before this step is the one to save.

        Returns:
            Whether it may have ended the episode.
        """
        now_ns = self.now_ns
        while self._on_the_way and self._on_the_way[0][0] <= now_ns:
            self._following = self._on_the_way.popleft()[1]
        self.estimate.advance(now_ns, self._pose_position, self._pose_quaternion)
        ahead, truth = self._ahead, self.truth
        if not ahead.holds(self._following, now_ns):
            ahead.sample(self._following, now_ns)
            ask(ahead.planned[0], self.estimate.tracked[0], self._pose, ahead.asked[0])
        self._scene.controller.follow(self.data, ahead.next())
        if self.rolling:
            self.step_poses.append(self._pose.copy())
        self.estimate.keep()
        if remember:
            self.simulation.remember()
        mujoco.mj_step(self._scene.model, self.data)
        rows = ahead.row, ahead.planned, ahead.asked
        met, left = look_and_ask(self.data.contact.geom, truth.steps, *rows, *self._looked_at)
        truth.see(met)
        self._move_others(now_ns)
        return left or truth.collisions > 0 or truth.struck > 0

    def drain_setpoints(self) -> bytes:
        """All that the body was asked for since this was called last."""
        return self._ahead.drain_setpoints()

    def trail(self) -> Trail:
        """True poses of the base since the sweeps began; the last alone if no shutter rolls."""
        now = np.concatenate([self.position, self.quaternion])
        poses = np.array([*self.step_poses.poses, now] if self.rolling else [now])
        return Trail(poses[:, :3], poses[:, 3:], self._timestep)

    def _move_others(self, since_ns: int) -> None:
        """Bring what moves by itself to the present."""
        if self.traffic is not None:
            self.traffic.advance(self.data, self.now_ns, self.now_ns - since_ns)
