"""Actors of a Gazebo world as people that walk where their script leads them.

Source: the SDFormat specification of `<actor>`. Gazebo's actors are drawn alone: they pass through
everything. Here each is a person's body, which stops for a robot in its way.
"""

from __future__ import annotations

from pathlib import Path

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.movers import MAX_POINTS
from wayproof.models.world_files.parts import vector
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf_frames import Frames, Placement, numbers
from wayproof.models.world_files.xml_tree import Element
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.pedestrians import PERSON

Stop = tuple[float, Vector3]
"""Time, s, and place, m."""

PREFIX = "actor_"
"""Prefix of a mover's name, so that it is that of no other body."""

HIPS = 1.0
"""Height of an actor's frame above its feet, as Gazebo's walking actor has it, m."""

NONE = Element("script", {}, 0)
"""Stands for the script that an actor does not have."""


def read_actor(path: Path, actor: Element, frames: Frames, number: int) -> tuple[Mover, str]:
    """Return an actor as a person, its route at the height of its feet, and a note on it.

    One without a trajectory, or whose script does not start, stands at its pose: so does one that a
    plugin moves. A script that begins again goes round where its trajectory ends at its beginning,
    else to and fro: in Gazebo it jumps.

    Args:
        path: File of the actor, for messages.
        actor: The element.
        frames: Frames of the world.
        number: Number of the actors before it.

    Raises:
        WorldFileError: A malformed time or pose, or times that do not increase.
    """
    home, name, script = _feet(frames.of(actor)), f"{PREFIX}{number}", actor.first("script")
    shown = f"<actor> '{actor.attributes.get('name', '')}' (line {actor.line})"
    script = script or NONE
    stops = _stops(path, script) if _is_on(script, "auto_start") else []
    if stops and stops[0][0] > 0.0:
        stops.insert(0, (0.0, home))
    if stops and (delay := script.first("delay_start")) is not None:
        seconds = numbers(path, delay, 1)[0]
        if not seconds >= 0.0:
            raise WorldFileError(path, "<delay_start>: expected 0 or more", delay.line)
        if seconds:
            stops = [stops[0], *((time + seconds, place) for time, place in stops)]
    places = tuple(place for _, place in stops)
    if len(set(places)) < 2:
        return Mover(name, PERSON, places[:1] or (home,)), f"{shown}: stands there"
    loops, closed = _is_on(script, "loop"), places[0] == places[-1]
    try:
        mover = Mover(
            name, PERSON, places, times=tuple(time for time, _ in stops), returns=loops,
            loops=loops and closed,
        )  # fmt: skip
    except ValueError as error:
        raise WorldFileError(path, f"<script>: {error}", actor.line) from None
    how = ("round" if closed else "to and fro") if loops else "once"
    return mover, f"{shown}: a person that walks {mover.length:.1f} m {how}"


def _stops(path: Path, script: Element) -> list[Stop]:
    """Return the waypoints of all trajectories in the order of their numbers.

    Raises:
        WorldFileError: As `read_actor`; or more than a world's movers may have.
    """
    count = sum(len(trajectory.children) for trajectory in script.all("trajectory"))
    if count > MAX_POINTS:
        what = f"<actor>: {count} waypoints, expected at most {MAX_POINTS}"
        raise WorldFileError(path, what, script.line)
    stops: list[Stop] = []
    for trajectory in sorted(script.all("trajectory"), key=lambda one: _number(path, one)):
        own: list[Stop] = []
        for waypoint in trajectory.all("waypoint"):
            at = waypoint.first("time")
            if at is None or waypoint.first("pose") is None:
                raise WorldFileError(path, "<waypoint>: expected <time> and <pose>", waypoint.line)
            time = numbers(path, at, 1)[0]
            if not time > (own[-1][0] if own else -1.0) or time < 0.0:
                what = f"<time>: got {time:g}, expected more than that of the waypoint before"
                raise WorldFileError(path, what, at.line)
            own.append((time, _feet(Frames(path, NONE).of(waypoint))))
        late = stops[-1][0] - own[0][0] if stops and own and own[0][0] <= stops[-1][0] else 0.0
        if late and stops[-1][1] == own[0][1]:
            own = own[1:]  # it begins where the one before it ended
        elif late:
            late += 1e-3
        stops += [(time + late, place) for time, place in own]
    return stops


def _number(path: Path, trajectory: Element) -> int:
    text = trajectory.attributes.get("id", "0").strip()
    if not text.isdecimal():
        what = f"<trajectory>: id '{text[:40]}', expected a whole number"
        raise WorldFileError(path, what, trajectory.line)
    return int(text)


def _feet(hips: Placement) -> Vector3:
    x, y, z = vector(hips.position)
    return x, y, z - HIPS


def _is_on(script: Element, tag: str) -> bool:
    element = script.first(tag)
    return element is None or element.text.strip() in ("", "1", "true")
