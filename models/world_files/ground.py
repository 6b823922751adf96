"""The floor of an imported scene: its height, its parts, and the boxes in place of other planes.

A robot's floor is at height 0 where it starts. A scene whose floor is elsewhere is moved.
"""

from __future__ import annotations

import re
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayproof.models.classes import CLASSES
from wayproof.models.world_files.options import Found, ImportOptions, Plane
from wayproof.models.world_files.parts import Part, axes_of, bounds_of, quaternion_of, vector
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.worlds.materials import class_of

FLOOR_KIND = "floor"
"""Kind of a part that may be stepped on."""

LEVEL = 1e-9
"""Deviation of a plane's normal and height from a level one at 0, m."""

LEAST_SHARE = 0.5
"""Share of a scene's rectangle that level surfaces of one height cover to be its floor; of a scan,
whose floor is uneven and has gaps, half of that."""

LEAST_FLOOR = 9.0
"""Area from which a level surface can be a floor, m^2."""

SAME_HEIGHT = 0.02
"""Difference in height of surfaces that are one floor, m: less than any robot's step."""

HIGHEST_SLAB = 0.5
"""Height above the lowest of them up to which a large surface hides it, as a slab does, m."""

SHEET_THICKNESS = 0.01
"""Thickness of the box in place of a plane of the size that it is drawn with, m."""

PLANE_BORDER = 2.0
"""How much farther than the other parts the box in place of an infinite plane reaches, m."""

EMPTY_EXTENT = 10.0
"""Half the length and width of a scene of planes alone, m."""


class Level(NamedTuple):
    """Level upper surface of a part.

    Attributes:
        height: m.
        area: m^2.
        part: Number of the part.
    """

    height: float
    area: float
    part: int


def settle_ground(path: Path, found: Found, options: ImportOptions) -> None:
    """Decide on the floor, move the scene so that it is at 0, and turn other planes into boxes.

    Changes `found`, and notes what it did.

    Raises:
        WorldFileError: A pattern of `kinds` that no model's name matches.
    """
    _set_kinds(path, found, options)
    terrain = any(part.shape == "heights" and part.kind == FLOOR_KIND for part in found.parts)
    height = _floor_height(found, options, terrain)
    floors = [plane for plane in found.planes if _is_level(plane, height)]
    others = [plane for plane in found.planes if not _is_level(plane, height)]
    found.plane |= bool(floors) or (options.floor is not None and not terrain)
    if found.parts:
        _note_drawn(found, floors)
    found.parts += _as_boxes(found, others, height)
    if found.grid:  # a foot on the floor would touch what ends there
        _lower_cells(found, height)
    if height:
        found.notes.append(f"floor at {height:g} m: the scene is moved by {-height:g} m in z")
        raise_by(found, -height)
    if not found.parts and found.plane:
        _bound_empty(found, floors)
    found.planes = []


def raise_by(found: Found, rise: float) -> None:
    """Move all that was found up, m."""

    def up(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return point[0], point[1], point[2] + rise

    found.parts = [replace(part, position=up(part.position)) for part in found.parts]
    found.movers = [replace(one, route=tuple(map(up, one.route))) for one in found.movers]
    found.extent = None if found.extent is None else (up(found.extent[0]), up(found.extent[1]))
    found.low = None if found.low is None else up(found.low)
    found.high = None if found.high is None else up(found.high)


def kind_of(model: str) -> str:
    """Return the kind of a model by its name: lower-case letters and underscores, no number.

    A name alone makes nothing a floor: see `settle_ground`.
    """
    word = re.sub(r"[_ ]*\d+$", "", model.strip().lower())
    kind = re.sub("[^a-z_]+", "_", word).strip("_")[:40] or "structure"
    return "structure" if class_of(kind) == CLASSES.index("floor") else kind


def _set_kinds(path: Path, found: Found, options: ImportOptions) -> None:
    for kind, pattern in options.kinds:
        chosen = [fnmatchcase(part.model, pattern) for part in found.parts]
        planes = any(fnmatchcase(plane.model, pattern) for plane in found.planes)
        if not any(chosen) and not planes:
            names = sorted({part.model for part in found.parts if part.model})
            known = ", ".join(names)[:300] or "none has a name"
            raise WorldFileError(path, f"--as {kind}={pattern}: no such model (available: {known})")
        found.parts = [
            replace(part, kind=kind) if hit else part
            for part, hit in zip(found.parts, chosen, strict=True)
        ]


def _floor_height(found: Found, options: ImportOptions, terrain: bool) -> float:
    """Return the floor's height, m; marks the parts that are the floor.

    It is what is given or named; else 0 where the format says so, or under terrain, which is moved
    later; else the lowest of the highest large plane and the large level surfaces, or what hides it
    little above; else 0.
    """
    if options.floor is not None:
        _mark_floor(found, options.floor)
        return options.floor
    if found.plane or terrain:
        return 0.0
    named = _levels([part for part in found.parts if part.kind == FLOOR_KIND])
    plane = _plane_height(found.planes)
    if named and plane is None:
        return _rounded(max(named, key=lambda level: level.area).height)
    heights = _large_levels(found)
    if plane is not None:
        heights = [plane, *(height for height in heights if height > plane + LEVEL)]
    if not heights:
        if not any(part.kind == FLOOR_KIND for part in found.parts):
            found.notes.append("no plane or large level surface: floor at 0 m; --floor for another")
        return 0.0
    highest = max(height for height in heights if height <= heights[0] + HIGHEST_SLAB)
    if highest != plane:
        found.notes.append(f"floor by its size: {', '.join(_mark_floor(found, highest))}")
    return _rounded(highest)


def _rounded(height: float) -> float:
    return height if abs(height) > LEVEL else 0.0


def _large_levels(found: Found) -> list[float]:
    """Return the heights at which level surfaces cover much of the scene, lowest first, m."""
    if not found.parts:
        return []
    low, high = bounds_of(found.parts)
    share = LEAST_SHARE / 2.0 if found.grid else LEAST_SHARE
    least = max(share * float(np.prod(high[:2] - low[:2])), LEAST_FLOOR)
    heights: list[float] = []
    near: list[Level] = []
    for level in sorted(_levels(found.parts)):
        near = [one for one in near if level.height - one.height <= SAME_HEIGHT] + [level]
        if sum(one.area for one in near) >= least:
            if heights and level.height - heights[-1] <= SAME_HEIGHT:
                heights.pop()
            heights.append(level.height)
    return heights


def _mark_floor(found: Found, height: float) -> list[str]:
    """Make the parts whose level top is the floor of that kind; return their names."""
    chosen = {
        level.part for level in _levels(found.parts)
        if -SAME_HEIGHT - LEVEL <= level.height - height <= LEVEL
    }  # fmt: skip
    for n in chosen:
        found.parts[n] = replace(found.parts[n], kind=FLOOR_KIND)
    return list(dict.fromkeys(found.parts[n].model or "a part" for n in sorted(chosen)))


def _levels(parts: list[Part]) -> list[Level]:
    found = []
    for n, part in enumerate(parts):
        if part.shape == "box":
            R = part.R_world_part
            axis = int(np.argmax(np.abs(R[2])))
            if abs(R[2, axis]) > 1.0 - 1e-9:
                i, j = (k for k in range(3) if k != axis)
                area = 4.0 * part.size[i] * part.size[j]
                found.append(Level(part.position[2] + part.size[axis], area, n))
        elif part.mesh is not None:
            corners = part.mesh.vertices @ part.R_world_part.T + part.position
            a, b, c = (corners[part.mesh.faces[:, k]] for k in range(3))
            normals = np.cross(b - a, c - a)
            top = float(corners[:, 2].max())
            at_top = np.maximum(np.maximum(a[:, 2], b[:, 2]), c[:, 2]) >= top - SAME_HEIGHT
            level = normals[:, 2] > 0.999 * np.linalg.norm(normals, axis=1)
            if area := float(normals[at_top & level, 2].sum()) / 2.0:
                found.append(Level(top, area, n))
    return found


def _plane_height(planes: list[Plane]) -> float | None:
    """Return the height of the highest level plane that is no sticker, m: it hides those below."""
    level = [plane for plane in planes if _is_up(plane)]
    large = [plane for plane in level if plane.axes is None or plane.area >= LEAST_FLOOR]
    return max((float(plane.point[2]) for plane in large or level), default=None)


def _is_up(plane: Plane) -> bool:
    return bool(plane.normal[2] > 1.0 - LEVEL)


def _is_level(plane: Plane, height: float) -> bool:
    return _is_up(plane) and abs(float(plane.point[2]) - height) <= LEVEL


def _note_drawn(found: Found, floors: list[Plane]) -> None:
    """Note a floor that is drawn smaller than the scene: contacts take it as infinite."""
    low, high = bounds_of(found.parts)
    for plane in floors:
        if plane.half_extents is None:
            continue
        beyond = np.maximum(high - plane.point, plane.point - low)[:2] > plane.half_extents
        if beyond.any():
            x, y = (2.0 * half for half in plane.half_extents)
            found.notes.append(
                f"plane of '{plane.model}', drawn {x:g} x {y:g} m: infinite, as contacts take it"
            )


def _bound_empty(found: Found, floors: list[Plane]) -> None:
    """Bound the area of a scene of a floor alone."""
    at = floors[0].point if floors else np.zeros(3)
    x, y, size = float(at[0]), float(at[1]), EMPTY_EXTENT
    found.low, found.high = (x - size, y - size, -0.5), (x + size, y + size, 3.0)
    found.notes.append(f"nothing but a floor: an area of {2 * size:g} x {2 * size:g} m on it")


def _as_boxes(found: Found, planes: list[Plane], height: float) -> list[Part]:
    """Return planes that are not the floor as boxes behind their face, and note them.

    An infinite one is solid behind it as far as the scene reaches: to its parts and a point of each
    infinite plane, which is the extent of the scene then.
    """
    below = [plane for plane in planes if _is_up(plane) and float(plane.point[2]) < height]
    for plane in below:
        where = f"at {float(plane.point[2]):g} m, below the floor: left out"
        found.notes.append(f"plane of '{plane.model or 'a plane'}' {where}")
    planes = [plane for plane in planes if not any(plane is one for one in below)]
    infinite = [plane.point for plane in planes if plane.axes is None]
    corners = np.array([*infinite, *(bounds_of(found.parts) if found.parts else ())])
    if infinite:
        if not found.parts:
            around = np.full(3, EMPTY_EXTENT)
            corners = np.concatenate([corners, [corners[0] - around, corners[0] + around]])
        found.extent = vector(corners.min(axis=0)), vector(corners.max(axis=0))
    parts = []
    for plane in planes:
        half, thickness = plane.half_extents, SHEET_THICKNESS
        if plane.axes is not None and half is not None:
            R, middle = plane.axes, plane.point
            what = f"a box {2 * half[0]:.4g} x {2 * half[1]:.4g} x {thickness:g} m behind it"
        else:
            R, centre = axes_of(plane.normal), corners.mean(axis=0)
            middle = centre - ((centre - plane.point) @ plane.normal) * plane.normal
            thickness = float(np.linalg.norm(np.ptp(corners, axis=0))) + PLANE_BORDER
            half, what = (thickness, thickness), "solid behind it"
            up = R[:, 1] * np.sign(R[2, 1])
            if up[2] > LEVEL:  # from the floor on up the wall
                middle = middle + up * ((height - middle[2]) / up[2] + thickness)
        size, at = (*half, thickness / 2.0), middle - thickness / 2.0 * plane.normal
        parts.append(Part("box", size, vector(at), quaternion_of(R), "wall", model=plane.model))
        found.notes.append(f"plane of '{plane.model or 'a plane'}': {what}")
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
