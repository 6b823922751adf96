"""One episode: sense, perturb, decide, log, simulate; until something ends it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from google.protobuf.message import Message

from wayproof.harness.config import LatencyConfig
from wayproof.harness.ending import Verdict
from wayproof.harness.errors import NeverReturned
from wayproof.harness.inputs import inputs_from_messages, serialized
from wayproof.harness.interface.errors import StackError
from wayproof.harness.log.writer import TRACEBACK, LogWriter
from wayproof.harness.result import Outcome, Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.harness.sim.recorder import Recorder
from wayproof.harness.sim.sensing import Sensors
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.snapshot import Stateful, restore_parts
from wayproof.harness.sim.termination import TerminationMonitor, first_contact
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.supervision import bound_memory
from wayproof.harness.user_code import PASSED_ON, Watchdog, failure_of
from wayproof.planners import Trajectory

Observer = Callable[[pb.Decision, pb.Truth], None]


class Episode:
    """The loop of one episode: simulation, stack under test, log.

    Attributes:
        delays: Delay of decisions by number, s, in place of the measured or modelled one.
        fault: Exception of Wayproof's own code, if that ended the episode.
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
        self._sequence = 0
        self._chain = navigator.chain  # of the decisions in the log
        self._following = False  # whether the newest decision is logged, and the body follows it

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
    ) -> None:
        """Restore the episode before a decision; `run` then continues with that one.

        Args:
            state: Snapshot of every part at that decision; none at the first.
            trajectories: All committed before it, without that of the start, with arrivals, ns.
            decisions: All before it.
            truths: One for each of these.

        Raises:
            InputError: The state belongs to another episode.
        """
        self._sequence = len(decisions)
        if state is not None:
            restore_parts(self.parts, state)
            if (traffic := self._simulation.traffic) is not None:
                traffic.show(self._simulation.data)  # it moved after the step that MuJoCo repeated
        self._simulation.enqueue(trajectories)  # the ones that began leave the queue by themselves
        self._recorder.resume(decisions, truths)

    def run(self) -> Result:
        """Decide at the sensors' rate, simulate in between, and end with a verdict.

        Code that fails ends the episode as `error`, with its traceback in the log; if it is
        Wayproof's own, it is the `fault`.
        """
        began = time.perf_counter()
        try:
            outcome, reason = self._until_verdict()
        except PASSED_ON:
            raise
        except (Exception, NeverReturned) as error:
            return self._failed(error, began)
        return self._result(outcome, reason, began)

    def _until_verdict(self) -> Verdict:
        verdict: Verdict | None = None
        while verdict is None:
            decision = self._decide()
            verdict = self._termination.check_decision(decision, self._recorder.positions)
            if verdict is None:
                with self._watchdog.watching():
                    verdict = self._follow()
        return verdict

    def _decide(self) -> pb.Decision:
        """Sense, decide and log; the trajectory takes effect when its start time comes."""
        self._following = False
        time_ns = self._simulation.now_ns
        self._recorder.hash_control(self._simulation.drain_setpoints())
        sweeps, pose, sense_ms = self._sensors.sense(self._sequence, time_ns)
        written = [serialized(message) for message in (*sweeps, pose)]
        inputs = inputs_from_messages(pose, sweeps, written)
        with self._watchdog.watching():
            decision = self._navigator.step(inputs, sense_ms)
        latency = self._latency(decision, time_ns)
        self._navigator.commit(decision, latency.delay_s)
        if not decision.deadline_missed:
            trajectory = self._navigator.trajectory
            self._simulation.enqueue([(arrival_ns(decision, trajectory), trajectory)])
        self._record(time_ns, [*zip((*sweeps, pose), written, strict=True)], latency, decision)
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
            self._observe(decision, truth)
        self._sequence += 1
        self._chain, self._following = decision.chain, True
        if self._watchdog.names:  # whatever the user's code does next, this decision is kept
            self._log.flush()

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

    def _failed(self, error: Exception | NeverReturned, began: float) -> Result:
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
        result = self._result("error", failure.reason, began)
        if isinstance(error, StackError):
            result = replace(
                result,
                cause=error.cause,
                cause_evidence=failure.reason,
                cause_decision=newest,
            )
        return replace(result, traceback=failure.traceback)

    def _result(self, outcome: Outcome, reason: str, began: float) -> Result:
        contact = (
            first_contact(self._scene, self._simulation.data) if outcome == "collision" else None
        )
        figures = self._recorder.figures()
        return Result(
            outcome=outcome,
            reason=reason,
            goal_distance_m=self._termination.goal_distance(),
            sim_time_s=self._simulation.now_ns * 1e-9,
            wall_time_s=time.perf_counter() - began,
            decisions=self._sequence,
            collisions=self._simulation.truth.collisions,
            struck=self._simulation.truth.hits_by_movers,
            min_clearance_m=figures["min_clearance_m"],
            path_length_m=figures["path_length_m"],
            route_length_m=self._scenario.route_length(),
            deadline_misses=round(figures["deadline_misses"]),
            chain=self._chain,
            log=str(self._log.path),
            contact="" if contact is None else str(contact),
        )


def arrival_ns(decision: pb.Decision, trajectory: Trajectory) -> int:
    """Time at which the robot begins to follow a trajectory: its start, or its late arrival, ns."""
    arrival = decision.timestamp.ToNanoseconds() + round(decision.delay_s * 1e9)
    return max(trajectory.start_ns, arrival)


def _delay(config: LatencyConfig, stages: pb.StageLatency, on_trial: bool) -> float:
    """Delay of a decision, s: modelled, or measured and rounded up to 1 ms.

    Of a stack on trial its answer alone counts: the referee's map is no part of it.
    """
    if config.mode == "modelled":
        return config.expected
    if on_trial:
        return math.ceil(stages.answer_ms) * 1e-3
    measured = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
    return math.ceil(measured) * 1e-3
