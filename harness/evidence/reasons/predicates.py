"""What each kind of reason claims, worked out anew from the map, the pose and the log's own past.

A predicate yields a text for each part of its claim that does not hold. Paths in a log are thinned,
so that lengths along them are compared to within `ARC` and `ARC_SHARE`, and room along them is
looked for with a body that is a cell smaller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from harness.evidence.reasons.past import STILL, Past
from harness.evidence.reasons.scene import Array, Scene, arcs_of, densely
from harness.inputs import heading_of
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import path_of

NEAR = 1e-3
"""Figures that are worked out in two ways differ by less, m, s and rad."""

ARC, ARC_SHARE = 0.15, 0.05
"""So much [m], and that share of it, may a length along a thinned path be off."""

BENT = 0.1
"""So far is a path from its thinned form, m."""

TURNED = 0.35
"""So far is the direction of a path from that of its thinned form, or a body off its heading, rad.
"""

CORNER = 0.6
"""So far before and behind a corner its turn is looked for, m."""

PIECE = 20
"""So many places of a way, half a cell apart, are looked at together."""

Claim = Callable[[Scene, Past, pb.Reason], Iterator[str]]


def path_to_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """All of the path is admitted, and it ends where it says."""
    yield from _path_ends(scene, reason)
    if not len(scene.guide):
        return
    yield from _free_before(scene, scene.guide, math.inf)
    if not scene.mission.discs:
        yield from _same("path_m", reason.path_m, _length(scene.path))


def braking_to_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The path to its end is no longer than the robot needs to stop."""
    yield from path_to_goal(scene, past, reason)
    yield from _stop(scene, reason)
    if reason.path_m - reason.stop_m > 0.011:
        yield f"{reason.path_m:.2f} m are left, and {reason.stop_m:.2f} m are enough to stop"


def path_to_corner(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The committed part ends at a corner of the path that is too sharp to take in motion."""
    yield from _path_ends(scene, reason)
    yield from _committed(scene, reason.free_m)
    if not reason.free_m < reason.path_m or not len(scene.guide):
        yield "the corner is not on the path"
        return
    turn = max(
        # Near its begin a thinned path has no corner, but the one before it has.
        _turn_at(way, scene.path, _nearest(way, scene.path[-1], scene)[0])
        for way in (scene.guide, past.way)
        if len(way) > 1
    )
    if turn < scene.config.behaviour.stop_corner - TURNED:
        yield f"the path turns by {turn:.2f} rad at {reason.free_m:.2f} m, which is no corner"


def driving_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The way is free up to a cell, and slow is what that costs."""
    yield from _obstructed(scene, reason, scene.guide, scene.unknown_blocks)
    yield from _committed(scene, reason.free_m)
    limits = scene.mission
    full = _stop_from(limits.max_speed * scene.config.motion.speed_fraction, limits)
    yield from _same("full_speed_stop_m", reason.full_speed_stop_m, full, 0.01)
    slow = reason.free_m < reason.full_speed_stop_m
    if (scene.decision.action == "slow") != slow:
        yield f"action {scene.decision.action}, with {reason.free_m:.2f} m admitted"


def through_unknown(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The committed part leads through unknown space, which the policy lets it, slowly."""
    yield from _obstructed(scene, reason, scene.guide, unknown_blocks=True)
    if scene.config.map.unknown_policy != "penalize":
        yield f"unknown policy {scene.config.map.unknown_policy}"
    yield from _same("speed_share", reason.speed_share, scene.config.behaviour.penalized_speed)
    if reason.free_m > _length(scene.path) + NEAR:
        yield "what is unknown lies beyond the committed part"


def turning_into_path(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body stays in its place and turns to where the path leads."""
    if _length(scene.path) >= STILL:
        yield "the trajectory leaves its place"
    towards = _heading(scene.decision) + reason.turn_rad
    first = _direction(scene.guide, 0.0, 0.3)
    off = min(abs(_wrapped(towards - first)), abs(_wrapped(towards - first - math.pi)))
    if off > TURNED:
        yield f"the path leads {off:.2f} rad off where it turns to"


def keeping_course(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The trajectory is the last one."""
    last = past.trajectories[-1] if past.trajectories else None
    if last is None or last.path != scene.decision.trajectory.path:
        yield "the trajectory is another one than the last"


def looking_elsewhere(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The way leads to a frontier: to admitted space beside what only has not been seen."""
    yield from _errand(scene, past, reason)
    now, before = scene.decision.sequence, [one.grounds for one in past.steps.values()]
    if reason.since == now and not _is_frontier(scene, _array(reason.target)):
        yield "where it goes is no frontier"
    seen = max((one.places for one in before if one.kind == reason.kind), default=0)
    if not seen <= reason.places:
        yield f"{reason.places} places looked from, {seen} before"


def backing_up(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The way leads to where the robot has been."""
    yield from _errand(scene, past, reason)
    been = [scene.apart(one.position, _array(reason.target)) for one in past.steps.values()]
    if not been or min(been) > 0.2:
        yield "it has not been where it goes back to"


def at_viewpoint(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """It comes to rest where its way elsewhere led to."""
    yield from _same("path_m", reason.path_m, _length(scene.path))
    if not len(past.way) or scene.apart(scene.path[-1], past.way[-1]) > 0.2:
        yield "its way did not lead there"


def off_trajectory(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The robot is farther from its trajectory than is tolerated, and holds."""
    limit = scene.config.behaviour.tracking_tolerance
    yield from _same("limit_m", reason.limit_m, limit)
    if not reason.distance_m > limit:
        yield f"{reason.distance_m:.2f} m off the trajectory is within what is tolerated"
    time_ns = scene.decision.timestamp.ToNanoseconds()
    followed = past.followed(time_ns)
    place = np.array(scene.mission.start) if followed is None else _place_at(followed, time_ns)
    off = scene.apart(place, np.array(scene.decision.position))
    yield from _same("distance_m", reason.distance_m, off, 0.05)


def escaping_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body overlaps a cell where it stands, and steps out."""
    yield from _overlapped_here(scene, reason)
    yield from _same("distance_m", reason.distance_m, _length(scene.path))


def turning_out_of_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body overlaps a cell at its heading, and turns to another."""
    yield from _overlapped_here(scene, reason)
    headings = scene.decision.trajectory.heading
    yield from _same("turn_rad", reason.turn_rad, headings[-1] - headings[0], 0.02)


def braking_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The last way ends at a cell before the robot could stop for a new one."""
    blocked = reason.kind == "braking_before_blocked"
    yield from _obstructed(scene, reason, past.way, scene.unknown_blocks and not blocked)
    yield from _stop(scene, reason)
    if not reason.free_m < reason.stop_m:
        yield f"{reason.free_m:.2f} m are free, and {reason.stop_m:.2f} m enough to stop"


def path_too_short(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """What is left of the last way is less than the robot needs to stop."""
    yield from _stop(scene, reason)
    if not reason.path_m < reason.stop_m:
        yield f"{reason.path_m:.2f} m are left, and {reason.stop_m:.2f} m enough to stop"
    yield from _same_arc("path_m", reason.path_m, _left_of(past.way, scene.path[0]))


def goal_place_moved(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The last way ends elsewhere than where the goal now is, or what stands for it."""
    yield from _stop(scene, reason)
    target = _array(reason.target)
    yield from _same("distance_m", reason.distance_m, scene.apart(past.way[-1], target))
    if reason.distance_m <= 3.0 * scene.size:
        yield f"{reason.distance_m:.2f} m is no other place"
    if scene.apart(target, scene.goal) > scene.config.behaviour.goal_reach + scene.size:
        yield "its place is not near the goal"


def coming_to_rest(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """It stops, and no decision since that one has had a path."""
    yield from _same("path_m", reason.path_m, _length(scene.path))
    steps = past.since(reason.since, scene.decision.sequence)
    if not steps:
        yield f"there is no earlier decision {reason.since}"
        return
    if steps[0].action not in ("stop_and_wait", "recover"):
        yield f"decision {reason.since} had a path: {steps[0].kind}"
    if steps[0].label != scene.decision.label:
        yield f"label {scene.decision.label}, that of decision {reason.since} is {steps[0].label}"
    others = {one.kind for one in steps[1:]} - {"coming_to_rest", "deadline_missed"}
    if others:
        yield f"since decision {reason.since} there was {', '.join(sorted(others))}"


def waiting_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """At rest before a cell that leaves too little of the way to set out."""
    way = scene.guide if len(scene.guide) > 1 else past.way
    yield from _obstructed(scene, reason, way, scene.unknown_blocks)
    yield from _same("limit_m", reason.limit_m, scene.config.behaviour.least_advance)
    if not reason.free_m < reason.limit_m:
        yield f"{reason.free_m:.2f} m are free"
    yield from _waited(scene, past, reason)


def no_path_in_map(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """What is not known to be blocked does not connect the robot with the goal."""
    from scipy import ndimage

    yield from _searched(scene, past, reason)
    if not scene.comparable:
        return
    cells = scene.everywhere
    # Half a cell to spare: the search asks for whole cells along straight pieces.
    wide = cells.clearances(unknown_blocks=False) > scene.reach(min(scene.radii)) + 0.5
    areas, _ = ndimage.label(wide)
    here, there = cells.of(np.array([scene.path[0], scene.goal]))
    if areas[tuple(here)] and areas[tuple(here)] == areas[tuple(there)]:
        yield "the map has a way to the goal"


def no_path_found(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """A search that need not find every path has found none."""
    yield from _searched(scene, past, reason)


def goal_blocked(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body would overlap a cell at the goal, and at every place near it."""
    yield from _overlapped(scene, reason, scene.goal, unknown_blocks=False)
    yield from _same("limit_m", reason.limit_m, scene.config.behaviour.goal_reach)
    if _has_room(scene, scene.goal, reason.limit_m, None, unknown_blocks=False):
        yield f"there is a free place within {reason.limit_m:.2f} m"
    yield from _waited(scene, past, reason)


def goal_inside_inflation(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body would overlap a cell at the goal, and stands as near as it can."""
    yield from _overlapped(scene, reason, scene.goal, unknown_blocks=False)
    yield from _same("distance_m", reason.distance_m, scene.apart(scene.path[0], scene.goal))
    if scene.decision.action == "abort" and reason.waited_s < scene.config.behaviour.goal_patience:
        yield f"gave up after {reason.waited_s:.1f} s"
    yield from _waited(scene, past, reason)


def no_room(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body would overlap a cell when it turns into the path, or along it."""
    within = reason.free_m if reason.kind == "no_room_along_path" else 0.0
    yield from _overlapped(scene, reason, scene.path[0], scene.unknown_blocks, within)
    yield from _waited(scene, past, reason)


def no_way_out(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body overlaps a cell where it stands, and there is no place near where it would not."""
    yield from _overlapped_here(scene, reason)
    yield from _same("limit_m", reason.limit_m, 1.0)
    heading = scene.decision.trajectory.heading[0]
    if _has_room(scene, scene.path[0], reason.limit_m, heading, scene.unknown_blocks):
        yield f"there is a free place within {reason.limit_m:.2f} m"
    yield from _waited(scene, past, reason)


def way_out_blocked(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The body overlaps a cell where it stands."""
    yield from _overlapped_here(scene, reason)
    if reason.distance_m > 1.0 + scene.size:
        yield f"{reason.distance_m:.2f} m is no way out"
    yield from _waited(scene, past, reason)


def at_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The robot is at rest, near enough to the goal."""
    here = np.array(scene.decision.position)
    yield from _same("distance_m", reason.distance_m, scene.apart(here, scene.goal))
    yield from _same("limit_m", reason.limit_m, 0.8 * scene.config.episode.goal_tolerance)
    if reason.distance_m > reason.limit_m:
        yield "that is too far"
    time_ns = scene.decision.timestamp.ToNanoseconds()
    followed = past.followed(time_ns)
    if followed is not None:
        end_ns = followed.start.ToNanoseconds() + followed.duration_s * 1e9
        if end_ns > time_ns + 1:
            yield f"its trajectory goes on for {(end_ns - time_ns) * 1e-9:.2f} s"


def deadline_missed(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The decision came late, and the trajectory is the last one."""
    yield from _same("delay_s", reason.delay_s, scene.decision.delay_s)
    yield from _same("deadline_s", reason.deadline_s, scene.config.latency.deadline)
    if not reason.delay_s > reason.deadline_s:
        yield "that is in time"
    last = past.trajectories[-1] if past.trajectories else scene.decision.trajectory
    if last.path != scene.decision.trajectory.path:
        yield "the trajectory is another one than the last"
    end_ns = last.start.ToNanoseconds() + last.duration_s * 1e9
    over = scene.decision.timestamp.ToNanoseconds() >= end_ns - 1
    if (scene.decision.action == "stop_and_wait") != over:
        yield f"action {scene.decision.action}, while the last trajectory {'is over' * over}"


PREDICATES: dict[str, Claim] = {
    "path_to_goal": path_to_goal,
    "braking_to_goal": braking_to_goal,
    "path_to_corner": path_to_corner,
    "unknown_ahead": driving_ahead,
    "blocked_ahead": driving_ahead,
    "through_unknown": through_unknown,
    "turning_into_path": turning_into_path,
    "keeping_course": keeping_course,
    "looking_elsewhere": looking_elsewhere,
    "at_viewpoint": at_viewpoint,
    "backing_up": backing_up,
    "off_trajectory": off_trajectory,
    "escaping_inflation": escaping_inflation,
    "turning_out_of_inflation": turning_out_of_inflation,
    "braking_before_unknown": braking_ahead,
    "braking_before_blocked": braking_ahead,
    "path_too_short": path_too_short,
    "goal_place_moved": goal_place_moved,
    "coming_to_rest": coming_to_rest,
    "waiting_before_unknown": waiting_ahead,
    "waiting_before_blocked": waiting_ahead,
    "no_path_in_map": no_path_in_map,
    "no_path_found": no_path_found,
    "goal_blocked": goal_blocked,
    "goal_inside_inflation": goal_inside_inflation,
    "no_room_to_turn": no_room,
    "no_room_along_path": no_room,
    "no_way_out": no_way_out,
    "way_out_blocked": way_out_blocked,
    "at_goal": at_goal,
    "deadline_missed": deadline_missed,
}
"""What each kind of reason claims."""


def _same(name: str, claimed: float, found: float, within: float = NEAR) -> Iterator[str]:
    if not abs(claimed - found) <= within:
        yield f"{name} is {claimed:.3f}, found {found:.3f}"


def _same_arc(name: str, claimed: float, found: float) -> Iterator[str]:
    yield from _same(name, claimed, found, ARC + ARC_SHARE * abs(claimed))


def _array(point: pb.Point) -> Array:
    return np.array([point.x, point.y, point.z])


def _length(path: Array) -> float:
    return float(arcs_of(path)[-1])


def _path_ends(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """The way is as long as it says, and ends as near to the goal."""
    if not len(scene.guide):
        yield "it names no path"
        return
    yield from _same("path_m", reason.path_m, scene.decision.path_length_m)
    yield from _same_arc("path_m", reason.path_m, _length(scene.guide))
    beside = scene.apart(scene.guide[-1], scene.goal)
    yield from _same("short_m", reason.short_m, beside, 0.011)


def _committed(scene: Scene, length: float) -> Iterator[str]:
    """The committed part is that long; a long body may fit along less of it."""
    committed = _length(scene.path)
    if scene.mission.discs:
        if committed > length + NEAR:
            yield f"{length:.3f} m are free, {committed:.3f} m committed"
        return
    yield from _same("free_m", length, committed)


def _stop(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """What it takes to stop is what the trajectory takes."""
    yield from _same("stop_m", reason.stop_m, _length(scene.path), 0.012)
    arcs = np.array(scene.decision.trajectory.arc_length)
    period, limits = scene.decision.trajectory.sample_period_s, scene.mission
    speed = float((arcs[1] - arcs[0]) / period) if len(arcs) > 1 else 0.0
    faster = speed + 2.0 * period * limits.max_acceleration
    if reason.stop_m > _stop_from(faster, limits) + NEAR:
        yield f"from {speed:.2f} m/s it could stop in less than {reason.stop_m:.2f} m"


def _stop_from(speed: float, limits: Any) -> float:
    """Length of the jerk-limited stop from a steady speed, m."""
    if speed * limits.max_jerk >= limits.max_acceleration**2:
        ramp = limits.max_acceleration / limits.max_jerk
        return float(0.5 * speed * (speed / limits.max_acceleration + ramp))
    return float(speed * math.sqrt(speed / limits.max_jerk))


def _obstructed(scene: Scene, reason: pb.Reason, way: Array, unknown_blocks: bool) -> Iterator[str]:
    """The named cell ends the way, there, and nothing before does."""
    if len(way) < 2:
        yield "no way was named"
        return
    yield from _named(scene, reason, unknown_blocks)
    place = _array(reason.place)
    arc, beside = _nearest(way, place, scene)
    begin, _ = _nearest(way, scene.path[0], scene)
    offset = max(abs(one) for one in scene.offsets)
    if beside > BENT + offset:
        yield f"the place is {beside:.2f} m beside the way"
    slack = ARC + ARC_SHARE * reason.free_m + offset
    yield from _same("free_m", reason.free_m, arc - begin, slack)
    yield from _free_before(scene, way, reason.free_m - ARC, begin, unknown_blocks)


def _named(scene: Scene, reason: pb.Reason, unknown_blocks: bool) -> Iterator[str]:
    """The cell is in the state that is named, and in reach of the body at the place."""
    if not scene.comparable:
        return
    cell, place = _array(reason.cell), _array(reason.place)
    x, y, z = cell.tolist()
    state = scene.state_at((x, y, z))
    if state != reason.cell_state:
        yield f"the cell is {state}, not {reason.cell_state or 'named'}"
    if state == "free" or (state == "unknown" and not unknown_blocks):
        yield f"the body may overlap what is {state}"
    centres = np.floor(np.stack([cell, place])[:, : scene.axes] / scene.size + _shift(scene))
    away = float(np.linalg.norm(centres[0] - centres[1]))
    if away > scene.reach(max(scene.radii)) + NEAR:
        yield f"the cell is {away * scene.size:.2f} m from the place, out of reach of the body"


def _shift(scene: Scene) -> Array:
    """Cells begin at whole multiples of their size, those along z three quarters below."""
    return np.array([0.0, 0.0, 0.75])[: scene.axes]


def _free_before(
    scene: Scene,
    way: Array,
    length: float,
    begin: float = 0.0,
    unknown_blocks: bool | None = None,
) -> Iterator[str]:
    """A body that is a cell smaller has room along the first part of a way."""
    if not scene.comparable:
        return
    points = densely(way, 0.5 * scene.size)
    arcs = arcs_of(points) - begin
    points = points[(arcs >= 0.0) & (arcs <= length)]
    reach = scene.reach(min(scene.radii))
    blocks = scene.unknown_blocks if unknown_blocks is None else unknown_blocks
    for piece in np.split(points, range(PIECE, len(points), PIECE)):
        if not len(piece):
            return
        cells = scene.cells_about(piece, (reach + 2.0) * scene.size)
        clearances = cells.clearances(blocks)[tuple(cells.of(piece).T)]
        tight = np.flatnonzero(clearances <= reach - 1.0)
        if len(tight):
            at = ", ".join(f"{value:.2f}" for value in piece[tight[0]])
            yield f"the body has no room at ({at}), before"
            return


def _nearest(way: Array, place: Array, scene: Scene) -> tuple[float, float]:
    """Arc length of the point of a way nearest to a place, and how far that is, m."""
    points = densely(way, 0.01)
    gaps = np.linalg.norm((points - place)[:, : scene.axes], axis=1)
    nearest = int(gaps.argmin())
    return float(arcs_of(points)[nearest]), float(gaps[nearest])


def _left_of(way: Array, place: Array) -> float:
    points = densely(way, 0.01)
    nearest = int(np.linalg.norm((points - place)[:, :2], axis=1).argmin())
    return _length(points) - float(arcs_of(points)[nearest])


def _direction(way: Array, begin: float, end: float) -> float:
    """Heading from one arc length of a way to another, rad."""
    arcs = arcs_of(way)
    x, y = (np.interp(end, arcs, way[:, k]) - np.interp(begin, arcs, way[:, k]) for k in range(2))
    return heading_of(float(y), float(x))


def _turn_at(way: Array, committed: Array, arc: float) -> float:
    """The greatest turn between pieces of a way near an arc length, rad.

    Among them those that the committed part ends with, which is not thinned.
    """
    steps = [_steps_near(way, arc), _steps_near(committed, _length(committed))]
    pieces = np.concatenate(steps)
    cosine = float((pieces @ pieces.T).min()) if len(pieces) else 1.0
    return math.acos(min(max(cosine, -1.0), 1.0))


def _steps_near(way: Array, arc: float) -> Array:
    """Directions (n, 3) of the pieces of a way within `CORNER` of an arc length."""
    points = densely(way, 0.02)
    arcs = arcs_of(points)
    near = (arcs[1:] >= arc - CORNER) & (arcs[:-1] <= arc + CORNER)
    steps = np.diff(points, axis=0)[near]
    lengths = np.linalg.norm(steps, axis=1)
    directions: Array = steps[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    return directions


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _heading(decision: pb.Decision) -> float:
    w, x, y, z = decision.quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _place_at(trajectory: pb.Trajectory, time_ns: int) -> Array:
    elapsed = (time_ns - trajectory.start.ToNanoseconds()) * 1e-9
    samples = np.arange(len(trajectory.arc_length)) * trajectory.sample_period_s
    along = float(np.interp(elapsed, samples, np.array(trajectory.arc_length)))
    path = path_of(trajectory.path)
    return np.array([np.interp(along, arcs_of(path), path[:, axis]) for axis in range(3)])


def _errand(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """The way leads where it says, and has since the decision that set out."""
    if len(scene.guide) < 2:
        yield "it names no way"
        return
    target = _array(reason.target)
    yield from _same("target", 0.0, scene.apart(scene.guide[-1], target))
    yield from _same("path_m", reason.path_m, scene.decision.path_length_m)
    now = scene.decision.sequence
    if reason.since > now or (reason.since < now and reason.since not in past.steps):
        yield f"there is no earlier decision {reason.since}"
    for step in past.since(reason.since, now):
        if step.kind == reason.kind and scene.apart(_array(step.grounds.target), target) > NEAR:
            yield f"since decision {reason.since} it went elsewhere"
            return


def _is_frontier(scene: Scene, place: Array) -> bool:
    """Whether a cell is admitted, and one beside it is not only because it was not seen."""
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


def _overlapped(
    scene: Scene, reason: pb.Reason, place: Array, unknown_blocks: bool, within: float = 0.0
) -> Iterator[str]:
    """The body at a place, or so near to it, overlaps the named cell."""
    yield from _named(scene, reason, unknown_blocks)
    away = scene.apart(_array(reason.place), place)
    if away > max(abs(one) for one in scene.offsets) + within + 0.01:
        yield f"that is {away:.2f} m from where the body is"


def _overlapped_here(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    yield from _overlapped(scene, reason, scene.path[0], scene.unknown_blocks)


def _has_room(
    scene: Scene, about: Array, within: float, heading: float | None, unknown_blocks: bool
) -> bool:
    """Whether a body half a cell larger fits at a cell's centre near a place.

    A long body at a heading, rad; with none nothing is said of it.
    """
    if not scene.comparable or (scene.mission.discs and heading is None):
        return False
    reaches = [scene.reach(radius) for radius in scene.radii]
    longest = max(abs(one) for one in scene.offsets)
    pad = within + longest + (max(reaches) + 2.0) * scene.size
    cells = scene.cells_about(about[None], pad)
    clearances = cells.clearances(unknown_blocks)
    centres = cells.corner + (np.argwhere(clearances >= 0.0) + 0.5) * cells.size
    near = centres[np.linalg.norm(centres - about[: scene.axes], axis=1) <= within - scene.size]
    ahead = np.zeros(scene.axes)
    ahead[:2] = math.cos(heading or 0.0), math.sin(heading or 0.0)
    fits = np.ones(len(near), bool)
    for offset, reach in zip(scene.offsets, reaches, strict=True):
        fits &= clearances[tuple(cells.of(near + offset * ahead).T)] > reach + 0.5
    return bool(fits.any())


def _searched(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """A search was made and names no path."""
    if not scene.decision.planner:
        yield "no search was made"
    if reason.iterations != scene.decision.planner_iterations:
        yield f"{reason.iterations} iterations, {scene.decision.planner_iterations} were made"
    if reason.HasField("stop_m"):
        yield from _stop(scene, reason)
    else:
        yield from _waited(scene, past, reason)


def _waited(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """It has been at rest for so long, and long enough for what it does then."""
    now_ns = scene.decision.timestamp.ToNanoseconds()
    begun_ns = now_ns - round(reason.waited_s * 1e9)
    numbers = [k for k, one in past.steps.items() if abs(one.time_ns - begun_ns) < 10_000]
    if reason.waited_s > NEAR and not numbers:
        yield f"no decision was made {reason.waited_s:.2f} s ago"
    elif numbers and any(one.moves for one in past.since(numbers[0], scene.decision.sequence)):
        yield f"it has moved within {reason.waited_s:.2f} s"
    if _length(scene.path) >= STILL:
        yield "it moves"
    behaviour = scene.config.behaviour
    if (reason.frontier or reason.HasField("places")) and reason.waited_s < behaviour.patience:
        yield f"looked for a frontier after {reason.waited_s:.2f} s"
    if reason.HasField("places") and reason.places < behaviour.tries:
        yield f"gave up after {reason.places} places"
