"""Bounds on an MJCF's demands on MuJoCo, checked from its numbers before it compiles.

MJCF allocates on one number's word (`nuser_geom`, `nrow`, `width`), multiplies (`replicate`), and
repeats (`iterations`). MuJoCo takes any such number, and 10,000 bodies take it half a minute.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from wayproof.models.world_files.reading import MAX_HEIGHTS, MAX_SOLIDS, WorldFileError
from wayproof.models.world_files.xml_tree import Element

MAX_BODIES = 4000
"""Maximum number of bodies in a scene with copies; compile time grows with its square."""

MAX_COPIES = 2000
"""Maximum number of copies of elements by `replicate`, over all nesting."""

MAX_TEXTURE_PIXELS = 2**27
"""Maximum number of pixels of all textures of a scene; the six sides of a cube count each."""

MAX_VALUES = {
    **dict.fromkeys(
        ("nuser_body", "nuser_jnt", "nuser_geom", "nuser_site", "nuser_cam", "nuser_tendon",
         "nuser_actuator", "nuser_sensor"), 100
    ),
    **dict.fromkeys(
        ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations",
         "sdf_initpoints"), 1000
    ),
    "nuserdata": 4096,
    "nkey": 1000,
    "njmax": 100_000,
    "nconmax": 100_000,
    "nstack": 2**24,
    "nsample": 10_000,
    "num": 1000,
    "maxhullvert": 10_000,
    "octree_maxdepth": 10,
}  # fmt: skip
"""Maximum value of each attribute, on any element."""

MAX_MEMORY = 2**30
"""Maximum of `<size memory>`, bytes."""

UNITS: dict[str, float] = {unit: 2 ** (10 * power) for power, unit in enumerate("KMGTPE", 1)}

MAX_PARTS = 1000
"""Maximum product of the counts of a `flexcomp` or `composite`."""

MAX_MESH_STEPS = 100
"""Maximum number of steps of a generated mesh in each of its two directions."""

SIDES = {"2d": 1, "cube": 6, "skybox": 6}


class Bounds:
    """Sums of the demands of the files of one scene."""

    def __init__(self, top: Path) -> None:
        """Begin with no demand."""
        self._top = top
        self._pixels = self._heights = self._numbers = 0.0

    def check(self, path: Path, element: Element) -> None:
        """Refuse an element's demand, by itself or with all before it.

        Args:
            path: Path of the element's file.
            element: One element, without its children.

        Raises:
            WorldFileError: Naming the element, its number and the bound.
        """
        for name, text in element.attributes.items():
            if name in MAX_VALUES:
                hold(path, element, name, _number(path, element, name, text), MAX_VALUES[name])
            if name == "count" and element.tag in ("flexcomp", "composite"):
                numbers = _numbers(path, element, name, text)
                hold(path, element, name, math.prod(max(one, 1.0) for one in numbers), MAX_PARTS)
        if element.tag == "mesh" and "builtin" in element.attributes:
            steps = _numbers(path, element, "params", element.attributes.get("params", ""))
            hold(path, element, "params", max(steps, default=0.0), MAX_MESH_STEPS)
        if element.tag == "size" and "memory" in element.attributes:
            text = element.attributes["memory"]
            hold(path, element, "memory", _memory(path, element, text), MAX_MEMORY)
        if element.tag == "texture":
            self.add_pixels(path, element, *_sizes(path, element, "width", "height"))
        if element.tag == "hfield":
            self.add_heights(path, element, *_sizes(path, element, "nrow", "ncol"))
        if element.tag == "numeric":
            (size,) = _sizes(path, element, "size")
            self._numbers += max(size, 0.0)
            hold(path, element, "size", self._numbers, MAX_SOLIDS)

    def add_pixels(self, path: Path, element: Element, width: float, height: float) -> None:
        """Count the pixels of a texture, as written or of the picture that it names.

        Raises:
            WorldFileError: All textures together have too many.
        """
        sides = SIDES.get(element.attributes.get("type", "cube"), 6)
        self._pixels += sides * max(width, 0.0) * max(height, 0.0)
        hold(path, element, "pixels of all textures", self._pixels, MAX_TEXTURE_PIXELS)

    def add_heights(self, path: Path, element: Element, rows: float, columns: float) -> None:
        """Count the heights of a field, as written or of the picture that it names.

        Raises:
            WorldFileError: All fields together have too many.
        """
        self._heights += max(rows, 0.0) * max(columns, 0.0)
        hold(path, element, "heights of all fields", self._heights, MAX_HEIGHTS)


def copies(path: Path, element: Element) -> float:
    """Return the copies of an element's content in the scene: more than one by `replicate`.

    Raises:
        WorldFileError: Its count is no number.
    """
    if element.tag != "replicate":
        return 1.0
    return max(_number(path, element, "count", element.attributes.get("count", "1")), 0.0)


def hold(path: Path, element: Element, what: str, got: float, most: float) -> None:
    """Refuse more of something than a scene may hold.

    Raises:
        WorldFileError: Naming the element where it grew too large.
    """
    if not got <= most:
        text = f"<{element.tag}>: {what} {got:g}, expected at most {most:g}"
        raise WorldFileError(path, text, element.line)


def _sizes(path: Path, element: Element, *names: str) -> Iterator[float]:
    for name in names:
        yield _number(path, element, name, element.attributes.get(name, "0"))


def _numbers(path: Path, element: Element, name: str, text: str) -> list[float]:
    return [_number(path, element, name, word) for word in text.split()]


def _memory(path: Path, element: Element, text: str) -> float:
    """Read a size in bytes, with a letter behind for powers of 1024; -1 is MuJoCo's own choice."""
    bare = text.strip()
    unit = float(UNITS.get(bare[-1:].upper(), 1))
    return unit * _number(path, element, "memory", bare[:-1] if unit > 1 else bare)


def _number(path: Path, element: Element, name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        what = f"<{element.tag}>: {name} '{text[:40]}', expected a number"
        raise WorldFileError(path, what, element.line)
    return number
