"""World files: one MJCF that MuJoCo compiles as it is, with what a mission needs in `<custom>`.

Numbers are written so that they read back as the same bits. A world of a file is named after the
file and a hash of its text, so that a log tells which one it was.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from models.imports.mjcf_scenes import CUSTOM, found_in, is_world_file
from models.imports.options import Found
from models.imports.parts import UPRIGHT, Part, Vector3
from models.imports.reading import Unreadable, read_text
from models.imports.solids import solid_of
from models.imports.xml_tree import Element, read_xml
from models.worlds.world import COLOURS, FLOOR_FRICTION, World

FORMAT = "1"
"""Of world files; raised when those of the version before no longer read."""

DIGITS = 16
"""Of the hash in a world's name."""

TAGS = {
    "mujoco", "compiler", "option", "visual", "map", "size", "custom", "numeric", "text", "asset",
    "mesh", "hfield", "worldbody", "light", "geom",
}  # fmt: skip
"""All that a world file may hold: nothing that names another file or loads code."""

GREY = "0.6 0.6 0.6 1"

_FILE = """\
<mujoco model={name}>
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
    <geom name="floor" type="plane" pos="{centre} 0" size="{half} 0.05" group="0" contype="1" \
conaffinity="1" friction="{friction} 0.005 0.0001" rgba="0.9 0.9 0.9 1"/>
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
        route_length: Of a published route from start to goal, m; 0 if there is none.
        source: What the file was made from.
        protocol: Of a benchmark that it is part of: limits and the constants of its score.
    """

    text: str = field(default="", repr=False)
    route_length: float = 0.0
    source: str = ""
    protocol: str = ""

    @property
    def identity(self) -> str:
        """Name and hash of the text, as a log tells them."""
        return f"{self.name}@{hashlib.sha256(self.text.encode()).hexdigest()[:DIGITS]}"

    def mjcf(self) -> str:
        """The file's own text."""
        return self.text


def read_world_file(path: Path) -> FileWorld:
    """Read a world file.

    Raises:
        Unreadable: No world file, one of another format, or one that holds more than a world.
    """
    tree, text = read_xml(path), read_text(path)
    if not is_world_file(tree):
        raise Unreadable(path, "not a world file; 'wayproof import' makes one of it")
    _check_tags(path, tree)
    return world_of(text, path.stem, path)


def world_of(text: str, name: str, path: Path | str = "world") -> FileWorld:
    """The world that a world file's text describes.

    Args:
        text: The file's own.
        name: Of the world.
        path: For what is said if the text cannot be taken.

    Raises:
        Unreadable: The text does not compile, or lacks what a mission needs.
    """
    try:
        found = found_in(mujoco.MjModel.from_xml_string(text), path)
    except ValueError as error:
        raise error if isinstance(error, Unreadable) else Unreadable(path, _line(error)) from None
    told = found.start, found.start_heading, found.goal, found.low, found.high
    if None in told or found.format != FORMAT:
        raise Unreadable(path, f"world file of format '{found.format}', expected '{FORMAT}'")
    try:
        return FileWorld(
            name=name, seed=0, low=found.low, high=found.high,  # type: ignore[arg-type]
            boxes=tuple(solid_of(part) for part in found.parts),
            start=found.start, start_heading=found.start_heading, goal=found.goal,  # type: ignore[arg-type]
            text=text, route_length=found.route_length or 0.0, source=found.source,
            protocol=found.protocol,
        )  # fmt: skip
    except ValueError as error:
        raise Unreadable(path, str(error)) from None


def world_text(found: Found, name: str) -> str:
    """The world file of what an importer found; the same bytes for the same parts.

    Args:
        found: With start, goal and corners.
        name: Of the model.
    """
    assert found.low is not None and found.high is not None  # `complete` has seen to it
    centre = [(a + b) / 2.0 for a, b in zip(found.low[:2], found.high[:2], strict=True)]
    half = [(b - a) / 2.0 for a, b in zip(found.low[:2], found.high[:2], strict=True)]
    names = part_names(found.parts)
    return _FILE.format(
        name=quoteattr(name),
        custom="\n".join(_custom(found)),
        assets="\n".join(
            line for n, part in zip(names, found.parts, strict=True) for line in _asset(n, part)
        ),
        centre=_numbers(centre),
        half=_numbers(half),
        friction=FLOOR_FRICTION,
        geoms="\n".join(_geom(n, part) for n, part in zip(names, found.parts, strict=True)),
    )


def part_names(parts: Iterable[Part]) -> list[str]:
    """Geom name of each part: its kind and its count within the kind."""
    seen: Counter[str] = Counter()
    names = []
    for part in parts:
        kind = re.sub("[^a-z_]", "_", part.kind.lower()) or "structure"
        names.append(f"{kind}_{seen[kind]}")
        seen[kind] += 1
    return names


def _custom(found: Found) -> list[str]:
    values: dict[str, Iterable[float]] = {
        "start": [*(found.start or ()), found.start_heading or 0.0],
        "goal": found.goal or (),
        "low": found.low or (),
        "high": found.high or (),
        "route_length": [found.route_length or 0.0],
    }
    lines = [
        f'    <numeric name="{CUSTOM}{name}" data="{_numbers(data)}"/>'
        for name, data in values.items()
    ]
    texts = {"format": FORMAT, "source": found.source, "protocol": found.protocol}
    return lines + [
        f'    <text name="{CUSTOM}{name}" data={quoteattr(text)}/>'
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


def _geom(name: str, part: Part) -> str:
    shape = {
        "mesh": f'type="mesh" mesh="{name}"',
        "heights": f'type="hfield" hfield="{name}"',
    }.get(part.shape, f'type="{part.shape}" size="{_numbers(part.size)}"')
    turn = "" if part.quaternion == UPRIGHT else f' quat="{_numbers(part.quaternion)}"'
    return (
        f'    <geom name="{name}" {shape} pos="{_numbers(part.position)}"{turn} group="0" '
        f'contype="1" conaffinity="1" friction="{FLOOR_FRICTION} 0.005 0.0001" '
        f'rgba="{COLOURS.get(part.kind, GREY)}"/>'
    )


def _numbers(values: Iterable[float]) -> str:
    """Each as the shortest text that reads back as the same bits."""
    return " ".join(repr(float(value)).removesuffix(".0") for value in values)


def _check_tags(path: Path, element: Element) -> None:
    if element.tag not in TAGS or any(key.startswith("file") for key in element.attributes):
        what = f"<{element.tag}>: not of a world file; 'wayproof import' makes one of it"
        raise Unreadable(path, what, element.line)
    for child in element.children:
        _check_tags(path, child)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
