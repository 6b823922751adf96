"""The referee: the verdict on a command, by the harness's own map and costmap.

The space that the body sweeps before it is at rest is admitted if the unknown policy lets the body
enter all of it and all of it was seen recently, stale if a part was not, blocked if it overlaps
what is occupied or lies outside of the operating area, and else unknown. The same for every stack,
and a pure function of the logged inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.harness.interface.types import Array, Verdict
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import poses_from
from wayproof.harness.stack.obstruction import Obstruction
from wayproof.harness.stack.old_evidence import OldEvidence, old_evidence
from wayproof.harness.stack.types import PlannerInput, arc_length
from wayproof.planners import FreeSpace, Trajectory

ROUNDING_M = 1e-6
"""Slack of a free length, m."""


@dataclass(frozen=True)
class Judgement:
    """The verdict on one command and where it comes from.

    Attributes:
        verdict: `admitted`, `stale`, `unknown` or `blocked`.
        overlap: The first overlap with what the body may not enter; its length of way if none.
        old: The first place with old evidence, of what is stale.
    """

    verdict: Verdict
    overlap: Obstruction
    old: OldEvidence | None = None


def judge(trajectory: Trajectory, circumscribed: PlannerInput, oriented: PlannerInput) -> Judgement:
    """Judge the space that the body sweeps along a trajectory.

    Args:
        trajectory: Trajectory that it follows from the time of effect to its rest.
        circumscribed: Planner input with the free space of the disc or ball about the body.
        oriented: Planner input with that of the body's discs at their heading, or of a round body.
    """
    path, poses = _swept(trajectory, oriented)
    swept = poses if oriented.traversable.discs else path  # a round body may turn
    if (swept == swept[0]).all():  # it keeps its place; a body that creeps does not
        return Judgement("admitted", Obstruction(0.0))
    if is_free(circumscribed.traversable, oriented.traversable, poses, path):
        if (old := old_evidence(oriented, path)) is not None:
            return Judgement("stale", Obstruction(old.free_m), old)
        return Judgement("admitted", Obstruction(arc_length(path)))
    overlap = obstruction.on_poses(oriented, poses, oriented.unknown_blocks)
    blocked = not is_free(circumscribed.optimistic, oriented.optimistic, poses, path)
    return Judgement("blocked" if blocked else "unknown", overlap)


def _swept(trajectory: Trajectory, planner_input: PlannerInput) -> tuple[Array, Array]:
    """Return the path (m, 3), m, from the time of effect to rest, and poses (n, 4) on it.

    The path is not divided for a round body: a line through the corner of a cell, and its halves,
    may touch different cells by rounding.
    """
    elapsed = max((planner_input.effect_ns - trajectory.start_ns) * 1e-9, 0.0)
    return trajectory.path_after(elapsed), poses_from(trajectory, elapsed)


def is_free(
    circumscribed: FreeSpace, oriented: FreeSpace, poses: Array, path: Array | None = None
) -> bool:
    """Return whether the body is free at and between all poses: as one disc, or as it is headed.

    Args:
        circumscribed: Space of the disc or ball about the body.
        oriented: Space of its discs at their heading.
        poses: (n, 4), x, y, z, m, and heading, rad.
        path: (m, 3) that the poses lie on, m; by default straight lines between them.
    """
    if fits_along(circumscribed, poses[:, :3] if path is None else path):
        return True
    return bool(oriented.discs) and oriented.free_poses(poses) == len(poses)


def fits_along(space: FreeSpace, path: Array) -> bool:
    """Return whether a disc or ball is free all along a path (n, 3), its start with it."""
    free = space.is_free(path[0])  # which the length of a path of no length does not show
    return free and space.free_length(path) >= arc_length(path) - ROUNDING_M
