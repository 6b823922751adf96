"""Overlap of the body with single cells, for the predicates."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wayproof.harness.log.paths import Array, arc_lengths, densely
from wayproof.harness.replay.reasons.along import ARC, ARC_SHARE, NEAR, nearest, point_of
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

BENT = 0.1
"""Greatest distance of a path from its thinned form, m."""

FACE = 1e-4
"""Distance up to which a point lies on the face of a cell, cells."""

PIECE = 20
"""Number of points of a path, half a cell apart, that are checked at once."""


def obstructed(scene: Scene, reason: pb.Reason, way: Array, unknown_blocks: bool) -> Iterator[str]:
    """Check that the named cell is the first that ends the way."""
    if len(way) < 2:
        yield "no way was named"
        return
    yield from _check_cell(scene, reason, unknown_blocks)
    place = point_of(reason.place)
    arc, beside = nearest(way, place, scene)
    begin, _ = nearest(way, scene.path[0], scene)
    offset = max(abs(one) for one in scene.offsets)
    if beside > BENT + offset:
        yield f"the place is {beside:.2f} m beside the way"
    slack = ARC + ARC_SHARE * reason.free_m + offset
    longest = slack + _piece_length(scene, way, begin, reason)
    if not -slack <= arc - begin - reason.free_m <= longest:
        yield f"free_m is {reason.free_m:.3f}, found {arc - begin:.3f}"
    yield from free_before(
        scene, way, length=reason.free_m - ARC, begin=begin, unknown_blocks=unknown_blocks
    )


def cell_on_way(scene: Scene, reason: pb.Reason, way: Array, unknown_blocks: bool) -> Iterator[str]:
    """Check that the named cell blocks, at a place on the way."""
    yield from _check_cell(scene, reason, unknown_blocks)
    _, beside = nearest(way, point_of(reason.place), scene)
    if beside > BENT + max(abs(one) for one in scene.offsets):
        yield f"the place is {beside:.2f} m beside the way"


def _piece_length(scene: Scene, way: Array, begin: float, reason: pb.Reason) -> float:
    """Return the length of the piece that a long body may not enter, m; others enter part of it."""
    if not scene.mission.discs:
        return 0.0
    ends = arc_lengths(way) - begin
    beyond = ends[ends > reason.free_m + ARC]
    return float(beyond[0]) - reason.free_m if len(beyond) else 0.0


def _check_cell(scene: Scene, reason: pb.Reason, unknown_blocks: bool) -> Iterator[str]:
    """Check that the cell is in the state that is named, and in reach of the body at the place."""
    if not scene.comparable:
        return
    cell, place = point_of(reason.cell), point_of(reason.place)
    x, y, z = cell.tolist()
    state = scene.state_at((x, y, z))
    if state != reason.cell_state:
        yield f"the cell is {state}, not {reason.cell_state or 'named'}"
    if state == "free" or (state == "unknown" and not unknown_blocks):
        yield f"the body may overlap what is {state}"
    here, there = np.stack([cell, place])[:, : scene.axes] / scene.size + _grid_origin(scene)
    # A place on a face, rounded as it is logged, may lie in the cell on either side of it.
    sides = [np.floor(there - FACE), np.floor(there + FACE)]
    centres = np.stack(np.meshgrid(*np.transpose(sides)), axis=-1).reshape(-1, scene.axes)
    away = float(np.linalg.norm(np.floor(here) - centres, axis=1).min())
    if away > scene.reach(max(scene.radii)) + NEAR:
        yield f"the cell is {away * scene.size:.2f} m from the place, out of reach of the body"


def _grid_origin(scene: Scene) -> Array:
    """Return where cells begin: at whole multiples of their size, along z three quarters below."""
    return np.array([0.0, 0.0, 0.75])[: scene.axes]


def free_before(
    scene: Scene,
    way: Array,
    length: float,
    begin: float = 0.0,
    unknown_blocks: bool | None = None,
) -> Iterator[str]:
    """Check that a body that is a cell smaller has room along the first part of a way."""
    if not scene.comparable:
        return
    points = densely(way, 0.5 * scene.size)
    arcs = arc_lengths(points) - begin
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


def overlapped(
    scene: Scene, reason: pb.Reason, place: Array, unknown_blocks: bool, within: float = 0.0
) -> Iterator[str]:
    """Check that the body at a place, or so near to it, overlaps the named cell."""
    yield from _check_cell(scene, reason, unknown_blocks)
    away = scene.apart(point_of(reason.place), place)
    if away > max(abs(one) for one in scene.offsets) + within + 0.01:
        yield f"that is {away:.2f} m from where the body is"


def overlapped_here(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """Check that the body where it stands overlaps the named cell."""
    yield from overlapped(scene, reason, scene.path[0], scene.unknown_blocks)


def has_room(
    scene: Scene, about: Array, within: float, heading: float | None, unknown_blocks: bool
) -> bool:
    """Return whether a body half a cell larger fits at the centre of a cell near a point.

    An elongated body has a heading, rad; without one the answer is False.
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
