"""A stack on trial in the navigator's place: it commands, and the referee judges.

Live, the stack is queried and its answer is logged; from a log the logged answer stands for it, so
that a replay needs no stack. All else follows from the logged inputs.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

from google.protobuf.message import DecodeError

from wayproof.harness.config import Config
from wayproof.harness.decision import Label
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.interface.command_messages import (
    CommandError,
    check_command,
    motion_of,
    planned_path_of,
)
from wayproof.harness.interface.connect import Session
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.motion import Followed, commanded
from wayproof.harness.interface.motion_checks import MotionError
from wayproof.harness.interface.observations import ObservationBuilder
from wayproof.harness.interface.referee import Judgement, fits_along, judge
from wayproof.harness.interface.types import Fate, Observation
from wayproof.harness.mission import Mission
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.footprint_mode import FootprintDecision
from wayproof.harness.stack.manoeuvres.old_evidence import reason_of
from wayproof.harness.stack.manoeuvres.stopping import brake
from wayproof.harness.stack.obstruction import braking_reason, obstructed
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.shadowing import AtRecordedPoses
from wayproof.harness.stack.situation import not_yet_superseded
from wayproof.harness.stack.types import Command, PlannerInput, distance, is_stationary
from wayproof.planners import Trajectory, TrajectorySample, hold, remaining


class TrialNavigator(Navigator):
    """Judges the commands of a stack on trial, and has the robot follow them.

    Attributes:
        answer: The command that the last decision was made with, as it is logged.
        session: The stack, started; none where answers come from a log.
    """

    def __init__(
        self,
        config: Config,
        mission: Mission,
        beams: Mapping[str, Beams],
        session: Session | None = None,
    ) -> None:
        """Start at rest, with an unknown map but for the start area.

        Args:
            config: Settings; those of map and costmap are the referee's.
            mission: Mission of the episode.
            beams: Sensor geometry by sensor name.
            session: The stack, started; none where answers come from a log.
        """
        super().__init__(config, mission, beams)
        self._mission, self.session = mission, session
        self._observations = ObservationBuilder(config, mission, beams)
        self._fate: Fate | None = None
        self._judgement: tuple[Judgement, bool] | None = None  # and whether the guard cut
        self._limited = False
        self.answer: pb.StackCommand | None = None

    def step(
        self, inputs: Inputs, sense_ms: float = 0.0, answer: pb.StackCommand | None = None
    ) -> pb.Decision:
        """Query the stack, or take its logged answer; integrate, judge and record.

        Raises:
            StackError: The stack failed, or its command is none that a body can follow.
        """
        began = time.perf_counter()
        self.answer = self.query(inputs) if answer is None else answer
        answer_ms = (time.perf_counter() - began) * 1e3
        decision = super().step(inputs, sense_ms)
        decision.stages.plan_ms += answer_ms
        decision.stages.answer_ms = answer_ms
        return decision

    def announce(self) -> None:
        """Wake the stack before its observation comes."""
        if self.session is not None:
            self.session.announce()

    def query(self, inputs: Inputs) -> pb.StackCommand:
        """Return the stack's answer to the observation of these inputs, as it is logged."""
        if self.session is None:
            raise InputError(f"decision {inputs.sequence}: no answer of the stack in the log")
        return logged_answer(self.session.query(self.observe(inputs)), inputs.time_ns)

    def observe(self, inputs: Inputs) -> Observation:
        """Return the observation that a stack gets of these inputs; once for each, in order."""
        return self._observations.build(inputs, self.state.trajectory, self._fate)

    def take_over(self, before: TrialNavigator) -> None:
        """Go on with the session of another navigator, and with what its stack has observed."""
        self.session, self._fate = before.session, before._fate
        self._observations.take_over(before._observations)

    def commit(self, decision: pb.Decision, delay_s: float) -> pb.Decision:
        """Commit the decision with the delay that it had, and add it to the chain."""
        decision = super().commit(decision, delay_s)
        assert self._judgement is not None
        judgement, cut = self._judgement
        fate = "late" if decision.deadline_missed else "cut" if cut else "followed"
        self._fate = Fate(decision.sequence, fate, judgement.verdict)  # type: ignore[arg-type]
        return decision

    def _decide_and_record(
        self, inputs: Inputs, planner_input: PlannerInput, version: str
    ) -> pb.Decision:
        decision = super()._decide_and_record(inputs, planner_input, version)
        assert self._judgement is not None
        judgement, cut = self._judgement
        decision.verdict.verdict = judgement.verdict
        decision.verdict.free_m = judgement.overlap.free_m
        decision.verdict.cut = cut
        decision.verdict.limited = self._limited
        return decision

    def _decide(self, planner_input: PlannerInput) -> FootprintDecision:
        """Judge the command, and follow it unless the guard brakes in its place."""
        oriented = planner_input
        if self._input_builder.elongated:
            oriented = self._input_builder.oriented(planner_input)
        command = self._command()
        start = self.state.trajectory.at(planner_input.effect_ns)
        trajectory, self._limited = self._trajectory(command, planner_input)
        judgement = judge(trajectory, planner_input, oriented)
        cut = self._config.stack.guard and judgement.verdict != "admitted"
        self._judgement = judgement, cut
        if cut:
            decided = self._brake(oriented, judgement, start)
        else:
            decided = self._follow(command, trajectory, planner_input, judgement)
        committed = (*not_yet_superseded(planner_input, self.state), decided.trajectory)
        state = replace(self.state, committed=committed)
        fits = fits_along(planner_input.traversable, decided.trajectory.path)
        footprint = planner_input if fits else oriented
        return FootprintDecision(decided, state, footprint)

    @property
    def _who(self) -> str:
        return f"stack '{self._config.stack.name}'"

    def _command(self) -> sb.Command:
        """Decode the answer.

        Raises:
            StackError: It is no command.
        """
        assert self.answer is not None
        try:
            command = sb.Command.FromString(self.answer.command)
            check_command(command)
        except (DecodeError, CommandError) as error:
            raise StackError(self._who, f"sent a command with {error}") from None
        return command

    def _trajectory(self, command: sb.Command, planner_input: PlannerInput) -> Followed:
        """Return the trajectory of a command; without a motion the last one stands."""
        followed = self.state.trajectory
        try:
            motion = motion_of(command)
            if motion is None:
                return Followed(followed, limited=False)
            planar = self._mission.motion == "ground"
            here, effect_ns = planner_input.position, planner_input.effect_ns
            return commanded(motion, followed, here, effect_ns, planner_input.gait, planar)
        except (CommandError, MotionError) as error:
            raise StackError(self._who, f"sent a command with {error}") from None

    def _follow(
        self,
        command: sb.Command,
        trajectory: Trajectory,
        planner_input: PlannerInput,
        judgement: Judgement,
    ) -> Command:
        """Follow the stack's command regardless of the verdict."""
        action = self._action(command, trajectory, planner_input)
        reason = obstructed("commanded", judgement.overlap)
        path = planned_path_of(command)
        label: Label = command.label or "none"  # type: ignore[assignment]
        return Command(action, reason, label, trajectory, path)  # type: ignore[arg-type]

    def _brake(
        self, planner_input: PlannerInput, judgement: Judgement, start: TrajectorySample
    ) -> Command:
        """Brake along the last trajectory, in the stack's place."""
        unknown = judgement.verdict == "unknown"
        label: Label = "unknown_ahead" if unknown else "path_blocked"
        reason, _ = braking_reason(judgement.overlap)
        if judgement.old is not None:
            label, reason = "map_stale", reason_of(planner_input, judgement.old)
        if is_stationary(start):
            trajectory = hold(start.position, planner_input.effect_ns, start.heading)
            return Command("stop_and_wait", reason, label, trajectory)
        path = remaining(self.state.trajectory.path, start.arc_length)
        return brake(planner_input, self.state, start, path, reason, label).command

    def _action(
        self, command: sb.Command, trajectory: Trajectory, planner_input: PlannerInput
    ) -> str:
        """Return the action of a command: its own, or by where its motion leads.

        A goal is reached at rest: a claim of it in motion is none.
        """
        if command.action not in ("", "goal"):
            return command.action
        now, followed = planner_input, not_yet_superseded(planner_input, self.state)[0]
        arrived = distance(now.position, now.goal) <= now.goal_tolerance
        claims = command.action == "goal"
        return action_after(trajectory, followed, now.time_ns, now.effect_ns, claims or arrived)


def action_after(
    trajectory: Trajectory, followed: Trajectory, time_ns: int, effect_ns: int, arrived: bool
) -> str:
    """Return the action of a motion, by where it leads.

    Args:
        trajectory: Trajectory of the motion.
        followed: Trajectory that the body follows.
        time_ns: Time of the decision, ns.
        effect_ns: Time of its effect, ns.
        arrived: Whether the body is at its goal, or the command claims so.
    """
    if (effect_ns - trajectory.start_ns) * 1e-9 < trajectory.duration_s:
        return "follow"
    return "goal" if arrived and followed.at(time_ns).at_rest else "stop_and_wait"


def logged_answer(command: sb.Command, time_ns: int) -> pb.StackCommand:
    """Return a command that answers the observation of its sequence, as it is logged.

    Args:
        command: Command of the stack.
        time_ns: Time of the observation, ns.
    """
    sent = command.SerializeToString(deterministic=True)
    answer = pb.StackCommand(sequence=command.sequence, command=sent)
    answer.timestamp.FromNanoseconds(time_ns)
    return answer


class ShadowTrialNavigator(AtRecordedPoses, TrialNavigator):
    """A stack on trial in shadow mode."""
