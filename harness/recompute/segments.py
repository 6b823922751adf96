"""The stacks of a log that was forked, one after the other, each with the past of the one before.

A fork's stack has a map of its own, built with its own settings from all the sweeps since the
start; what it takes over is what was decided: the trajectory, the global path, the chain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from wayproof.harness.config import Config
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.mission import Mission
from wayproof.harness.recompute.side_by_side import guarded, layer_of, recompute, shift_height
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.pipeline import Navigator


@dataclass(frozen=True)
class Segment:
    """Decisions that were made with the same settings.

    Attributes:
        begin: Number of the first of them.
        config: The settings.
        mission: What the stack was told.
        beams: Sensor geometry by sensor name.
    """

    begin: int
    config: Config
    mission: Mission
    beams: Mapping[str, Beams]

    @property
    def period_s(self) -> float:
        """Time from one decision to the next, s: they follow the first sensor's rate."""
        return 1.0 / next(iter(self.beams.values())).rate


def segments_of(log: Log) -> list[Segment]:
    """A log's, in order; one if it was never forked."""
    begins = [0, *(fork.at for fork in log.forks)]
    parts = [(fork.config, fork.mission, fork.beams) for fork in log.forks]
    parts.append((log.config, log.mission, log.beams))
    return [Segment(begin, *part) for begin, part in zip(begins, parts, strict=True)]


class SegmentedStack:
    """One `step` or `watch` for each record, by the stack whose turn it is.

    Attributes:
        segment: Of the decision that comes next or was made last.
        navigator: Its stack.
    """

    def __init__(self, runs: Sequence[Segment]) -> None:
        """Start all stacks.

        Raises:
            InputError: There is no such stack.
        """
        beams = runs[0].beams
        stacks = [guarded("the log's stack", partial(_build, run, beams)) for run in runs]
        self.segment, *self._later = runs
        self.navigator, *self._waiting = stacks

    def step(self, record: Record) -> pb.Decision:
        """What is decided on one record; the stacks that wait take it into their maps.

        Raises:
            InputError: The inputs are none that a decision can be made on.
        """
        self.go_to(record.decision.sequence)
        decision = recompute(self.navigator, record)
        for stack in self._waiting:
            guarded(f"decision {decision.sequence}", partial(stack.mapper.update, record.inputs))
        return decision

    def watch(self, inputs: Inputs) -> Navigator:
        """The stack whose turn it is, with its map as it decides on these inputs; nobody decides.

        Raises:
            InputError: The inputs are none that a map can take.
        """
        self.go_to(inputs.sequence)
        for stack in (self.navigator, *self._waiting):
            guarded(f"decision {inputs.sequence}", partial(stack.mapper.integrate, inputs))
        return self.navigator

    def go_to(self, sequence: int) -> Navigator:
        """The stack that makes a decision, with all that the ones before it decided."""
        while self._later and self._later[0].begin <= sequence:
            before = self.navigator
            self.segment, *self._later = self._later
            self.navigator, *self._waiting = self._waiting
            higher = 0.0
            if self.segment.mission.motion == "ground":
                higher = layer_of(self.navigator) - layer_of(before)
            self.navigator.load_state(shift_height(before.state, higher), before.chain)
            for stack in (self.navigator, *self._waiting):
                stack.mapper.set_sensors(self.segment.beams)
        return self.navigator


def _build(run: Segment, beams: Mapping[str, Beams]) -> Navigator:
    return build_navigator(run.config, run.mission, beams)
