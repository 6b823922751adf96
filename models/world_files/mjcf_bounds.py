"""Bounds on an MJCF's demands on MuJoCo, checked from its numbers before it compiles.

MJCF allocates on one number's word (`nuser_geom`, `nrow`, `width`), multiplies (`replicate`), and
repeats (`iterations`). MuJoCo takes any such number, and 10,000 bodies take it half a minute.
"""

from __future__ import annotations

import math
from collections import Counter
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

MAX_SUMS = {
    "pixels of all textures": MAX_TEXTURE_PIXELS,
    "heights of all fields": MAX_HEIGHTS,
    "size": MAX_SOLIDS,
}
"""Maximum of what the elements of a scene demand together; `size` is that of `numeric`."""


class Bounds:
    """Sums of the demands of the files of one scene."""

    def __init__(self, top: Path) -> None:
        """Begin with no demand."""
        self._top = top
        self._sums: Counter[str] = Counter()

    def check(self, path: Path, element: Element) -> None:
        """Refuse an element's demand, by itself or with all before it.

        Args:
            path: Path of the element's file.
            element: One element, without its children.

        Raises:
            WorldFileError: Naming the element, its number and the bound.
        """
        tag, given = element.tag, element.attributes

        def numbers(name: str) -> list[float]:
            words = given.get(name, "").split() or ["0"]
            return [number_of(path, element, name, word) for word in words]

        for name in given.keys() & MAX_VALUES.keys():
            value = number_of(path, element, name, given[name])
            hold(path, element, name, value, MAX_VALUES[name])
        if tag in ("flexcomp", "composite"):
            count = math.prod(max(one, 1.0) for one in numbers("count"))
            hold(path, element, "count", count, MAX_PARTS)
        if tag == "mesh" and "builtin" in given:
            hold(path, element, "params", max(numbers("params")), MAX_MESH_STEPS)
        if tag == "size" and "memory" in given:
            text = given["memory"].strip()
            unit = float(UNITS.get(text[-1:].upper(), 1))
            value = number_of(path, element, "memory", text[:-1] if unit > 1 else text)
            hold(path, element, "memory", unit * value, MAX_MEMORY)
        if tag in ("texture", "hfield"):
            sides = ("width", "height") if tag == "texture" else ("nrow", "ncol")
            self.add_grid(path, element, *(numbers(side)[0] for side in sides))
        if tag == "numeric":
            self._add(path, element, "size", max(numbers("size")[0], 0.0))

    def add_grid(self, path: Path, element: Element, width: float, height: float) -> None:
        """Count what a texture or height field holds, as written or in the picture that it names.

        Raises:
            WorldFileError: All of them together hold too much.
        """
        count = max(width, 0.0) * max(height, 0.0)
        if element.tag == "hfield":
            self._add(path, element, "heights of all fields", count)
        else:  # the six sides of a cube count each
            sides = 1 if element.attributes.get("type") == "2d" else 6
            self._add(path, element, "pixels of all textures", sides * count)

    def _add(self, path: Path, element: Element, what: str, count: float) -> None:
        self._sums[what] += count  # type: ignore[assignment]  # a sum may be endless
        hold(path, element, what, self._sums[what], MAX_SUMS[what])


def copies(path: Path, element: Element) -> float:
    """Return the copies of an element's content in the scene: more than one by `replicate`.

    Raises:
        WorldFileError: Its count is no number.
    """
    if element.tag != "replicate":
        return 1.0
    return max(number_of(path, element, "count", element.attributes.get("count", "1")), 0.0)


def hold(path: Path, element: Element, what: str, got: float, most: float) -> None:
    """Refuse more of something than a scene may hold.

    Raises:
        WorldFileError: Naming the element where it grew too large.
    """
    if not got <= most:
        text = f"<{element.tag}>: {what} {got:g}, expected at most {most:g}"
        raise WorldFileError(path, text, element.line)


def number_of(path: Path, element: Element, name: str, text: str) -> float:
    """Return an attribute's number.

    Raises:
        WorldFileError: It is none, or not finite.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        what = f"<{element.tag}>: {name} '{text[:40]}', expected a number"
        raise WorldFileError(path, what, element.line)
    return number
