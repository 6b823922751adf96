"""Physics of the simulated robot between two decisions, following the committed trajectories."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.motion_sensors import Body
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.scenario.scenario import Scenario, decision_period, sensor_info
from wayproof.harness.sim.pose_estimate import PoseEstimate
from wayproof.harness.sim.snapshot import PhysicsState, StepPoses
from wayproof.harness.sim.termination import safe_limits
from wayproof.models.poses import Trail
from wayproof.models.robots import Setpoint
from wayproof.models.step_kernels import StepArrays, StepCheck, command
from wayproof.models.truth import Truth
from wayproof.models.worlds import Traffic
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


class Simulation:
    """One scenario's physics: robot, controller, pose estimate, traffic.

    Attributes:
        data: State of MuJoCo.
        physics: Its state before the last step, for snapshots.
        truth: Contacts and clearance.
        estimate: Pose estimate of the body.
        traffic: Movers of the world, if it has any.
        rolling: Whether a sensor has a rolling shutter, so that its sweep needs the trail.
        steps_per_decision: Physics steps from one decision to the next.
        step_poses: Poses of the base before each of these, for rolling shutters.
    """

    def __init__(self, scenario: Scenario, trajectory: Trajectory) -> None:
        """Place the robot at the start, to follow a trajectory until another arrives."""
        scene, mission = scenario.scene, scenario.mission
        self._scene = scene
        self.data = mujoco.MjData(scene.model)
        start, heading = np.array(mission.start), mission.start_heading
        scene.controller.reset(self.data, start, heading)
        mujoco.mj_kinematics(scene.model, self.data)
        self.truth = Truth(scene.model, scene.base, scene.floor, flies=not mission.planar)
        self.truth.place(self.data)
        self.physics = PhysicsState(scene.model, self.data)
        movers, radius = scenario.world.movers, scenario.spec.radius
        self.traffic = Traffic(scene.model, movers, scene.base, radius) if movers else None
        self._move_traffic(0)
        base = int(scene.model.body_jntadr[scene.base])
        first = int(scene.model.jnt_qposadr[base])
        self._pose = self.data.qpos[first : first + 7]  # it stays the same array
        self._pose_position, self._pose_quaternion = self._pose[:3], self._pose[3:]
        self._timestep = timestep = float(scene.model.opt.timestep)
        self.steps_per_decision = steps = round(decision_period(scenario) / timestep)
        body = Body(scene.model, self.data, scene.base, self.truth.is_robot, legs=mission.planar)
        infos = [sensor_info(caster) for caster in scene.casters]
        beams = {info.name: beams_from_info(info) for info in infos}
        self.estimate = PoseEstimate(
            config=scenario.config,
            timestep=timestep,
            steps=steps,
            position=start,
            heading=heading,
            body=body,
            beams=beams,
        )
        self.rolling = any(caster.table.scan_poses > 1 for caster in scene.casters)
        self.step_poses = StepPoses(steps)
        self._following = trajectory
        self._upcoming: deque[tuple[int, Trajectory]] = deque()  # with their arrival, ns
        self._setpoints = SetpointBuffer(round(timestep * 1e9), steps)
        self._check_and_command = StepCheck(
            StepArrays(
                is_robot=self.truth.is_robot,
                is_obstacle=self.truth.is_obstacle,
                position=self.data.xpos[scene.base],
                rotation=self.data.xmat[scene.base],
                limits=safe_limits(scenario),
                places=self.truth.places,
                error=self.estimate.error_row,
                filtered=self.estimate.tracked,
                pose=self._pose,
                timestep=timestep,
            )
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

    def enqueue(self, trajectories: Iterable[tuple[int, Trajectory]]) -> None:
        """Follow each trajectory from its arrival on, ns; given in the order of arrival."""
        self._upcoming.extend(trajectories)

    def step(self, save: bool) -> bool:
        """Step the contact physics under the controller's torques and thrusts.

        Args:
            save: Whether a decision comes next, so that the state before this step is saved.

        Returns:
            Whether it may have ended the episode.
        """
        now_ns, truth = self.now_ns, self.truth
        self.estimate.advance(now_ns, self._pose_position, self._pose_quaternion)
        self._scene.controller.follow(self.data, self._next_setpoint(now_ns))
        if self.rolling:
            self.step_poses.append(self._pose.copy())
        self.estimate.record_step()
        if save:
            self.physics.save()
        mujoco.mj_step(self._scene.model, self.data)
        obstacle, outside = self._check_and_command(
            pairs=self.data.contact.geom,
            step=truth.steps,
            row=self._setpoints.row,
            planned=self._setpoints.planned,
            commanded=self._setpoints.commanded,
        )
        truth.end_step(obstacle)
        self._move_traffic(now_ns)
        return outside or truth.collisions > 0 or truth.hits_by_movers > 0

    def _next_setpoint(self, now_ns: int) -> Setpoint:
        """Take the setpoint of this step, of the newest trajectory that has arrived."""
        while self._upcoming and self._upcoming[0][0] <= now_ns:
            self._following = self._upcoming.popleft()[1]
        buffer = self._setpoints
        if not buffer.holds(self._following, now_ns):
            buffer.sample(self._following, now_ns)
            command(buffer.planned[0], self.estimate.tracked[0], self._pose, buffer.commanded[0])
        return buffer.next()

    def drain_setpoints(self) -> bytes:
        """Return rows of the setpoints that the controller got since the last call."""
        return self._setpoints.drain_setpoints()

    def place_geometry(self) -> None:
        """Move all geoms to the present poses, which a step leaves one step behind."""
        mujoco.mj_kinematics(self._scene.model, self.data)

    def trail(self) -> Trail:
        """Return the true poses since the sweeps began; without rolling shutter the last one."""
        now = np.concatenate([self.position, self.quaternion])
        poses = np.array([*self.step_poses.poses, now] if self.rolling else [now])
        return Trail(poses[:, :3], poses[:, 3:], self._timestep)

    def _move_traffic(self, since_ns: int) -> None:
        """Move the traffic to the present time."""
        if self.traffic is not None:
            self.traffic.advance(self.data, self.now_ns, self.now_ns - since_ns)


class SetpointBuffer:
    """Setpoints of a trajectory, step by step; sampled again when the trajectory changes.

    Attributes:
        planned: (n, 8) rows of setpoints by the trajectory, in the frame of the pose estimate.
        commanded: (n, 8) the same as the controller gets them, world frame; a row is written before
            its step.
        row: Index of the next one.
    """

    def __init__(self, step_ns: int, steps: int) -> None:
        """Sample `steps` physics steps of `step_ns` each ahead."""
        self._offsets = step_ns * np.arange(steps, dtype=np.int64)
        self._trajectory: Trajectory | None = None
        self._times: list[int] = []
        self._undrained: list[bytes] = []  # of earlier samples
        self._drained = 0  # rows of this sample
        self.planned, self.commanded, self.row = np.zeros((0, 8)), np.zeros((0, 8)), 0

    def holds(self, trajectory: Trajectory, time_ns: int) -> bool:
        """Return whether the next setpoint is that of this time; a step need not last whole ns."""
        return (
            trajectory is self._trajectory
            and self.row < len(self._times)
            and self._times[self.row] == time_ns
        )

    def sample(self, trajectory: Trajectory, time_ns: int) -> None:
        """Sample a trajectory from a time on, ns."""
        self._undrained.append(self.commanded[self._drained : self.row].tobytes())
        times = time_ns + self._offsets
        self.planned = np.column_stack(trajectory.setpoints(times))
        self.commanded = np.empty_like(self.planned)
        self._trajectory, self._times = trajectory, times.tolist()
        self.row = self._drained = 0

    def next(self) -> Setpoint:
        """Take the next setpoint for the controller."""
        self.row += 1
        return Setpoint.of(self.commanded[self.row - 1])

    def drain_setpoints(self) -> bytes:
        """Return rows of all setpoints taken since the last call.

        Of every sample: two trajectories that begin alike may already command other speeds.
        """
        rows = b"".join(self._undrained) + self.commanded[self._drained : self.row].tobytes()
        self._undrained.clear()
        self._drained = self.row
        return rows
