"""One episode: cast, integrate, decide, log, follow; until something ends it."""

from __future__ import annotations

import math
import operator
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import mujoco
import numpy as np

from harness.config import LatencyConfig, to_json
from harness.inputs import CODEC, beams_from_info, encode_ranges, inputs_from_messages
from harness.log import LogWriter
from harness.navigator import Navigator, build_navigator
from harness.scenario import Scenario, sensor_info
from harness.schema import wayproof_pb2 as pb
from models.poses import Trail
from models.robots import Setpoint
from models.sensors import Caster
from models.truth import Truth
from planners import Trajectory

Outcome = Literal[
    "success", "collision", "fall", "timeout", "stuck", "out_of_bounds", "aborted", "error"
]

ODOMETRY_PERIOD = 0.01
"""Time between two poses of the trail by which the stack straightens a rolling sweep, s."""

STUCK_RADIUS = 0.3
"""Less movement than this within `episode.stuck_after` is no movement, m."""

LYING = 0.5
"""A walking robot whose base is below this share of its standing height has fallen."""


@dataclass(frozen=True)
class Result:
    """An episode's verdict and figures.

    Attributes:
        outcome: How it ended, by the simulator's truth.
        reason: In words.
        goal_distance_m: True distance from the goal at the end.
        sim_time_s: Simulated time.
        wall_time_s: Time that it took, compilation apart.
        decisions: Number of decisions.
        collisions: How often the robot started to touch something but the floor.
        min_clearance_m: Least true distance to anything but the floor, at decision times.
        path_length_m: Distance travelled.
        deadline_misses: Decisions past their deadline.
        chain: Hash over all decisions.
        log: The log's path.
    """

    outcome: Outcome
    reason: str
    goal_distance_m: float
    sim_time_s: float
    wall_time_s: float
    decisions: int
    collisions: int
    min_clearance_m: float
    path_length_m: float
    deadline_misses: int
    chain: str
    log: str

    def to_metadata(self) -> dict[str, str]:
        """The result as the log states it: all but where the log lies and how long it took."""
        fields = {k: v for k, v in asdict(self).items() if k not in ("log", "wall_time_s")}
        return {name: str(value) for name, value in fields.items()}


Observer = Callable[[pb.Decision, pb.Truth], None]


def run_episode(scenario: Scenario, log_path: Path, observe: Observer | None = None) -> Result:
    """Run one episode and write its log.

    Args:
        scenario: What to run.
        log_path: Final name of the log; it is replaced if it exists.
        observe: Called after each decision, for display.

    Raises:
        InputError: No map can be made for the mission, or the log cannot be written.
    """
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    beams = {info.name: beams_from_info(info) for info in infos}
    navigator = build_navigator(scenario.config, scenario.mission, beams)
    config, mission = to_json(scenario.config), scenario.mission.to_json()
    with LogWriter(log_path, config, mission, scenario.scene.mjcf) as log:
        for info in infos:
            log.write(f"/sensor/{info.name}/info", info, 0)
        return Episode(scenario, navigator, log, observe).run()


class Episode:
    """The loop's state: the simulation, the stack under test, and what is on its way between."""

    def __init__(
        self,
        scenario: Scenario,
        navigator: Navigator,
        log: LogWriter,
        observe: Observer | None = None,
    ) -> None:
        """Place the robot at the start."""
        self._scenario = scenario
        self._scene = scene = scenario.scene
        self._log = log
        self._observe = observe
        self._data = mujoco.MjData(scene.model)
        start, heading = np.array(scenario.mission.start), scenario.mission.start_heading
        scene.controller.reset(self._data, start, heading)
        self._truth = Truth(scene.model, scene.base, scene.floor)
        self._least_uprightness = math.cos(scenario.spec.max_tilt)
        self._navigator = navigator
        self._following = self._navigator.trajectory
        self._on_the_way: deque[Trajectory] = deque()
        base = int(scene.model.body_jntadr[scene.base])
        first = int(scene.model.jnt_qposadr[base])
        self._base_coordinates = slice(first, first + 7)
        # Poses of the base before each physics step of one decision period, for rolling shutters.
        self._steps: deque[np.ndarray] = deque(maxlen=_steps_a_decision(scenario))
        self._odometry_stride = max(1, round(ODOMETRY_PERIOD / float(scene.model.opt.timestep)))
        self._sequence = 0
        self._misses = 0
        self._positions: list[np.ndarray] = []
        self._clearances: list[float] = []

    def run(self) -> Result:
        """Decide at the sensors' rate, step the physics in between, and end with a verdict."""
        began = time.perf_counter()
        steps_a_decision = _steps_a_decision(self._scenario)
        verdict: tuple[Outcome, str] | None = None
        while verdict is None:
            decision = self._decide()
            verdict = self._verdict_of(decision)
            for _ in range(steps_a_decision):
                if verdict is not None:
                    break
                self._step_physics()
                verdict = self._verdict_of_physics()
        return self._finish(*verdict, time.perf_counter() - began)

    def _decide(self) -> pb.Decision:
        """Sense, decide and log; the trajectory takes effect when its start time comes."""
        time_ns = self._now_ns()
        mujoco.mj_kinematics(self._scene.model, self._data)
        sweeps, pose, sense_ms = self._sense(time_ns)
        inputs = inputs_from_messages(pose, sweeps)
        decision = self._navigator.step(inputs, sense_ms)
        latency = self._latency(decision, time_ns)
        self._navigator.commit(decision, latency.delay_s)
        if not decision.deadline_missed:
            self._on_the_way.append(self._navigator.trajectory)
        self._misses += decision.deadline_missed
        for sweep in sweeps:
            self._log.write(f"/sensor/{sweep.sensor}", sweep, time_ns)
        self._log.write("/pose", pose, time_ns)
        self._log.write("/latency", latency, time_ns)
        self._log.write("/decision", decision, time_ns)
        truth = self._write_truth(time_ns)
        if self._observe is not None:
            self._observe(decision, truth)
        self._sequence += 1
        return decision

    def _sense(self, time_ns: int) -> tuple[list[pb.Sweep], pb.Pose, float]:
        began = time.perf_counter()
        trail = self._trail()
        sweeps = [self._sweep(caster, trail, time_ns) for caster in self._scene.casters]
        sense_ms = (time.perf_counter() - began) * 1e3
        pose = pb.Pose(
            sequence=self._sequence,
            position=self._data.xpos[self._scene.base].tolist(),
            quaternion=self._data.xquat[self._scene.base].tolist(),
            position_sigma=0.0,  # the estimate is exact until an odometry model says otherwise
        )
        pose.timestamp.FromNanoseconds(time_ns)
        if any(caster.table.moments > 1 for caster in self._scene.casters):
            believed = trail.every(self._odometry_stride)
            pose.trail_positions.extend(believed.positions.ravel().tolist())
            pose.trail_quaternions.extend(believed.quaternions.ravel().tolist())
            pose.trail_period_s = believed.period
        return sweeps, pose, sense_ms

    def _trail(self) -> Trail:
        """True poses of the base since the sweeps began."""
        data, base = self._data, self._scene.base
        poses = [*self._steps, np.concatenate([data.xpos[base], data.xquat[base]])]
        stacked = np.array(poses)
        return Trail(stacked[:, :3], stacked[:, 3:], float(self._scene.model.opt.timestep))

    def _sweep(self, caster: Caster, trail: Trail, time_ns: int) -> pb.Sweep:
        table = caster.table
        rows = len(table.rows) if table.order == "grid" else 1
        ranges = caster.cast(self._data, trail, self._scenario.config.seed, self._sequence)
        message = pb.Sweep(
            sequence=self._sequence,
            sensor=caster.mount.name,
            rows=rows,
            columns=table.beams // rows,
            codec=CODEC,
            ranges=encode_ranges(ranges, rows),
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _latency(self, decision: pb.Decision, time_ns: int) -> pb.Latency:
        config = self._scenario.config.latency
        message = pb.Latency(
            sequence=self._sequence, mode=config.mode, delay_s=_delay(config, decision.stages)
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _write_truth(self, time_ns: int) -> pb.Truth:
        data, base = self._data, self._scene.base
        clearance = self._truth.clearance(data)
        self._positions.append(data.xpos[base].copy())
        self._clearances.append(clearance)
        message = pb.Truth(
            sequence=self._sequence,
            position=data.xpos[base].tolist(),
            quaternion=data.xquat[base].tolist(),
            velocity=data.qvel[:3].tolist(),
            clearance_m=clearance,
            collisions=self._truth.collisions,
        )
        message.timestamp.FromNanoseconds(time_ns)
        self._log.write("/truth", message, time_ns)
        return message

    def _step_physics(self) -> None:
        """One step of contact physics under the controller's torques and thrusts."""
        now_ns = self._now_ns()
        while self._on_the_way and self._on_the_way[0].start_ns <= now_ns:
            self._following = self._on_the_way.popleft()
        sample = self._following.at(now_ns)
        setpoint = Setpoint(sample.position, sample.velocity, sample.heading, sample.yaw_rate)
        self._scene.controller.follow(self._data, setpoint)
        self._steps.append(self._data.qpos[self._base_coordinates].copy())
        mujoco.mj_step(self._scene.model, self._data)
        self._truth.count_contacts(self._data)

    def _verdict_of(self, decision: pb.Decision) -> tuple[Outcome, str] | None:
        """What the decision ends: the goal it claims is checked against the truth."""
        config = self._scenario.config.episode
        if decision.action == "abort":
            return "aborted", decision.reason
        distance = self._goal_distance()
        if decision.action == "goal":
            if distance <= config.goal_tolerance:
                return "success", decision.reason
            return "aborted", f"claimed the goal from {distance:.2f} m away"
        if self._now_ns() * 1e-9 >= config.time_limit:
            return "timeout", f"{distance:.2f} m from the goal after {config.time_limit:g} s"
        window = round(config.stuck_after / _decision_period(self._scenario))
        recent = self._positions[-window:]
        if len(recent) == window and _spread(recent) < STUCK_RADIUS:
            return "stuck", f"less than {STUCK_RADIUS} m of movement in {config.stuck_after:g} s"
        return None

    def _verdict_of_physics(self) -> tuple[Outcome, str] | None:
        """What a physics step ends; called at each, so it compares plain floats."""
        mission, truth = self._scenario.mission, self._truth
        if truth.collisions:
            return "collision", f"touched an obstacle at {self._place()}"
        if not truth.uprightness(self._data) > self._least_uprightness:
            return "fall", f"tilted beyond {self._scenario.spec.max_tilt:g} rad at {self._place()}"
        position = self._data.xpos[self._scene.base].tolist()
        spec = self._scenario.spec
        if spec.motion == "ground" and position[2] < LYING * spec.rest_height:
            return "fall", f"lies on the floor at {self._place()}"
        if not all(map(operator.le, mission.low, position)) or not all(
            map(operator.le, position, mission.high)
        ):
            finite = all(map(math.isfinite, position))
            outcome: Outcome = "out_of_bounds" if finite else "error"
            return outcome, f"left the geofence at {self._place()}"
        return None

    def _finish(self, outcome: Outcome, reason: str, wall_time_s: float) -> Result:
        steps = np.diff(np.array(self._positions), axis=0)
        result = Result(
            outcome=outcome,
            reason=reason,
            goal_distance_m=self._goal_distance(),
            sim_time_s=self._now_ns() * 1e-9,
            wall_time_s=wall_time_s,
            decisions=self._sequence,
            collisions=self._truth.collisions,
            min_clearance_m=min(self._clearances),
            path_length_m=float(np.linalg.norm(steps, axis=1).sum()),
            deadline_misses=self._misses,
            chain=self._navigator.chain,
            log=str(self._log.path),
        )
        self._log.finish(result.to_metadata())
        return result

    def _goal_distance(self) -> float:
        """True distance from the goal, m; in the plane for a ground robot."""
        axes = 2 if self._scenario.mission.motion == "ground" else 3
        offset = self._data.xpos[self._scene.base] - np.array(self._scenario.mission.goal)
        return float(np.linalg.norm(offset[:axes]))

    def _place(self) -> str:
        position = self._data.xpos[self._scene.base]
        return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"

    def _now_ns(self) -> int:
        return round(float(self._data.time) * 1e9)


def _delay(config: LatencyConfig, stages: pb.StageLatency) -> float:
    """The delay that the robot experiences, s: modelled, or measured and rounded up to 1 ms."""
    if config.mode == "modelled":
        return config.expected
    measured = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
    return math.ceil(measured) * 1e-3


def _decision_period(scenario: Scenario) -> float:
    """Decisions follow the first sensor's rate, s."""
    return 1.0 / scenario.scene.casters[0].mount.device.rate


def _steps_a_decision(scenario: Scenario) -> int:
    return round(_decision_period(scenario) / float(scenario.scene.model.opt.timestep))


def _spread(positions: list[np.ndarray]) -> float:
    points = np.array(positions)
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
