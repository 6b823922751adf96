"""One pass over the decisions of a log, or of an episode under way, for all that observe them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from wayproof.harness.config import Config
from wayproof.harness.goals import mission_towards
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.mission import Mission
from wayproof.harness.recompute.segments import SegmentedStack, segments_of
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
