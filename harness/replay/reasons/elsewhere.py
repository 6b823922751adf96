"""Predicates of a robot that explores, backtracks or leaves the inflation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.log.paths import Array, length, place_at
from wayproof.harness.replay.reasons.along import NEAR, point_of, same
from wayproof.harness.replay.reasons.overlap import overlapped_here
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb


def looking_elsewhere(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way leads to a frontier: to admitted space beside unseen space."""
    yield from errand(scene, past, reason)
    now, before = scene.decision.sequence, past.for_this_goal()
    if reason.since == now and not _is_frontier(scene, point_of(reason.target)):
        yield "where it goes is no frontier"
    seen = max((one.places for one in before if one.kind == reason.kind), default=0)
    if not seen <= reason.places:
        yield f"{reason.places} places looked from, {seen} before"


def backing_up(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way leads to where the robot has been."""
    yield from errand(scene, past, reason)
    been = [scene.apart(one.position, point_of(reason.target)) for one in past.steps.values()]
    if not been or min(been) > 0.2:
        yield "it has not been where it goes back to"


def at_viewpoint(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot comes to rest where its way elsewhere led to."""
    yield from same("path_m", reason.path_m, length(scene.path))
    if not len(past.way) or scene.apart(scene.path[-1], past.way[-1]) > 0.2:
        yield "its way did not lead there"


def off_trajectory(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot is farther from its trajectory than is tolerated, and holds."""
    limit = scene.config.behaviour.tracking_tolerance
    yield from same("limit_m", reason.limit_m, limit)
    if not reason.distance_m > limit:
        yield f"{reason.distance_m:.2f} m off the trajectory is within what is tolerated"
    time_ns = scene.decision.timestamp.ToNanoseconds()
    followed = past.followed(time_ns)
    place = np.array(scene.mission.start) if followed is None else place_at(followed, time_ns)
    off = scene.apart(place, np.array(scene.decision.position))
    yield from same("distance_m", reason.distance_m, off, 0.05)


def escaping_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body overlaps a cell where it stands, and steps out."""
    yield from overlapped_here(scene, reason)
    yield from same("distance_m", reason.distance_m, length(scene.path))


def turning_out_of_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body overlaps a cell at its heading, and turns to another."""
    yield from overlapped_here(scene, reason)
    headings = scene.decision.trajectory.heading
    yield from same("turn_rad", reason.turn_rad, headings[-1] - headings[0], 0.02)


def errand(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way leads to the stated place, and has since the decision that set out."""
    if len(scene.global_path) < 2:
        yield "it names no way"
        return
    target = point_of(reason.target)
    yield from same("target", 0.0, scene.apart(scene.global_path[-1], target))
    yield from same("path_m", reason.path_m, scene.decision.path_length_m)
    now = scene.decision.sequence
    if reason.since > now or (reason.since < now and reason.since not in past.steps):
        yield f"there is no earlier decision {reason.since}"
    for step in past.since(reason.since, now):
        if step.kind == reason.kind and scene.apart(point_of(step.predicate.target), target) > NEAR:
            yield f"since decision {reason.since} it went elsewhere"
            return


def _is_frontier(scene: Scene, place: Array) -> bool:
    """Return whether a cell is admitted, and one beside it is not only because it was not seen."""
    if not scene.comparable:
        return True
    reach = scene.reach(min(scene.radii))
    cells = scene.cells_about(place[None], (reach + 3.0) * scene.size)
    here = tuple(cells.of(place[None])[0].tolist())
    admitted = cells.clearances(scene.unknown_blocks) > reach
    passable = cells.clearances(unknown_blocks=False) > reach
    if not admitted[here]:
        return False
    for axis in range(scene.axes):
        for step in (-1, 1):
            beside = (*here[:axis], here[axis] + step, *here[axis + 1 :])
            if passable[beside] and not admitted[beside]:
                return True
    return False
