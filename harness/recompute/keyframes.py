"""Stacks started at keyframes of a log, and the pieces that keyframes cut it into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.moments import SegmentedStack, segments_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.keyframe import restore_map, restore_state

LEAST_DECISIONS = 40
"""Minimum number of decisions of a piece: a process takes as long to load its kernels."""


@dataclass(frozen=True)
class Piece:
    """Consecutive decisions of a log, recomputed from a keyframe.

    Attributes:
        keyframe: State that it starts with; None at the start of the log.
        end: Number after its last decision; None for the end of the log.
    """

    keyframe: pb.Keyframe | None
    end: int | None

    def holds(self, sequence: int) -> bool:
        """Return whether a decision is one of it."""
        begin = 0 if self.keyframe is None else self.keyframe.sequence + 1
        return begin <= sequence and (self.end is None or sequence < self.end)


WHOLE = Piece(None, None)
"""The whole log as one piece."""


def startable(log: Log, keyframes: Sequence[pb.Keyframe]) -> list[pb.Keyframe]:
    """Return the keyframes that a stack can start at: those after the last fork.

    The stack of a fork has a map of its own, which an earlier keyframe does not hold.
    """
    return [one for one in keyframes if log.fork is None or one.sequence >= log.fork.at]


def map_before(keyframes: Sequence[pb.Keyframe], sequence: int) -> pb.Keyframe | None:
    """Return the last keyframe with a map up to a decision; None if there is none."""
    return next(
        (one for one in reversed(keyframes) if one.sequence <= sequence and one.HasField("map")),
        None,
    )


def stack_at(log: Log, keyframes: Sequence[pb.Keyframe], keyframe: pb.Keyframe) -> SegmentedStack:
    """Return the stacks of a log after the decision of a keyframe.

    The map is that of the last keyframe with one, with the inputs since then.

    Args:
        log: The log.
        keyframes: Keyframes that a stack can start at.
        keyframe: One of them.

    Raises:
        InputError: The log is damaged, a stack cannot be built, or a keyframe holds no state of
            such a stack.
    """
    stack = SegmentedStack(segments_of(log))
    before = map_before(keyframes, keyframe.sequence)
    if before is not None:
        start_at(stack, before)
    if before is not keyframe:
        for record in log.records(before):
            stack.watch(record.inputs)
            if record.decision.sequence == keyframe.sequence:
                break
    try:
        restore_state(stack.navigator, keyframe)
    except ValueError as error:
        raise _broken(keyframe, error) from None
    return stack


def start_at(stack: SegmentedStack, keyframe: pb.Keyframe) -> None:
    """Give a stack the map of a keyframe.

    Raises:
        InputError: It holds none of such a stack.
    """
    try:
        restore_map(stack.go_to(keyframe.sequence), keyframe)
    except ValueError as error:
        raise _broken(keyframe, error) from None


def _broken(keyframe: pb.Keyframe, error: ValueError) -> InputError:
    return InputError(f"keyframe after decision {keyframe.sequence}: {error}")


def pieces_of(keyframes: Sequence[pb.Keyframe], decisions: int, most: int) -> list[Piece]:
    """Cut a log into pieces of about as many decisions.

    Args:
        keyframes: Keyframes that a stack can start at.
        decisions: About, the number of decisions in the log.
        most: Maximum number of pieces.
    """
    cuts: list[pb.Keyframe] = []
    for number in range(1, most):
        least = cuts[-1].sequence + 1 if cuts else 0
        fitting = [
            one
            for one in keyframes
            if least + LEAST_DECISIONS <= one.sequence + 1 <= decisions - LEAST_DECISIONS
        ]
        if fitting:
            even = number * decisions / most
            cuts.append(min(fitting, key=lambda one: abs(one.sequence + 1 - even)))
    ends = [*(one.sequence + 1 for one in cuts), None]
    return [Piece(*each) for each in zip([None, *cuts], ends, strict=True)]
