"""One episode: sense, perturb, decide, log, simulate; until something ends it."""

from __future__ import annotations

import contextlib
import math
import statistics
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import mujoco
from google.protobuf.message import Message

from wayproof.harness.config import LatencyConfig
from wayproof.harness.ending import Verdict
from wayproof.harness.errors import NeverReturned
from wayproof.harness.goals import goal_message, goals_claimed, mission_towards
from wayproof.harness.input_messages import inputs_from_messages, serialized
from wayproof.harness.inputs import Inputs
from wayproof.harness.interface.errors import PLUGIN_FAILED, OutsideError
from wayproof.harness.log.reader import Record
from wayproof.harness.log.writer import TRACEBACK, LogWriter
from wayproof.harness.recompute.moments import Moment, Observer
from wayproof.harness.result import Outcome, Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.recorder import Recorder
from wayproof.harness.sim.sensing import Sensors
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.snapshot import Stateful, restore_parts
from wayproof.harness.sim.termination import TerminationMonitor, first_contact
from wayproof.harness.stack.keyframe import Schedule, keyframe_of
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.prediction import Predicted
from wayproof.harness.supervision import bound_memory
from wayproof.harness.user_code import PASSED_ON, Watchdog, failure_of
from wayproof.planners import Trajectory


class Sensed(NamedTuple):
    """Inputs sensed at one instant, as they are logged.

    Attributes:
        messages: Sweeps, pose, the goal of a mission with several, and the prediction of a
            predictor from outside, with their bytes.
        sense_ms: Wall time of casting the sweeps, ms.
        predict_ms: Wall time until the prediction came, ms.
    """

    messages: tuple[tuple[Message, bytes], ...]
    sense_ms: float
    predict_ms: float = 0.0


class Episode:
    """The loop of one episode: simulation, stack under test, log.

    Attributes:
        delays: Delay of decisions by number, s, in place of the measured or modelled one.
        fault: Exception of Wayproof's own code, if that ended the episode.
        inputs: Inputs of the next decision.
        decision: The newest one in the log; none before the first.
        result: Verdict and figures, once the episode has ended.
    """

    def __init__(
        self,
        scenario: Scenario,
        navigator: Navigator,
        log: LogWriter,
        observe: Observer | None = None,
    ) -> None:
        """Place the robot at the start."""
        self._scenario, self._scene = scenario, scenario.scene
        self._navigator, self._log, self._observe = navigator, log, observe
        self._simulation = Simulation(scenario, navigator.trajectory)
        simulation = self._simulation
        self._termination = TerminationMonitor(scenario, simulation.data, simulation.truth)
        self._injector = PerturbationInjector(scenario.config, scenario.scene)
        self._sensors = Sensors(scenario.scene, simulation, self._injector)
        self._recorder = Recorder(scenario, log, simulation, self._injector)
        self._watchdog = Watchdog(scenario.config)
        self.delays: dict[int, float] = {}
        self.fault: Exception | NeverReturned | None = None
        self.result: Result | None = None
        self.inputs: Inputs
        self.decision: pb.Decision | None = None
        self._sensed: Sensed
        self._began = time.perf_counter()
        self._sequence = 0
        self._keyframes = Schedule(scenario.config, 0)
        self._reached = 0  # goals before the next decision
        self._chain = navigator.chain  # of the decisions in the log
        self._following = False  # whether the newest decision is logged, and the body follows it

    @property
    def data(self) -> mujoco.MjData:
        """State of the simulation."""
        return self._simulation.data

    @property
    def parts(self) -> dict[str, Stateful]:
        """All that a fork must restore, by name."""
        return self._recorder.parts

    def resume(
        self,
        state: pb.State | None,
        trajectories: Sequence[tuple[int, Trajectory]],
        decisions: Sequence[pb.Decision],
        truths: Sequence[pb.Truth],
        seen: Iterable[Inputs] = (),
    ) -> None:
        """Restore the episode before a decision; `run` then continues with that one.

        Args:
            state: Snapshot of every part at that decision; none at the first.
            trajectories: All committed before it, without that of the start, with arrivals, ns.
            decisions: All before it.
            truths: One for each of these.
            seen: Inputs of all decisions up to this one, from which an estimator's map is made.

        Raises:
            InputError: The state belongs to another episode.
        """
        self._sequence, self._reached = len(decisions), goals_claimed(decisions)
        if decisions:
            newest_ns = decisions[-1].timestamp.ToNanoseconds()
            self._keyframes = Schedule(self._scenario.config, newest_ns)
        if state is not None:
            restore_parts(self.parts, state)
            if (traffic := self._simulation.traffic) is not None:
                traffic.show(self._simulation.data)  # it moved after the step that MuJoCo repeated
        for inputs in seen if state is not None else ():
            self._simulation.estimate.integrate(inputs)
        self._simulation.enqueue(trajectories)  # the ones that began leave the queue by themselves
        self._recorder.resume(decisions, truths)

    def run(self, until: int | None = None) -> Result:
        """Sense, decide and simulate up to a verdict.

        Args:
            until: Number of the decision after which the episode is abandoned; by default none.
        """
        self.sense()
        while self.result is None:
            self.step()
            if until is not None and self.result is None and self._sequence > until:
                self.abandon(f"abandoned after decision {until}")
        return self.result

    def sense(self) -> None:
        """Take the sweeps and the pose of this instant: the inputs of the next decision."""
        with self._ending_if_it_fails():
            self._following = False
            time_ns = self._simulation.now_ns
            self._recorder.hash_control(self._simulation.drain_setpoints())
            if self.decision is not None and self.decision.action == "goal":
                self._reached += 1  # a false claim, and that of the last goal, end the episode
            sweeps, pose, sense_ms = self._sensors.sense(self._sequence, time_ns)
            self._navigator.announce()
            goal = goal_message(self._scenario.mission, self._reached, self._sequence, time_ns)
            predicted = self._predict(time_ns)
            prediction = None if predicted is None else predicted.message
            given = (*sweeps, pose, goal, prediction)
            messages = [message for message in given if message is not None]
            written = [serialized(message) for message in messages]
            self.inputs = inputs_from_messages(pose, sweeps, written, goal, prediction)
            self._simulation.estimate.integrate(self.inputs)
            self._sensed = Sensed(
                (*zip(messages, written, strict=True),),
                sense_ms,
                0.0 if predicted is None else predicted.took_ms,
            )

    def step(self, answer: pb.StackCommand | None = None) -> None:
        """Decide on the sensed inputs, simulate up to the next decision, and sense there.

        Args:
            answer: Answer of a stack on trial to the inputs; by default the navigator queries it.
        """
        verdict: Verdict | None = None
        with self._ending_if_it_fails():
            decision = self._decide(answer)
            verdict = self._termination.check_decision(
                decision, self._recorder.positions, self._reached
            )
            if verdict is None:
                with self._watchdog.watching():
                    verdict = self._follow()
            self._write_keyframe(decision, is_last=verdict is not None)
        if self.result is not None:  # it failed
            return
        if verdict is None:
            self.sense()
        else:
            self.result = self._result(*verdict)

    def abandon(self, reason: str) -> None:
        """End the episode as an `error` before its verdict."""
        self.result = self._result("error", reason)

    def truth(self) -> pb.Truth:
        """Return the simulator's truth of this instant."""
        return self._recorder.truth(self._sequence, self._simulation.now_ns)

    def goal_distance(self) -> float:
        """Return the true straight distance to the next goal and on through the others, m."""
        return self._termination.distance_left(self._reached)

    @contextlib.contextmanager
    def _ending_if_it_fails(self) -> Iterator[None]:
        """End as `error` where code fails; its traceback is in the log.

        If it is Wayproof's own, it is the `fault`.
        """
        try:
            yield
        except PASSED_ON:
            raise
        except (Exception, NeverReturned) as error:
            self.result = self._failed(error)

    def _predict(self, time_ns: int) -> Predicted | None:
        """Request the prediction of a predictor from outside on the map of the decision before."""
        with self._watchdog.watching():
            return self._navigator.predict(self._sequence, time_ns)

    def _decide(self, answer: pb.StackCommand | None) -> pb.Decision:
        """Decide and log; the trajectory takes effect when its start time comes."""
        inputs = self.inputs
        with self._watchdog.watching():
            decision = self._navigator.step(inputs, self._sensed.sense_ms, answer)
        decision.stages.predict_ms = self._sensed.predict_ms
        latency = self._latency(decision, inputs.time_ns)
        self._navigator.commit(decision, latency.delay_s)
        if not decision.deadline_missed:
            trajectory = self._navigator.trajectory
            self._simulation.enqueue([(arrival_ns(decision, trajectory), trajectory)])
        self._record(inputs.time_ns, [*self._sensed.messages], latency, decision)
        return decision

    def _record(
        self,
        time_ns: int,
        inputs: list[tuple[Message, bytes]],
        latency: pb.Latency,
        decision: pb.Decision,
    ) -> None:
        """Log the decision with its inputs, and the truth."""
        messages = [*inputs, (latency, serialized(latency))]
        if (answer := self._navigator.answer) is not None:
            messages.append((answer, serialized(answer)))
        truth = self._recorder.record(messages, decision, time_ns)
        if self._observe is not None:
            self._observe(self._moment(latency, decision, truth))
        self._sequence += 1
        self.decision = decision
        self._chain, self._following = decision.chain, True
        if self._watchdog.names:  # whatever the user's code does next, this decision is kept
            self._log.flush()

    def _moment(self, latency: pb.Latency, decision: pb.Decision, truth: pb.Truth) -> Moment:
        """Return the decision with what it was made on, for the observer."""
        config, mission = self._scenario.config, self._scenario.mission
        return Moment(
            record=Record(self.inputs, latency, decision, answer=self._navigator.answer),
            config=config,
            mission=mission_towards(mission, self.inputs.goal),
            navigator=self._navigator,
            recomputed=decision,
            truth=truth,
        )

    def _write_keyframe(self, decision: pb.Decision, is_last: bool) -> None:
        """Log the state of the stack where it is due; a counterfactual's follows from no log."""
        time_ns, schedule = self.inputs.time_ns, self._keyframes
        sensed = sum(len(data) for _, data in self._sensed.messages)
        due = schedule.is_due(time_ns, sensed)
        with_map = (due or is_last) and schedule.holds_map(time_ns, is_last)
        if type(self._navigator) is not Navigator or not (due or with_map):
            return
        keyframe = keyframe_of(self._navigator, decision, with_map)
        map_bytes = len(keyframe.map.records)
        if with_map and is_last and not schedule.has_room(map_bytes, self._log.size()):
            if not due:
                return
            keyframe.ClearField("map")
        self._log.write("/keyframe", keyframe, time_ns)
        if keyframe.HasField("map"):
            schedule.wrote_map(time_ns, map_bytes)

    def _follow(self) -> Verdict | None:
        """Simulate up to the next decision, or to a verdict."""
        for left in reversed(range(self._simulation.steps_per_decision)):
            if self._simulation.step(save=left == 0) and (
                verdict := self._termination.check_physics()
            ):
                return verdict
        return None

    def _latency(self, decision: pb.Decision, time_ns: int) -> pb.Latency:
        config = self._scenario.config.latency
        delay_s = self.delays.get(self._sequence)
        if delay_s is None:
            on_trial = self._navigator.answer is not None
            delay_s = _delay(config, decision.stages, on_trial) + self._injector.delay
        message = pb.Latency(sequence=self._sequence, mode=config.mode, delay_s=delay_s)
        message.timestamp.FromNanoseconds(time_ns)
        return message

    def _failed(self, error: Exception | NeverReturned) -> Result:
        """End as `error`, with the traceback in the log."""
        bound_memory(None)  # finishing the log takes memory, too
        newest = self._sequence - self._following  # the decision being made or followed
        place = f"{'after' if self._following else 'at'} decision {newest}"
        failure = failure_of(error, place, self._watchdog.names)
        if failure.traceback:
            self._log.attach(TRACEBACK, failure.traceback)
        if failure.ours:
            error.add_note(f"{place}; the log is {self._log.path}")
            self.fault = error
        result = self._result("error", failure.reason)
        if isinstance(error, OutsideError):
            result = replace(
                result,
                cause=PLUGIN_FAILED,
                cause_evidence=failure.reason,
                cause_decision=newest,
            )
        return replace(result, traceback=failure.traceback)

    def _result(self, outcome: Outcome, reason: str) -> Result:
        contact = (
            first_contact(self._scene, self._simulation.truth, self._simulation.data)
            if outcome == "collision"
            else None
        )
        figures = self._recorder.figures()
        return Result(
            outcome=outcome,
            reason=reason,
            goal_distance_m=self.goal_distance(),
            sim_time_s=self._simulation.now_ns * 1e-9,
            wall_time_s=time.perf_counter() - self._began,
            decisions=self._sequence,
            collisions=self._simulation.truth.collisions,
            struck=self._simulation.truth.hits_by_movers,
            min_clearance_m=figures["min_clearance_m"],
            path_length_m=figures["path_length_m"],
            route_length_m=self._scenario.route_length(),
            deadline_misses=round(figures["deadline_misses"]),
            commands=round(figures["commands"]),
            not_admitted=round(figures["not_admitted"]),
            first_not_admitted=round(figures["first_not_admitted"]),
            decision_ms=statistics.median([one.took_ms for one in self._recorder.fates] or [0.0]),
            chain=self._chain,
            log=str(self._log.path),
            contact="" if contact is None else str(contact),
        )


def arrival_ns(decision: pb.Decision, trajectory: Trajectory) -> int:
    """Time at which the robot begins to follow a trajectory: its start, or its late arrival, ns."""
    arrival = decision.timestamp.ToNanoseconds() + round(decision.delay_s * 1e9)
    return max(trajectory.start_ns, arrival)


def _delay(config: LatencyConfig, stages: pb.StageLatency, on_trial: bool) -> float:
    """Return the delay of a decision, s: modelled, or measured and rounded up to 1 ms.

    Of a stack on trial its answer alone counts: the referee's map is no part of it.
    """
    if config.mode == "modelled":
        return config.expected
    if on_trial:
        return math.ceil(stages.answer_ms) * 1e-3
    measured = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
    return math.ceil(measured) * 1e-3
