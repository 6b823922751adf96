"""Predicates of a robot at rest without a path."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.log.paths import length
from wayproof.harness.replay.reasons.along import NEAR, same
from wayproof.harness.replay.reasons.overlap import (
    has_room,
    obstructed,
    overlapped,
    overlapped_here,
)
from wayproof.harness.replay.reasons.past import STILL, Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.replay.reasons.stopping import stops
from wayproof.harness.schema import wayproof_pb2 as pb


def waiting_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot rests before a cell that leaves too little of the way to set out."""
    way = scene.global_path if len(scene.global_path) > 1 else past.way
    yield from obstructed(scene, reason, way, scene.unknown_blocks)
    yield from same("limit_m", reason.limit_m, MIN_ADVANCE)
    if reason.free_m > reason.limit_m:  # both are rounded: equal ones may have differed
        yield f"{reason.free_m:.2f} m are free"
    yield from _waited(scene, past, reason)


def no_path_in_map(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that cells that are not known to be blocked do not connect the robot with the goal."""
    from scipy import ndimage

    yield from _searched(scene, past, reason)
    if not scene.comparable:
        return
    cells = scene.everywhere
    # Half a cell of tolerance: the search checks whole cells along straight segments.
    wide = cells.clearances(unknown_blocks=False) > scene.reach(min(scene.radii)) + 0.5
    areas, _ = ndimage.label(wide)
    here, there = cells.of(np.array([scene.path[0], scene.goal]))
    if areas[tuple(here)] and areas[tuple(here)] == areas[tuple(there)]:
        yield "the map has a way to the goal"


def no_path_found(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that a search that need not find every path has found none."""
    yield from _searched(scene, past, reason)


def goal_blocked(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body would overlap a cell at the goal, and at every place near it."""
    yield from overlapped(scene, reason, scene.goal, unknown_blocks=False)
    yield from same("limit_m", reason.limit_m, scene.config.behaviour.goal_search_radius)
    if has_room(scene, scene.goal, reason.limit_m, None, unknown_blocks=False):
        yield f"there is a free place within {reason.limit_m:.2f} m"
    yield from _waits_or_brakes(scene, past, reason)


def goal_inside_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body would overlap a cell at the goal, and stands as near as it can."""
    yield from overlapped(scene, reason, scene.goal, unknown_blocks=False)
    yield from same("distance_m", reason.distance_m, scene.apart(scene.path[0], scene.goal))
    if (
        scene.decision.action == "abort"
        and reason.waited_s < scene.config.behaviour.goal_wait_timeout
    ):
        yield f"gave up after {reason.waited_s:.1f} s"
    yield from _waited(scene, past, reason)


def no_room(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body would overlap a cell when it turns into the path, or along it."""
    within = reason.free_m if reason.kind == "no_room_along_path" else 0.0
    yield from overlapped(
        scene, reason, place=scene.path[0], unknown_blocks=scene.unknown_blocks, within=within
    )
    yield from _waited(scene, past, reason)


def no_way_out(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body overlaps a cell where it stands, and no free place is near."""
    yield from overlapped_here(scene, reason)
    yield from same("limit_m", reason.limit_m, 1.0)
    heading = scene.decision.trajectory.heading[0]
    if has_room(
        scene,
        about=scene.path[0],
        within=reason.limit_m,
        heading=heading,
        unknown_blocks=scene.unknown_blocks,
    ):
        yield f"there is a free place within {reason.limit_m:.2f} m"
    yield from _waited(scene, past, reason)


def way_out_blocked(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body overlaps a cell where it stands."""
    yield from overlapped_here(scene, reason)
    if reason.distance_m > 1.0 + scene.size:
        yield f"{reason.distance_m:.2f} m is no way out"
    yield from _waited(scene, past, reason)


def _searched(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that a search was made and names no path."""
    if not scene.decision.planner:
        yield "no search was made"
    if reason.iterations != scene.decision.planner_iterations:
        yield f"{reason.iterations} iterations, {scene.decision.planner_iterations} were made"
    yield from _waits_or_brakes(scene, past, reason)


def _waits_or_brakes(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot without a path is at rest as stated, or comes to rest."""
    if reason.HasField("stop_m"):
        yield from stops(scene, reason)
    else:
        yield from _waited(scene, past, reason)


def _waited(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot has been at rest as long as stated, and long enough for its action."""
    now_ns = scene.decision.timestamp.ToNanoseconds()
    begun_ns = now_ns - round(reason.waited_s * 1e9)
    numbers = [k for k, one in past.steps.items() if abs(one.time_ns - begun_ns) < 10_000]
    if reason.waited_s > NEAR and not numbers:
        yield f"no decision was made {reason.waited_s:.2f} s ago"
    elif numbers and any(one.moves for one in past.since(numbers[0], scene.decision.sequence)):
        yield f"it has moved within {reason.waited_s:.2f} s"
    if length(scene.path) >= STILL:
        yield "it moves"
    behaviour = scene.config.behaviour
    if (reason.frontier or reason.HasField("places")) and reason.waited_s < behaviour.wait_timeout:
        yield f"looked for a frontier after {reason.waited_s:.2f} s"
    if reason.HasField("places") and reason.places < behaviour.max_recoveries:
        yield f"gave up after {reason.places} places"
