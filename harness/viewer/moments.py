"""Decisions of a log, each with its map rebuilt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.explain.commanded import Commanded, Newest, commanded
from wayproof.harness.inputs import Beams
from wayproof.harness.log.reader import Log, Record
from wayproof.harness.recompute.keyframes import map_before, start_at, startable
from wayproof.harness.recompute.moments import SegmentedStack, segments_of
from wayproof.harness.recompute.side_by_side import as_input_error
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps import Costmap, Representation

Array = NDArray[np.float64]

NO_RETURN_MM = 65535


@dataclass(frozen=True)
class Moment:
    """One decision with its map.

    Attributes:
        record: Logged inputs, delay and decision.
        truth: Ground truth at that time.
        beams: Beam geometry by sensor name.
        navigator: Stack with the map of the decision; the next moment changes it.
        commanded: Command of a stack on trial; None of the built-in stack.
    """

    record: Record
    truth: pb.Truth
    beams: Mapping[str, Beams]
    navigator: Navigator
    commanded: Commanded | None = None

    @property
    def map(self) -> Representation:
        """Map of the decision."""
        return self.navigator.map

    @cached_property
    def costmap(self) -> Costmap:
        """Costmap of the decision, updated on first use."""
        what = f"decision {self.decision.sequence}"
        as_input_error(what, lambda: self.navigator.mapper.update_costmap(self.record.inputs))
        return self.navigator.costmap

    @property
    def stack_costmap(self) -> Newest | None:
        """A stack's own costmap that came with its command; None without one."""
        if self.commanded is None or self.commanded.costmap is None:
            return None
        return Newest(self.decision.sequence, self.commanded.costmap)

    @property
    def decision(self) -> pb.Decision:
        """Logged decision."""
        return self.record.decision

    @property
    def time_ns(self) -> int:
        """Simulated time, ns."""
        return self.record.inputs.time_ns

    def hits(self, most: int) -> Array:
        """Return the end points of beams with a return, at most `most`: (n, 3) m, world."""
        inputs = self.record.inputs
        ends = []
        for sweep in inputs.sweeps:
            beams = copy(self.beams[sweep.sensor])  # the stack's copy advances from sweep to sweep
            placed = beams.place(sweep, inputs.pose, inputs.sequence)
            met = np.flatnonzero((placed.ranges_mm > 0) & (placed.ranges_mm < NO_RETURN_MM))
            share = max(most // len(inputs.sweeps), 1)
            met = met[:: -(-len(met) // share) or 1]
            lengths = placed.ranges_mm[met, None] * 1e-3
            ends.append(placed.origins[placed.moments[met]] + lengths * placed.directions[met])
        return np.concatenate(ends)


def moments(log: Log, shown: int = 0) -> Iterator[Moment]:
    """Yield every decision of a log in order, with its map rebuilt from the sweeps.

    The decisions are the logged ones, so this is faster than a replay.

    Args:
        log: The log.
        shown: Number of the first decision whose map is needed; the maps before it may be empty,
            because it can be made from a keyframe.

    Raises:
        InputError: The log is damaged, or its sweeps were left out.
    """
    stack = SegmentedStack(segments_of(log))
    keyframe = map_before(startable(log, log.keyframes()), shown) if shown else None
    for record, truth in log.records_with_truth():
        if keyframe is None or record.decision.sequence > keyframe.sequence:
            stack.watch(record.inputs)
        elif record.decision.sequence == keyframe.sequence:
            start_at(stack, keyframe)
        navigator, now = stack.go_to(record.decision.sequence), stack.segment
        command = commanded(record.answer, record.decision)
        yield Moment(record, truth, now.beams, navigator, command)
