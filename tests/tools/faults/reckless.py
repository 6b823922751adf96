"""Stacks that disregard their maps, as examples of failures of the stack itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.stack.footprint_mode import FootprintDecision
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.planner_input import FreeSpaceBuilder
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.state import Route
from wayproof.harness.stack.types import Array, Command, PlannerInput, arc_length
from wayproof.planners import Disc, PathState, follow_path


class Reckless(Navigator):
    """Stack that goes straight to its goal, regardless of the map."""

    def _decide(self, planner_input: PlannerInput) -> FootprintDecision:
        decided = super()._decide(planner_input)
        if decided.command.action == "goal":
            return decided
        given = decided.input
        if given.sequence == 0:
            self._straight = follow_path(
                np.stack([given.position, given.goal]),
                PathState(
                    given.effect_ns,
                    arc_length=0.0,
                    speed=0.0,
                    acceleration=0.0,
                    heading=given.heading,
                ),
                given.gait.limits,
                given.gait.limits.speed,
            )
        straight = self._straight
        # It claims that the whole path is admitted, which an audit finds false where it is not.
        reason = Reason("following", free_m=arc_length(straight.path))
        command = Command(
            "follow", reason, label="none", trajectory=straight, global_path=straight.path
        )
        committed = (*decided.state.committed[:-1], straight)
        state = replace(decided.state, committed=committed, route=Route(straight.path))
        return FootprintDecision(command, state, given)


class PointSpaces(FreeSpaceBuilder):
    """Free space of a point body."""

    def _threshold(self, circumscribed: bool) -> int:
        return 1

    def _costs(self) -> Array:
        costs = super()._costs()
        return np.where(np.isfinite(costs), costs, costs[np.isfinite(costs)].max())

    def _discs(self) -> tuple[Disc, ...]:
        return ()


class Uninflated(Navigator):
    """Stack that plans for a point, although it knows the radius of its body."""

    SPACES = PointSpaces
