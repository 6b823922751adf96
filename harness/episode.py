"""One episode: cast, integrate, decide, log, follow; until something ends it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from google.protobuf.message import Message

from harness.cause import Case, Contact, Moment, find_cause
from harness.cause.touch import touched
from harness.cause.true_space import TrueSpace
from harness.config import LatencyConfig, to_json
from harness.ending import Verdict
from harness.evidence.relay import Stretch
from harness.inputs import CODEC, beams_from_info, inputs_from_messages, serialized
from harness.interference import Interference
from harness.judge import Judge
from harness.logs.log import PLUGINS, TRACEBACK, LogWriter, hold_log
from harness.logs.log_copy import thin, topic_of
from harness.logs.streams import CONTROL, StreamHashes
from harness.mujoco_warnings import tell_warnings
from harness.outputs import Draft
from harness.plant import Plant
from harness.result import Outcome, Result
from harness.scenario import Scenario, sensor_info
from harness.schema import wayproof_pb2 as pb
from harness.stack.navigator import Navigator, build_navigator
from harness.state import Stateful, restore_parts, state_message
from harness.supervision import announce, bound_memory
from harness.user_code import (
    PASSED_ON,
    NeverReturned,
    Watchdog,
    failure_of,
    plugin_digests,
)
from models import range_codec
from models.poses import Trail
from models.sensors import ROBOT_GROUP, Caster
from planners import Trajectory

Observer = Callable[[pb.Decision, pb.Truth], None]


def run_episode(
    scenario: Scenario,
    log_path: Path | Draft,
    observe: Observer | None = None,
    delays: Mapping[int, float] | None = None,
    record: str | None = None,
) -> Result:
    """Run one episode and write its log.

    Args:
        scenario: What to run.
        log_path: Final name of the log, or a draft that holds it; a log of that name is replaced.
        observe: Called after each decision, for display.
        delays: Of each decision, s, to live through those of a log instead of measured ones.
        record: What to keep in place of the config's `record`.

    Raises:
        InputError: No map can be made for the mission, or the log cannot be written.
        Exception: A fault of Wayproof's own ended the episode; its log is finished as `error`.
    """
    tell_warnings()
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    beams = {info.name: beams_from_info(info) for info in infos}
    navigator = build_navigator(scenario.config, scenario.mission, beams)
    config, mission = to_json(scenario.config), scenario.mission.to_json()
    kept = record or scenario.config.record
    with log_path if isinstance(log_path, Draft) else hold_log(log_path) as draft:
        with LogWriter(draft, config, mission, scenario.scene.mjcf) as log:
            log.record = "decisions" if kept == "decisions" else "full"
            if digests := plugin_digests(scenario.config):
                log.note(PLUGINS, digests)
                announce(log.path)
            for info in infos:
                log.write(f"/sensor/{info.name}/info", info, 0)
            episode = Episode(scenario, navigator, log, observe)
            episode.delays.update(delays or {})
            with publishing_failures(draft, log):
                result = episode.run()
        return settle_log(draft, result, kept)


@contextlib.contextmanager
def publishing_failures(draft: Draft, log: LogWriter) -> Iterator[None]:
    """Give a log its name although the block raised, if it was finished before that."""
    try:
        yield
    except BaseException:
        if log.finished:
            draft.publish()
        raise


def settle_log(draft: Draft, result: Result, kept: str) -> Result:
    """Leave out of a finished log what `Config.record` does not keep, and give it its name.

    Returns:
        The result with the log's size.
    """
    thinned = None
    if kept == "decisions" or (kept == "failures" and result.outcome == "success"):
        thinned = draft.path.with_name(f"{draft.path.name}.thin")
        thin(draft.partial, thinned)
    draft.publish(thinned)
    size = draft.path.stat().st_size
    minutes = result.sim_time_s / 60.0
    return replace(result, log_mb_per_min=1e-6 * size / minutes if minutes else 0.0)


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
        self._navigator = navigator
        self._plant = plant = Plant(scenario, navigator.trajectory)
        self._judge = Judge(scenario, plant.data, plant.truth)
        self._interference = Interference(scenario.config, scene)
        sensors = [f"sensor/{caster.mount.name}" for caster in scene.casters]
        self._streams = StreamHashes([*sensors, "pose", "latency", "world", CONTROL])
        self._streams.update("world", scene.mjcf.encode())
        self._world = np.flatnonzero(scene.model.geom_group != ROBOT_GROUP)
        self.parts: dict[str, Stateful] = {  # all that a fork must restore, in this order
            "simulation": plant.simulation,
            "controller": scene.controller,
            "truth": plant.truth,
            "estimate": plant.estimate,
            "streams": self._streams,
        }
        if plant.traffic is not None:
            self.parts["traffic"] = plant.traffic
        if plant.rolling:
            self.parts["steps"] = plant.step_poses
        self.delays: dict[int, float] = {}  # by sequence, in place of what is measured
        self._watchdog = Watchdog(scenario.config)
        self._following = False  # whether the newest decision is logged, and the body follows it
        self._chain = navigator.chain  # of the decisions in the log
        self._sequence = 0
        self._misses = 0
        self._positions: list[np.ndarray] = []
        self._clearances: list[float] = []
        self._moments: list[Moment] = []

    def go_on(
        self,
        state: pb.State | None,
        trajectories: Sequence[tuple[int, Trajectory]],
        decisions: Sequence[pb.Decision],
        truths: Sequence[pb.Truth],
    ) -> None:
        """Put the episode where it was before a decision; `run` then goes on with that one.

        Args:
            state: Of the simulation and every part, at that decision; none at the first.
            trajectories: All committed before it, the start's own apart, each with its arrival, ns.
            decisions: All before it.
            truths: Of each of these.

        Raises:
            InputError: The state is not one of this episode.
        """
        self._sequence = len(decisions)
        if state is not None:
            restore_parts(self.parts, state)
            if (traffic := self._plant.traffic) is not None:
                traffic.show(self._plant.data)  # moved on after the step that MuJoCo repeated
        self._plant.expect(trajectories)  # the ones that began leave the queue by themselves
        self._misses = sum(decision.deadline_missed for decision in decisions)
        self._positions = [np.array(truth.position) for truth in truths]
        self._clearances = [truth.clearance_m for truth in truths]

    def run(self) -> Result:
        """Decide at the sensors' rate, step the physics in between, and end with a verdict.

        Code that fails ends the episode as `error`, with its traceback in the log.

        Raises:
            Exception: Wayproof's own code failed; the log is finished all the same.
        """
        began = time.perf_counter()
        try:
            verdict = self._until_verdict()
        except PASSED_ON:
            raise
        except (Exception, NeverReturned) as error:
            bound_memory(None)  # what is left to do takes memory, too
            place = f"{'after' if self._following else 'at'} decision {self._newest}"
            failure = failure_of(error, place, self._watchdog.names)
            self._log.attach(TRACEBACK, failure.traceback)
            result = self._finish("error", failure.reason, time.perf_counter() - began)
            if failure.ours:
                error.add_note(f"{place}; the log is {self._log.path}")
                raise
            return replace(result, traceback=failure.traceback)
        return self._finish(*verdict, time.perf_counter() - began)

    @property
    def _newest(self) -> int:
        """Number of the decision that is being made or followed."""
        return self._sequence - self._following

    def _until_verdict(self) -> Verdict:
        verdict: Verdict | None = None
        while verdict is None:
            decision = self._decide()
            verdict = self._judge.of_decision(decision, self._positions)
            if verdict is None:
                with self._watchdog.watching():
                    verdict = self._follow()
        return verdict

    def _follow(self) -> Verdict | None:
        """Physics up to the next decision, or to what ends the episode."""
        for left in reversed(range(self._plant.steps_a_decision)):
            if self._plant.step(remember=left == 0) and (verdict := self._judge.of_physics()):
                return verdict
        return None

    def _decide(self) -> pb.Decision:
        """Sense, decide and log; the trajectory takes effect when its start time comes."""
        self._following = False
        time_ns = self._plant.now_ns
        if asked := self._plant.take_asked():  # nothing at the start of a fork, whose state has it
            self._streams.update(CONTROL, asked)
        mujoco.mj_kinematics(self._scene.model, self._plant.data)
        sweeps, pose, sense_ms = self._sense(time_ns)
        written = [serialized(message) for message in (*sweeps, pose)]
        inputs = inputs_from_messages(pose, sweeps, written)
        with self._watchdog.watching():
            decision = self._navigator.step(inputs, sense_ms)
        latency = self._latency(decision, time_ns)
        self._navigator.commit(decision, latency.delay_s)
        if not decision.deadline_missed:
            trajectory = self._navigator.trajectory
            self._plant.expect([(arrival_ns(decision, trajectory), trajectory)])
        self._misses += decision.deadline_missed
        self._write_state(time_ns)
        for message, data in zip((*sweeps, pose), written, strict=True):
            self._log_input(message, data, time_ns)
        self._log_input(latency, serialized(latency), time_ns)
        self._log.write("/decision", decision, time_ns)
        self._write_streams(time_ns)
        truth = self._write_truth(time_ns)
        self._moments.append(Moment(pose, tuple(sweeps), latency, decision, truth))
        if self._observe is not None:
            self._observe(decision, truth)
        self._sequence += 1
        self._chain, self._following = decision.chain, True
        if self._watchdog.names:  # whatever comes of the user's code, this decision is kept
            self._log.flush()
        return decision

    def _sense(self, time_ns: int) -> tuple[list[pb.Sweep], pb.Pose, float]:
        began = time.perf_counter()
        trail, estimate = self._plant.trail(), self._plant.estimate
        arriving = self._interference.arriving(self._scene.casters, self._sequence)
        sweeps = [self._sweep(caster, trail, time_ns) for caster in arriving]
        sense_ms = (time.perf_counter() - began) * 1e3
        estimate.advance(time_ns, trail.positions[-1], trail.quaternions[-1])
        pose = estimate.pose(trail, self._plant.rolling)
        pose.sequence = self._sequence
        pose.timestamp.FromNanoseconds(time_ns)
        return sweeps, pose, sense_ms

    def _sweep(self, caster: Caster, trail: Trail, time_ns: int) -> pb.Sweep:
        table = caster.table
        rows = len(table.rows) if table.order == "grid" else 1
        sweep = self._plant.data, trail, self._sequence
        ranges, classes = self._interference.cast(caster, *sweep)
        message = pb.Sweep(
            sequence=self._sequence,
            sensor=caster.mount.name,
            rows=rows,
            columns=table.beams // rows,
            codec=CODEC,
            ranges=range_codec.encode(ranges, rows),
            classes=classes.tobytes(),
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _latency(self, decision: pb.Decision, time_ns: int) -> pb.Latency:
        config = self._scenario.config.latency
        delay_s = self.delays.get(self._sequence)
        if delay_s is None:
            delay_s = _delay(config, decision.stages) + self._interference.delay
        message = pb.Latency(sequence=self._sequence, mode=config.mode, delay_s=delay_s)
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _log_input(self, message: Message, data: bytes, now: int) -> None:
        topic = topic_of(message)
        self._log.write(topic, message, now, data)
        self._streams.update(topic[1:], data)

    def _write_streams(self, time_ns: int) -> None:
        """What reached the stack so far as hashes, and what the perturbation did to it."""
        data = self._plant.data
        moved = data.geom_xpos[self._world], data.geom_xmat[self._world]
        self._streams.update("world", b"".join(part.tobytes() for part in moved))
        self._log.write("/streams", self._streams.message(self._sequence, time_ns), time_ns)
        done = self._interference.message(self._sequence, time_ns, self._plant.estimate.added)
        if done is not None:
            self._log.write("/perturbation", done, time_ns)

    def _write_state(self, time_ns: int) -> None:
        """Save the simulator's state, from the second decision on: the first is the start."""
        if self._sequence > 0 and self._log.keeps("/state"):
            message = state_message(self.parts, self._sequence)
            message.timestamp.FromNanoseconds(time_ns)
            self._log.write("/state", message, time_ns)

    def _write_truth(self, time_ns: int) -> pb.Truth:
        plant, truth = self._plant, self._plant.truth
        clearance = truth.clearance(plant.data)
        self._positions.append(plant.position.copy())
        self._clearances.append(clearance)
        message = pb.Truth(
            sequence=self._sequence,
            position=plant.position.tolist(),
            quaternion=plant.quaternion.tolist(),
            velocity=plant.data.qvel[:3].tolist(),
            clearance_m=clearance,
            collisions=truth.collisions,
            struck=truth.struck,
        )
        for mover in plant.traffic.states() if plant.traffic else ():
            message.movers.add(**mover._asdict())
        message.timestamp.FromNanoseconds(time_ns)
        self._log.write("/truth", message, time_ns)
        return message

    def _finish(self, outcome: Outcome, reason: str, wall_time_s: float) -> Result:
        steps = np.diff(np.array(self._positions).reshape(-1, 3), axis=0)
        result = Result(
            outcome=outcome,
            reason=reason,
            goal_distance_m=self._judge.goal_distance(),
            sim_time_s=self._plant.now_ns * 1e-9,
            wall_time_s=wall_time_s,
            decisions=self._sequence,
            collisions=self._plant.truth.collisions,
            struck=self._plant.truth.struck,
            min_clearance_m=min(self._clearances, default=math.nan),
            path_length_m=float(np.linalg.norm(steps, axis=1).sum()),
            route_length_m=self._scenario.route_length(),
            deadline_misses=self._misses,
            chain=self._chain,
            log=str(self._log.path),
        )
        result = self._with_cause(result)
        self._log.finish(result.to_metadata())
        return result

    def _with_cause(self, result: Result) -> Result:
        """A failure's cause; of a forked episode `explain` works it out from the whole log."""
        if result.outcome == "success":
            return result
        contact = touched(self._scene, self._plant.data) if result.outcome == "collision" else None
        result = replace(result, contact="" if contact is None else str(contact))
        if len(self._moments) < self._sequence or result.outcome == "error":
            return result
        finding = find_cause(self._case(result, contact))
        assert finding is not None
        return replace(
            result,
            cause=finding.cause,
            cause_evidence=finding.evidence,
            cause_decision=finding.decision,
        )

    def _case(self, result: Result, contact: Contact | None) -> Case:
        scenario = self._scenario
        return Case(
            config=scenario.config,
            mission=scenario.mission,
            runs=(stretch_of(scenario),),
            outcome=result.outcome,
            reason=result.reason,
            end_s=result.sim_time_s,
            contact=contact,
            moments=tuple(self._moments),
            space=TrueSpace(self._scene.mjcf),
        )


def stretch_of(scenario: Scenario, begin: int = 0) -> Stretch:
    """What a scenario's stack decides, from a decision on."""
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    beams = {info.name: beams_from_info(info) for info in infos}
    return Stretch(begin, scenario.config, scenario.mission, beams)


def arrival_ns(decision: pb.Decision, trajectory: Trajectory) -> int:
    """When the robot begins to follow what was decided: at its start, or late, as it arrives."""
    arrival = decision.timestamp.ToNanoseconds() + round(decision.delay_s * 1e9)
    return max(trajectory.start_ns, arrival)


def _delay(config: LatencyConfig, stages: pb.StageLatency) -> float:
    """The delay that the robot experiences, s: modelled, or measured and rounded up to 1 ms."""
    if config.mode == "modelled":
        return config.expected
    measured = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
    return math.ceil(measured) * 1e-3
