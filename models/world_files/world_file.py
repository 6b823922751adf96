"""World files: one MJCF that MuJoCo compiles as it is, with start, goal and area in `<custom>`.

Numbers are written so that they read back as the same bits. A world of a file is named after the
file and a hash of its text, so that a log identifies it.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.world_files.ground import FLOOR_KIND
from wayproof.models.world_files.mjcf_scenes import (
    CUSTOM_PREFIX,
    MOVER_PREFIX,
    found_in,
    is_world_file,
)
from wayproof.models.world_files.movers import mover_text
from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.parts import UPRIGHT, Part
from wayproof.models.world_files.reading import WorldFileError, read_text
from wayproof.models.world_files.solids import solid_of
from wayproof.models.world_files.terrain import Terrain, ground_heights, terrain_of
from wayproof.models.world_files.xml_tree import Element, read_xml
from wayproof.models.worlds.solids import FRICTION, Box
from wayproof.models.worlds.solids.solid import class_of, colour_of
from wayproof.models.worlds.world import World, mover_body

FORMAT = "1"
"""Version of the format; raised when files of the version before no longer read."""

HASH_DIGITS = 16
"""Number of hex digits of the hash in a world's name."""

TAGS = {
    "mujoco", "compiler", "option", "visual", "map", "size", "custom", "numeric", "text", "asset",
    "mesh", "hfield", "worldbody", "light", "geom", "body",
}  # fmt: skip
"""Elements that a world file may hold: none names another file or loads code."""

_FILE = """\
<mujoco model={name}>
  <size nuser_geom="1"/>
  <option timestep="0.002" integrator="implicitfast" cone="pyramidal" iterations="50" \
gravity="0 0 -9.81"/>
  <visual>
    <map znear="0.001"/>
  </visual>
  <custom>
{custom}
  </custom>
  <asset>
{assets}
  </asset>
  <worldbody>
    <light name="sun" pos="{centre} 10" dir="0 0 -1" directional="true" castshadow="false"/>
{geoms}
  </worldbody>
</mujoco>
"""
# The head is that of the generated worlds: robots are tuned to its time step.


@dataclass(frozen=True)
class FileWorld(World):
    """A world read from a world file.

    Attributes:
        text: The file's own.
        source: Name of the imported file.
        terrain: Floors that are not level: height fields, tilted boxes and planes, ramps of meshes.
    """

    text: str = field(default="", repr=False)
    source: str = ""
    terrain: Terrain = field(default=(), repr=False)

    @property
    def identity(self) -> str:
        """Name and hash of the text, as in a log."""
        return f"{self.name}@{hashlib.sha256(self.text.encode()).hexdigest()[:HASH_DIGITS]}"

    def mjcf(self) -> str:
        """Return the file's own text."""
        return self.text

    def ground_height(self, point: ArrayLike) -> float:
        """Return the height of the floor at a point (>= 2,), m: of the highest terrain, else 0."""
        return float(ground_heights(self.terrain, np.ravel(point)[None, :2])[0])

    @cached_property
    def _corners(self) -> NDArray[np.float64]:  # (2, n, 3)
        ends = [[solid.low for solid in self.solids], [solid.high for solid in self.solids]]
        return np.array(ends, np.float64).reshape(2, -1, 3)

    def contains_obstacle(self, point: ArrayLike, radius: float) -> str | None:
        """Test as any world does, but only solids with near bounds, for there may be many."""
        at = np.asarray(point, np.float64)
        outside = np.maximum(np.maximum(self._corners[0] - at, at - self._corners[1]), 0.0)
        near = np.flatnonzero(np.linalg.norm(outside, axis=1) <= radius)
        distances = [float(self.solids[i].distance(at[None])[0]) for i in near]
        if not distances or min(distances) > radius:
            return None
        return self.solid_names[int(near[int(np.argmin(distances))])]


def read_world_file(path: Path) -> FileWorld:
    """Read a world file.

    Raises:
        WorldFileError: No world file, one of another format, or one that holds more than a world.
    """
    tree, text = read_xml(path), read_text(path)
    if not is_world_file(tree):
        raise WorldFileError(path, "not a world file; 'wayproof import' makes one of it")
    _check_tags(path, tree)
    return world_of(text, path)


def world_of(text: str, path: Path | str = "world") -> FileWorld:
    """Return the world that a world file's text describes.

    Args:
        text: The file's own.
        path: For what is said if the text cannot be taken.

    Raises:
        WorldFileError: The text does not compile, or lacks what a mission needs.
    """
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise WorldFileError(path, _line(error)) from None
    hidden = [model.geom(n).name or f"number {n}"
              for n in np.flatnonzero(model.geom_group == ROBOT_GROUP)]  # fmt: skip
    if hidden:
        what = f"geom '{hidden[0]}' of group {ROBOT_GROUP}, which is a robot's own: no beam and no "
        raise WorldFileError(path, what + "collision would meet it; expected another group")
    return _world_in(model, text, path, robot=None)


def world_in_scene(model: mujoco.MjModel, robot: int) -> FileWorld:
    """Return the world of a scene that was composed of a world file and a robot.

    A scene is written with fewer digits than a world file: lengths may differ in the last ones.

    Args:
        model: The scene.
        robot: Body of the robot.

    Raises:
        WorldFileError: The scene is of no world file.
    """
    return _world_in(model, "", "scene", robot)


def parts_in(model: mujoco.MjModel, path: Path | str, robot: int | None = None) -> Found:
    """Return what a compiled world file or a scene with one holds, which `world_text` writes again.

    Args:
        model: The compiled world file, or a scene that was composed of one and a robot.
        path: For what is said if it cannot be taken.
        robot: Body of the robot.

    Raises:
        WorldFileError: The model holds what no world file does.
    """
    try:
        found = found_in(model, path, robot)
    except ValueError as error:
        raise (
            error if isinstance(error, WorldFileError) else WorldFileError(path, _line(error))
        ) from None
    found.plane = any(not plane.point[2] and plane.normal[2] == 1.0 for plane in found.planes)
    return found


def _world_in(model: mujoco.MjModel, text: str, path: Path | str, robot: int | None) -> FileWorld:
    found = parts_in(model, path, robot)
    ends = found.ends()
    if ends is None or found.format != FORMAT:
        raise WorldFileError(path, f"world file of format '{found.format}', expected '{FORMAT}'")
    solids = [(part, solid_of(part)) for part in found.parts]
    floors = [solid for part, solid in solids if part.kind == FLOOR_KIND]
    boxes = tuple(solid for solid in floors if isinstance(solid, Box))
    slabs = boxes if len(boxes) == len(floors) else ()  # where all of the floor is known
    try:
        return FileWorld(
            name=model.names.split(b"\0")[0].decode(), seed=0, low=ends.low, high=ends.high,
            solids=tuple(solid for part, solid in solids if part.kind != FLOOR_KIND),
            start=ends.start, start_heading=ends.start_heading, goal=ends.goal,
            floor=None if found.plane or not slabs else slabs, route_length=found.route_length,
            text=text, source=found.source, movers=tuple(found.movers),
            terrain=terrain_of(floors, found.planes),
        )  # fmt: skip
    except ValueError as error:
        raise WorldFileError(path, str(error)) from None


def world_text(found: Found, ends: Ends, name: str) -> str:
    """Write the world file of an import; equal parts give equal bytes.

    Args:
        found: Parts and mission of the import.
        ends: Operating area, start and goal.
        name: Name of the model.
    """
    centre = [(a + b) / 2.0 for a, b in zip(ends.low[:2], ends.high[:2], strict=True)]
    named = list(zip(part_names(found.parts), found.parts, strict=True))
    geoms = [_geom(name, part) for name, part in named]
    geoms += map(mover_body, found.movers)
    if found.plane or all(part.kind != FLOOR_KIND for part in found.parts):
        geoms.insert(0, _floor(centre, ends))
    return _FILE.format(
        name=_quoted(name),
        custom="\n".join(_custom(found, ends)),
        assets="\n".join(line for name, part in named for line in _asset(name, part)),
        centre=_numbers(centre),
        geoms="\n".join(geoms),
    )


def file_of(world: World) -> str:
    """Write a generated world as a world file, with the same numbers."""
    ends = Ends(world.low, world.high, world.start, world.start_heading, world.goal)
    found = Found(movers=list(world.movers), route_length=world.route_length)
    custom = "\n".join(_custom(found, ends))
    head, visual, rest = world.mjcf().partition("  </visual>\n")
    return f"{head}{visual}  <custom>\n{custom}\n  </custom>\n{rest}"


def part_names(parts: Iterable[Part]) -> list[str]:
    """Return the geom name of each part: its kind and its count within the kind."""
    seen: Counter[str] = Counter()
    names = []
    for part in parts:
        kind = re.sub("[^a-z_]", "_", part.kind.lower()) or "structure"
        names.append(f"{kind}_{seen[kind]}")
        seen[kind] += 1
    return names


def _quoted(text: str) -> str:
    """Return a text as the value of an attribute, in quotes."""
    from xml.sax.saxutils import quoteattr  # slow to load, with a client of HTTP

    return quoteattr(text)


def _custom(found: Found, ends: Ends) -> list[str]:
    values: dict[str, Iterable[float]] = {
        "start": [*ends.start, ends.start_heading],
        "goal": ends.goal,
        "low": ends.low,
        "high": ends.high,
        "route_length": [found.route_length or 0.0],
    }
    lines = [
        f'    <numeric name="{CUSTOM_PREFIX}{name}" data="{_numbers(data)}"/>'
        for name, data in values.items()
    ]
    texts = {"format": FORMAT, "source": found.source}
    texts |= {MOVER_PREFIX + mover.name: mover_text(mover) for mover in found.movers}
    return lines + [
        f'    <text name="{CUSTOM_PREFIX}{name}" data={_quoted(text)}/>'
        for name, text in texts.items()
        if text
    ]


def _asset(name: str, part: Part) -> list[str]:
    if part.mesh is not None:
        vertices, faces = _numbers(part.mesh.vertices.ravel()), part.mesh.faces.ravel().tolist()
        indices = " ".join(map(str, faces))
        return [f'    <mesh name="{name}" inertia="shell" vertex="{vertices}" face="{indices}"/>']
    if part.heights is not None:
        rows, columns = part.heights.shape
        # MuJoCo reads the rows of `elevation` from the top of the picture, y downwards.
        levels = _numbers(part.heights[::-1].ravel())
        return [
            f'    <hfield name="{name}" nrow="{rows}" ncol="{columns}" '
            f'size="{_numbers(part.size)}" elevation="{levels}"/>'
        ]
    return []


def _floor(centre: list[float], ends: Ends) -> str:
    half = [(b - a) / 2.0 for a, b in zip(ends.low[:2], ends.high[:2], strict=True)]
    place = f'type="plane" pos="{_numbers(centre)} 0" size="{_numbers(half)} 0.05"'
    return _geom_of(FLOOR_KIND, place, FLOOR_KIND)


def _geom(name: str, part: Part) -> str:
    shape = {
        "mesh": f'type="mesh" mesh="{name}"',
        "heights": f'type="hfield" hfield="{name}"',
    }.get(part.shape, f'type="{part.shape}" size="{_numbers(part.size)}"')
    turn = "" if part.quaternion == UPRIGHT else f' quat="{_numbers(part.quaternion)}"'
    return _geom_of(name, f'{shape} pos="{_numbers(part.position)}"{turn}', part.kind)


def _geom_of(name: str, place: str, kind: str) -> str:
    return (
        f'    <geom name="{name}" {place} group="0" contype="1" conaffinity="1" '
        f'friction="{FRICTION} 0.005 0.0001" rgba="{colour_of(kind)}" user="{class_of(kind)}"/>'
    )


def _numbers(values: Iterable[float]) -> str:
    """Write each number as the shortest text that reads back as the same bits."""
    return " ".join(repr(float(value)).removesuffix(".0") for value in values)


def _check_tags(path: Path, element: Element) -> None:
    if element.tag not in TAGS or any(key.startswith("file") for key in element.attributes):
        what = f"<{element.tag}>: not of a world file; 'wayproof import' makes one of it"
        raise WorldFileError(path, what, element.line)
    for child in element.children:
        _check_tags(path, child)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
