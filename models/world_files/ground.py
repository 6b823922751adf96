"""The floor of an imported scene: its height, its parts, and the boxes in place of planes.

A robot's floor is at height 0 where it starts. A scene whose floor is elsewhere is moved.
"""

from __future__ import annotations

import re
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
"""Share of a scene's rectangle that a level surface covers to be its floor."""

LEAST_FLOOR = 9.0
"""Area from which a level surface can be a floor, m^2."""

SAME_HEIGHT = 0.02
"""Difference in height of surfaces that are one floor, m: less than any robot's step."""

HIGHEST_SLAB = 0.5
"""Height of a slab above a plane up to which it, not the plane, is the floor, m."""

HIDING_SHARE = 0.8
"""Share of a floor's area from which a level surface just above it hides it, as the top of a slab
that is drawn as two sheets does."""

LOWEST_OTHERS = 0.3
"""Depth below a floor down to which at least half of the other parts have to begin, m."""

PLANE_THICKNESS = 0.5
"""Thickness of the box in place of a plane that is not the floor, m."""

SHEET_THICKNESS = 0.01
"""Thickness of the box in place of a plane of the size that it is drawn with, m."""

LEAST_WALL = 0.5
"""Horizontal part of a plane's unit normal from which it is a wall."""

PLANE_BORDER = 1.0
"""Border of an infinite plane around the other parts, m."""

EMPTY_EXTENT = 10.0
"""Half the length and width of a scene of one infinite plane, m."""

HEADROOM = 0.5
"""Free height above a cell of a grid for it to count as floor, m."""

UNEVEN_SHARE = 0.02
"""Share of a scanned floor's columns that may rise above its height as obstacles."""


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
    height, why = _floor_height(found, options, terrain)
    floors = [plane for plane in found.planes if _is_level(plane, height)]
    others = [plane for plane in found.planes if not _is_level(plane, height)]
    found.plane |= bool(floors) or (options.floor is not None and not terrain)
    found.parts += _as_boxes(found, others, height)
    if found.grid:  # a foot on the floor would touch what ends there
        _lower_cells(found, height)
    if height:
        found.notes.append(f"floor at {height:g} m{why}: the scene is moved by {-height:g} m in z")
        raise_by(found, -height)
    _note_drawn(found, floors)
    if not found.parts and found.plane:
        _bound_empty(found, floors)
    found.planes = []


def raise_by(found: Found, rise: float) -> None:
    """Move all that was found up, m."""

    def up(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return point[0], point[1], point[2] + rise

    found.parts = [replace(part, position=up(part.position)) for part in found.parts]
    found.movers = [replace(one, route=tuple(map(up, one.route))) for one in found.movers]
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


def _floor_height(found: Found, options: ImportOptions, terrain: bool) -> tuple[float, str]:
    """Return the floor's height, m, and how it was found; marks the parts that are the floor."""
    plane = max(
        (float(p.point[2]) for p in _floors(found.planes)), default=None
    )  # the highest: it hides what is below
    named = [part for part in found.parts if part.kind == FLOOR_KIND and part.shape != "heights"]
    if options.floor is not None:
        _mark_floor(found, options.floor)
        return options.floor, ", as given"
    if found.grid:
        return _grid_floor(found)
    if found.plane:
        return 0.0, ""  # the format says so
    if terrain:
        return 0.0, ""  # it is moved by the height at the start
    if named and plane is None:
        levels = [level for level in _levels(named) if level.area > 0.0]
        if levels:
            top = max(levels, key=lambda level: level.area).height
            return (top, "") if abs(top) > LEVEL else (0.0, "")
    slab = _slab_height(found, plane)
    if slab is not None:
        marked = _mark_floor(found, slab)
        found.notes.append(f"floor by its size: {', '.join(marked)}")
        return (slab, "") if abs(slab) > LEVEL else (0.0, "")
    if plane is not None and abs(plane) > LEVEL:
        return plane, " (a plane)"
    return 0.0, ""


def _slab_height(found: Found, plane: float | None) -> float | None:
    """Return the height of a level surface that is the scene's floor, m, if there is one."""
    if not found.parts:
        return None
    low, high = bounds_of(found.parts)
    rectangle = float(np.prod(high[:2] - low[:2]))
    levels = sorted(_levels(found.parts))
    bottoms = np.array([part.bounds[0, 2] for part in found.parts])
    lowest: Level | None = None
    for level in levels:
        near = [one for one in levels if 0.0 <= one.height - level.height <= SAME_HEIGHT]
        area = sum(one.area for one in near)
        if area < max(LEAST_SHARE * rectangle, LEAST_FLOOR):
            continue
        height = max(one.height for one in near)
        if plane is not None and not plane < height <= plane + HIGHEST_SLAB:
            continue
        if lowest is not None:
            hidden = height <= lowest.height + HIGHEST_SLAB and area >= HIDING_SHARE * lowest.area
            lowest = Level(height, area, 0) if hidden else lowest
            continue
        others = np.delete(bottoms, sorted({one.part for one in near}))
        alone = not len(others) and height - bottoms.min() <= HIGHEST_SLAB
        if alone or (len(others) and (others >= height - LOWEST_OTHERS).mean() >= 0.5):
            lowest = Level(height, area, 0)
    return None if lowest is None else lowest.height


def _mark_floor(found: Found, height: float) -> list[str]:
    """Make the parts whose level top is the floor of that kind; return their names."""
    chosen = {
        level.part for level in _levels(found.parts)
        if -SAME_HEIGHT - LEVEL <= level.height - height <= LEVEL
    }  # fmt: skip
    names = []
    for n in sorted(chosen):
        found.parts[n] = replace(found.parts[n], kind=FLOOR_KIND)
        names.append(found.parts[n].model or "a part")
    return list(dict.fromkeys(names))


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
            found.append(Level(top, float(normals[at_top & level, 2].sum()) / 2.0, n))
    return found


def _floors(planes: list[Plane]) -> list[Plane]:
    """Return the level planes that can be a floor: not a small one above another."""
    level = [plane for plane in planes if _is_up(plane)]
    lowest = min((float(plane.point[2]) for plane in level), default=0.0)
    return [plane for plane in level
            if not _is_small(plane) or float(plane.point[2]) <= lowest + LEVEL]  # fmt: skip


def _is_small(plane: Plane) -> bool:
    half = plane.half_extents
    return plane.axes is not None and half is not None and 4.0 * half[0] * half[1] < LEAST_FLOOR


def _is_up(plane: Plane) -> bool:
    return bool(plane.normal[2] > 1.0 - LEVEL)


def _is_level(plane: Plane, height: float) -> bool:
    return _is_up(plane) and abs(float(plane.point[2]) - height) <= LEVEL


def _as_boxes(found: Found, planes: list[Plane], height: float) -> list[Part]:
    """Return planes that are not the floor as boxes behind their face, and note them."""
    parts = []
    if not planes:
        return []
    if found.parts:
        low, high = bounds_of(found.parts)
    else:
        low, high = np.full(3, -EMPTY_EXTENT), np.full(3, EMPTY_EXTENT)
    first, last = _front(found, planes, low, high, height)
    for plane in planes:
        name = plane.model or "a plane"
        if _is_up(plane) and float(plane.point[2]) < height:
            z = float(plane.point[2])
            found.notes.append(f"plane of '{name}' at {z:g} m, below the floor: left out")
            continue
        R = axes_of(plane.normal)
        centre = (low + high) / 2.0
        middle = centre - ((centre - plane.point) @ plane.normal) * plane.normal
        reach = float(np.linalg.norm(high - low)) / 2.0 + PLANE_BORDER
        half, thickness = (reach, reach), PLANE_THICKNESS
        axis = _axis_of(plane)
        if axis is not None:  # no farther than to the walls beside it: there its back is solid
            beside = 1 - axis
            half = (last[beside] - first[beside]) / 2.0 + thickness, reach
            middle[beside] = (first[beside] + last[beside]) / 2.0
            middle[axis] = (first if plane.normal[axis] > 0.0 else last)[axis]
            middle[2] = height
            middle += reach * np.sign(R[2, 1]) * R[:, 1]  # from the floor on up the wall
        if plane.half_extents is not None and plane.axes is not None:
            half, thickness = plane.half_extents, SHEET_THICKNESS
            R, middle = plane.axes, plane.point
        at = middle - thickness / 2.0 * plane.normal
        parts.append(
            Part("box", (*half, thickness / 2.0), vector(at), quaternion_of(R), "wall",
                 model=plane.model)
        )  # fmt: skip
        found.notes.append(
            f"plane of '{name}': a box {2 * half[0]:.4g} x {2 * half[1]:.4g} x "
            f"{thickness:g} m behind it"
        )
    return parts


def _axis_of(plane: Plane) -> int | None:
    """Return the axis, x or y, that an infinite wall faces along or up from; None of others."""
    level = np.abs(plane.normal[:2])
    is_wall = plane.axes is None and float(level.max()) > LEAST_WALL and plane.normal[2] > -LEVEL
    return int(np.argmax(level)) if is_wall and float(level.min()) < LEVEL else None


def _front(
    found: Found, planes: list[Plane], low: NDArray[np.float64], high: NDArray[np.float64],
    height: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Return the corners (3,) of a scene, m, moved to the infinite walls that face along an axis.

    Where walls stand on all four sides, they bound the area.
    """
    first, last = low.copy(), high.copy()
    sides = set()
    for plane in planes:
        axis = _axis_of(plane)
        if axis is not None:
            rise = (height - plane.point[2]) * plane.normal[2] / plane.normal[axis]
            inwards = bool(plane.normal[axis] > 0.0)
            (first if inwards else last)[axis] = plane.point[axis] - rise
            sides.add((axis, inwards))
    if (first >= last).any():  # walls that face away from one another
        return low, high
    if len(sides) == 4:
        found.walls = vector(first), vector(last)
    return first, last


def _note_drawn(found: Found, floors: list[Plane]) -> None:
    """Note a floor that is drawn smaller than the scene: contacts take it as infinite."""
    if not found.parts:
        return
    low, high = bounds_of(found.parts)
    for plane in floors:
        half = plane.half_extents
        if half is None or min(half) <= 0.0:
            continue
        beyond = np.maximum(high - plane.point, plane.point - low)[:2] > half
        if beyond.any():
            size = f"{2 * half[0]:g} x {2 * half[1]:g} m"
            found.notes.append(
                f"plane of '{plane.model}', drawn {size}: infinite, as contacts take it"
            )


def _bound_empty(found: Found, floors: list[Plane]) -> None:
    """Bound the area of a scene of a floor alone."""
    at = floors[0].point if floors else np.zeros(3)
    x, y, size = float(at[0]), float(at[1]), EMPTY_EXTENT
    found.low, found.high = (x - size, y - size, -0.5), (x + size, y + size, 3.0)
    found.notes.append(f"nothing but a floor: an area of {2 * size:g} x {2 * size:g} m on it")


def _grid_floor(found: Found) -> tuple[float, str]:
    """Return the height of a scanned floor: where most columns end with free space above.

    The top of the lowest layer of cells in which at least `LEAST_SHARE` of all columns with such
    a surface have it, raised until no more than `UNEVEN_SHARE` of them end within a step above it.
    """
    tops = np.array([part.position[2] + part.size[2] for part in found.parts])
    areas = np.array([4.0 * part.size[0] * part.size[1] for part in found.parts])
    heights, inverse = np.unique(np.round(tops, 6), return_inverse=True)
    area = np.bincount(inverse, areas)
    low, high = bounds_of(found.parts)
    rectangle = float(np.prod(high[:2] - low[:2]))
    if area.max() < max(LEAST_SHARE / 2.0 * rectangle, LEAST_FLOOR):
        return 0.0, ""
    first = int(np.argmax(area))
    floor = first
    for n in range(first + 1, len(heights)):
        if heights[n] - heights[first] > HIGHEST_SLAB / 2.0 or area[n] < UNEVEN_SHARE * area[first]:
            break
        floor = n
    return float(heights[floor]), " (where most cells end)"


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
