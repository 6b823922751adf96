"""The floor of an imported scene: its height, its parts, and the boxes in place of other planes.

A robot's floor is at height 0 where it starts. A scene whose floor is elsewhere is moved.
"""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.options import Found, ImportOptions, Plane
from wayproof.models.world_files.parts import Part, axes_of, bounds_of, quaternion_of, vector
from wayproof.models.world_files.reading import WorldFileError

FLOOR_KIND = "floor"
"""Kind of a part that may be stepped on."""

LEVEL = 1e-9
"""Deviation of a plane's normal and height from a level one at 0, m."""

LEAST_FLOOR = 9.0
"""Area from which a drawn plane can be a floor, m^2: smaller ones are stickers."""

SAME_HEIGHT = 0.02
"""How far below the floor a part may end that is one with it, m: less than any robot's step."""

REACH = 3.0
"""Height above 0 within which solids begin where the floor is taken at 0, m."""

SHEET_THICKNESS = 0.01
"""Thickness of the box in place of a plane of the size that it is drawn with, m."""

PLANE_BORDER = 2.0
"""How much farther than the other parts the box in place of an infinite plane reaches, m."""

EMPTY_EXTENT = 10.0
"""Half the length and width of a scene of planes alone, m."""


def settle_ground(path: Path, found: Found, options: ImportOptions) -> None:
    """Move the scene so that its floor is at 0, and turn other planes into boxes.

    The floor is at the given height, that of the highest level plane, or 0. The parts that end
    there are floor; where none does, it is a plane. Changes `found`, and notes what it did.

    Raises:
        WorldFileError: A pattern of `kinds` that no model's name matches; no solid near the floor.
    """
    _set_kinds(path, found, options)
    terrain = any(part.shape == "heights" and part.kind == FLOOR_KIND for part in found.parts)
    height = _floor_height(path, found, options, terrain)
    found.parts = [_as_floor(part, height) for part in found.parts]
    others = [plane for plane in found.planes if not _is_level(plane, height)]
    found.plane |= len(others) < len(found.planes)
    found.plane |= not any(part.kind == FLOOR_KIND for part in found.parts)
    found.parts += _as_boxes(found, others, height)
    found.planes = []
    if found.grid:  # a foot on the floor would touch what ends there
        _lower_cells(found, height)
    if height:
        found.notes.append(f"floor at {height:g} m: the scene is moved by {-height:g} m in z")
        raise_by(found, -height)


def raise_by(found: Found, rise: float) -> None:
    """Move all that was found up, m."""

    def up(point: Vector3) -> Vector3:
        return point[0], point[1], point[2] + rise

    found.parts = [replace(part, position=up(part.position)) for part in found.parts]
    found.movers = [replace(one, route=tuple(map(up, one.route))) for one in found.movers]
    found.extent = None if found.extent is None else (up(found.extent[0]), up(found.extent[1]))
    found.low = None if found.low is None else up(found.low)
    found.high = None if found.high is None else up(found.high)


def _set_kinds(path: Path, found: Found, options: ImportOptions) -> None:
    for kind, pattern in options.kinds:
        models = {part.model for part in found.parts} | {plane.model for plane in found.planes}
        chosen = {model for model in models if fnmatchcase(model, pattern)}
        if not chosen:
            known = ", ".join(sorted(filter(None, models)))[:300] or "none has a name"
            raise WorldFileError(path, f"--as {kind}={pattern}: no such model (available: {known})")
        found.parts = [
            replace(part, kind=kind) if part.model in chosen else part for part in found.parts
        ]


def _floor_height(path: Path, found: Found, options: ImportOptions, terrain: bool) -> float:
    """Return the floor's height, m; under terrain, which is moved later, 0."""
    if options.floor is not None:
        return options.floor
    if found.plane or terrain:
        return 0.0
    level = [plane for plane in found.planes if _is_up(plane)]
    large = [plane for plane in level if plane.axes is None or plane.area >= LEAST_FLOOR]
    if level:  # the highest hides those below
        height = max(float(plane.point[2]) for plane in large or level)
        return height if abs(height) > LEVEL else 0.0
    if found.parts and not any(part.kind == FLOOR_KIND for part in found.parts):
        low, high = bounds_of(found.parts)[:, 2]
        if not low - REACH < 0.0 < high:
            what = f"no floor in it, and solids from {low:g} to {high:g} m; expected --floor Z"
            raise WorldFileError(path, what)
        found.notes.append("no plane in it: floor at 0 m; --floor for another")
    return 0.0


def _as_floor(part: Part, height: float) -> Part:
    """Return a part as floor where it ends at the floor's height."""
    above = float(part.bounds[1, 2]) - height
    return replace(part, kind=FLOOR_KIND) if -SAME_HEIGHT <= above <= LEVEL else part


def _is_up(plane: Plane) -> bool:
    return bool(plane.normal[2] > 1.0 - LEVEL)


def _is_level(plane: Plane, height: float) -> bool:
    return _is_up(plane) and abs(float(plane.point[2]) - height) <= LEVEL


def _as_boxes(found: Found, planes: list[Plane], height: float) -> list[Part]:
    """Return planes that are not the floor as boxes behind their face, and note them.

    An infinite one is solid behind it as far as the scene reaches: to its parts and a point of each
    infinite plane, which is the extent of the scene then.
    """
    infinite = [plane.point for plane in planes if plane.axes is None]
    corners = np.array([*infinite, *(bounds_of(found.parts) if found.parts else ())])
    if infinite and not found.parts:
        corners = np.concatenate([corners, corners[0] + EMPTY_EXTENT * np.array([[-1.0], [1.0]])])
    parts = []
    for plane in planes:
        name, half = plane.model or "a plane", plane.half_extents
        if _is_up(plane) and plane.point[2] < height:
            where = f"at {float(plane.point[2]):g} m, below the floor: left out"
            found.notes.append(f"plane of '{name}' {where}")
            continue
        if plane.axes is not None and half is not None:
            R, middle, thickness = plane.axes, plane.point, SHEET_THICKNESS
            what = f"a box {2 * half[0]:.4g} x {2 * half[1]:.4g} x {thickness:g} m behind it"
        else:
            found.extent = vector(corners.min(axis=0)), vector(corners.max(axis=0))
            R, what = axes_of(plane.normal), "solid behind it"
            thickness = float(np.linalg.norm(np.ptp(corners, axis=0))) + PLANE_BORDER
            half, centre = (thickness, thickness), corners.mean(axis=0)
            middle = centre - ((centre - plane.point) @ plane.normal) * plane.normal
            up = R[:, 1] * np.sign(R[2, 1])
            if up[2] > LEVEL:  # from the floor on up the wall
                middle = middle + up * ((height - middle[2]) / up[2] + thickness)
        at = vector(middle - thickness / 2.0 * plane.normal)
        size = (*half, thickness / 2.0)
        parts.append(Part("box", size, at, quaternion_of(R), "wall", model=plane.model))
        found.notes.append(f"plane of '{name}': {what}")
    return parts


def _lower_cells(found: Found, height: float) -> None:
    """Leave out the cells of a grid up to the floor, and cut those that cross it."""
    kept = []
    for part in found.parts:
        low, high = part.position[2] - part.size[2], part.position[2] + part.size[2]
        if high <= height + LEVEL:
            continue
        if low < height:
            half, middle = (high - height) / 2.0, (high + height) / 2.0
            part = replace(part, size=(*part.size[:2], half),
                           position=(*part.position[:2], middle))  # fmt: skip
        kept.append(part)
    if len(kept) < len(found.parts):
        count = len(found.parts) - len(kept)
        found.notes.append(f"{count} boxes up to {height:g} m: the floor, a plane everywhere")
    found.parts, found.plane = kept, True
