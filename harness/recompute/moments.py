"""One pass over the decisions of a log by its stacks, or of an episode under way, for observers.

The stack of a fork has a map of its own, built with its own settings from all the sweeps since the
start. It takes over the planner state: the trajectory, the global path, the chain of hashes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from wayproof.harness.config import Config
from wayproof.harness.goals import mission_towards
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.interface.build import navigator_for
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.mission import Mission
from wayproof.harness.recompute.side_by_side import (
    as_input_error,
    layer_of,
    recompute,
    shift_height,
)
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator


@dataclass(frozen=True)
class Moment:
    """One decision with what it was made on.

    Attributes:
        record: Inputs, delay and decision, as logged.
        config: Settings of the decision.
        mission: Mission of the decision, with its goal.
        navigator: Stack with the map of the decision; the next moment changes it.
        recomputed: The decision made again; None where it was not.
        truth: Ground truth at that time; None where it was not read.
    """

    record: Record
    config: Config
    mission: Mission
    navigator: Navigator
    recomputed: pb.Decision | None = None
    truth: pb.Truth | None = None

    @property
    def decision(self) -> pb.Decision:
        """Logged decision."""
        return self.record.decision


Observer = Callable[[Moment], None]


def moments(
    log: Log,
    *,
    decide: bool = False,
    stack: SegmentedStack | None = None,
    after: pb.Keyframe | None = None,
    returns: bool = False,
) -> Iterator[Moment]:
    """Yield every decision of a log in order, with its map rebuilt from the sweeps.

    Args:
        log: The log.
        decide: Whether each decision is made again.
        stack: Stack in the state before the first of them; by default that of the start.
        after: Keyframe after whose decision the first of them is; None for all.
        returns: Whether the map of the returns as they came is kept, too.

    Raises:
        InputError: The log is damaged or cannot be recomputed, or its sweeps were left out.
    """
    stack = stack or SegmentedStack(segments_of(log))
    if returns:
        stack.keep_returns()
    for record in log.records(after):
        recomputed = None
        if decide:
            recomputed = stack.step(record)
        else:
            stack.watch(record.inputs)
        now = stack.segment
        mission = mission_towards(now.mission, record.inputs.goal)
        yield Moment(record, now.config, mission, stack.navigator, recomputed)


@dataclass(frozen=True)
class Segment:
    """Consecutive decisions made with the same settings.

    Attributes:
        begin: Number of the first decision.
        config: Settings.
        mission: Mission of the stack.
        beams: Beam geometry by sensor name.
    """

    begin: int
    config: Config
    mission: Mission
    beams: Mapping[str, Beams]

    @property
    def period_s(self) -> float:
        """Time between decisions, s; the first sensor triggers them."""
        return 1.0 / next(iter(self.beams.values())).rate


def segments_of(log: Log) -> list[Segment]:
    """Return the segments of a log in order; one if it was never forked."""
    begins = [0, *(fork.at for fork in log.forks)]
    parts = [(fork.config, fork.mission, fork.beams) for fork in log.forks]
    parts.append((log.config, log.mission, log.beams))
    return [Segment(begin, *part) for begin, part in zip(begins, parts, strict=True)]


class SegmentedStack:
    """One stack for each segment; `step` or `watch` each record with the current one.

    Attributes:
        segment: Segment of the current stack.
        navigator: Current stack.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        """Build all stacks.

        Raises:
            InputError: A stack cannot be built with its settings.
        """
        beams = segments[0].beams
        stacks = [as_input_error("the log's stack", partial(_build, s, beams)) for s in segments]
        self.segment, *self._later = segments
        self.navigator, *self._waiting = stacks

    def keep_returns(self) -> None:
        """Keep the map of the returns as they come for each stack as well; before the first."""
        for stack in (self.navigator, *self._waiting):
            stack.mapper.keep_returns()

    def step(self, record: Record) -> pb.Decision:
        """Decide on one record; later stacks integrate its inputs into their maps.

        Raises:
            InputError: The user's class failed, or there is too little memory.
        """
        self.go_to(record.decision.sequence)
        decision = recompute(self.navigator, record)
        what = f"decision {decision.sequence}"
        for stack in self._waiting:
            as_input_error(what, partial(stack.mapper.update, record.inputs))
        return decision

    def watch(self, inputs: Inputs) -> Navigator:
        """Integrate the inputs of a decision without deciding; return the current stack.

        Raises:
            InputError: There is too little memory.
        """
        self.go_to(inputs.sequence)
        what = f"decision {inputs.sequence}"
        for stack in (self.navigator, *self._waiting):
            as_input_error(what, partial(stack.mapper.integrate, inputs))
        return self.navigator

    def go_to(self, sequence: int) -> Navigator:
        """Make the stack of a decision the current one, in the state of the one before."""
        while self._later and self._later[0].begin <= sequence:
            before = self.navigator
            self.segment, *self._later = self._later
            self.navigator, *self._waiting = self._waiting
            higher = 0.0
            if self.segment.mission.planar:
                higher = layer_of(self.navigator) - layer_of(before)
            self.navigator.load_state(shift_height(before.state, higher), before.chain)
            if isinstance(self.navigator, TrialNavigator) and isinstance(before, TrialNavigator):
                self.navigator.take_over(before)
            for stack in (self.navigator, *self._waiting):
                stack.mapper.set_sensors(self.segment.beams)
        return self.navigator


def _build(segment: Segment, beams: Mapping[str, Beams]) -> Navigator:
    return navigator_for(segment.config, segment.mission, beams)
