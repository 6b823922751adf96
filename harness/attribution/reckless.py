"""Stacks that disregard their maps: what a failure of the stack itself looks like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.spaces import FreeSpaces
from wayproof.harness.stack.types import Array, Choice, Memory, View, length
from wayproof.planners import Disc, follow_path


class Reckless(Navigator):
    """A stack that goes straight for its goal, whatever its map holds."""

    def _decide(self, view: View) -> tuple[Choice, Memory, View]:
        choice, memory, view = super()._decide(view)
        if choice.action == "goal":
            return choice, memory, view
        if view.sequence == 0:
            path = np.stack([view.position, view.goal])
            start = path, view.effect_ns, 0.0, 0.0, 0.0, view.heading
            self._straight = follow_path(*start, view.limits, view.limits.speed)
        straight = self._straight
        # It claims that all of it is admitted, which an audit finds false wherever it is not.
        reason = Reason("path_to_goal", path_m=length(straight.path))
        choice = Choice("follow", reason, "none", straight, straight.path)
        return choice, replace(memory, trajectory=straight, guide=straight.path), view


class PointSpaces(FreeSpaces):
    """Free space for a body without extent."""

    def _threshold(self, wide: bool) -> int:
        return 1

    def _costs(self) -> Array:
        costs = super()._costs()
        return np.where(np.isfinite(costs), costs, costs[np.isfinite(costs)].max())

    def _discs(self) -> tuple[Disc, ...]:
        return ()


class Uninflated(Navigator):
    """A stack that takes its body for a point, though it knows its radius."""

    SPACES = PointSpaces
