"""The stack in shadow mode: it decides at each pose of a recording, and nothing follows it.

The recorded robot did not do as it was commanded. So before each decision the planner state is that
of a robot at rest at the recorded pose: what was committed before is void. The global path is kept
where it still begins near the robot, so that a search is made as seldom as it is on a robot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.inputs import Inputs
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.state import Array, PlannerState, Tries
from wayproof.planners import arc_lengths, hold, point_at

NEAR_PATH = 0.5
"""Greatest distance between the robot and a global path that is kept, m: half the width of a
corridor that the narrowest robot passes."""

LEAST_REJOIN = 0.5
"""Least length of path that is skipped there, m: a robot beside its path hardly turns."""

JOINING_POINTS = 11
"""Points of the straight piece that rejoins a path: the logged one is every fifth."""

REJOIN = 2.0
"""Length of path that is skipped where the robot rejoins it, in units of its distance from it: the
robot then turns by less than 30 degrees."""


class AtRecordedPoses(Navigator):
    """Decides from rest at each recorded pose."""

    def step(
        self, inputs: Inputs, sense_ms: float = 0.0, answer: pb.StackCommand | None = None
    ) -> pb.Decision:
        """Take the recorded pose as that of the robot at rest, and decide."""
        position = self.mapper.planning_point(inputs.pose.position)
        self.state = at_rest(self.state, position, inputs.pose.heading, inputs.time_ns)
        return super().step(inputs, sense_ms, answer)


def at_rest(state: PlannerState, position: Array, heading: float, time_ns: int) -> PlannerState:
    """Return the planner state of a robot that rests at a pose, wherever it was commanded to be.

    Args:
        state: Planner state after the last decision; not written to.
        position: (3,) in the costmap's frame, m.
        heading: rad.
        time_ns: Time of the pose.
    """
    path = None if state.route is None else rejoined(state.route.path, position)
    state = replace(state, route=None) if path is None else state.along(path)
    return replace(
        state,
        committed=(hold(position, time_ns, heading),),
        path_loss=None,
        rest_since_ns=-1,
        tries=Tries(returns=state.tries.returns),
    )


def rejoined(path: Array, position: Array) -> Array | None:
    """Return the rest of a path (n, 3), from a position (3,) that is near it; None if it is not."""
    arcs = arc_lengths(path)
    along, away = nearest_on(path, arcs, position)
    if away > NEAR_PATH:
        return None
    ahead = along + max(REJOIN * away, LEAST_REJOIN)
    if ahead >= arcs[-1]:
        return np.stack([position, path[-1]])
    shares = np.linspace(0.0, 1.0, JOINING_POINTS)[:, None]
    joining = position + shares * (point_at(path, ahead) - position)
    joined = np.vstack([joining, path[arcs > ahead]])
    kept = np.append(True, np.abs(np.diff(joined, axis=0)).max(axis=1) > 1e-9)
    rest: Array = joined[kept]
    return rest if len(rest) > 1 else None


def nearest_on(path: Array, arcs: Array, position: Array) -> tuple[float, float]:
    """Return the arc length of a path's (n, 3) nearest point to a position, and its distance, m."""
    if len(path) == 1:
        return 0.0, float(np.sqrt(np.square(path[0] - position).sum()))
    starts, steps = path[:-1], np.diff(path, axis=0)
    squares = np.maximum(np.square(steps).sum(axis=1), 1e-18)
    shares = np.clip(((position - starts) * steps).sum(axis=1) / squares, 0.0, 1.0)
    offsets = starts + shares[:, None] * steps - position
    distances = np.sqrt(np.square(offsets).sum(axis=1))
    best = int(distances.argmin())
    along = arcs[best] + shares[best] * (arcs[best + 1] - arcs[best])
    return float(along), float(distances[best])


class ShadowNavigator(AtRecordedPoses, Navigator):
    """The built-in stack in shadow mode."""
