"""Files of an MJCF scene, checked before MuJoCo opens any of them.

All that a scene names, and all that its includes and attached models name, has to lie in its folder
or below, be a plain file of a bounded size, and load no code. What they demand is counted over all
of them, copies included: MJCF allocates on one number's word (`nuser_geom`, `nrow`, `width`),
multiplies (`replicate`), and repeats (`iterations`). MuJoCo takes any such number.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.images import png_size
from wayproof.models.world_files.reading import (
    MAX_BYTES,
    MAX_HEIGHTS,
    MAX_SOLIDS,
    WorldFileError,
    beside,
)
from wayproof.models.world_files.xml_tree import Element, read_xml

CODE = ("plugin", "extension")
FOLDERS = ("assetdir", "meshdir", "texturedir")
OUTSIDE = "expected --root with a folder that holds both"
"""Remedy for a scene that reaches out of its folder."""

MODEL_ELEMENTS = ("include", "model")
"""Elements that name another MJCF file."""

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

_Total = NDArray[np.float64]

COUNTED = ("copies", "bodies", "geoms"), (MAX_COPIES, MAX_BODIES, MAX_SOLIDS)
"""What is counted of a file or below an element, and the most of each."""

MOST_NESTED = 20
MAX_MODEL_FILES = 200
"""Maximum number of MJCF files in a scene, counted at every mention."""


def check_scene(top: Path, root: Path | None = None) -> None:
    """Refuse a scene that reaches out of its folder, loads code or demands too much.

    Args:
        top: The scene.
        root: Folder below which all its files have to lie; None for the scene's own.

    Raises:
        WorldFileError: Naming the file, the element and its line.
    """
    _Scene(top, root).check(top, [])


class _Scene:
    """One scene and every file that it leads to."""

    def __init__(self, top: Path, root: Path | None = None) -> None:
        self._top = top
        self._root = (top.parent if root is None else root).resolve()
        self._bounds = Bounds()
        self._files = 0
        self._bytes = 0
        self._assets: set[tuple[Path, int, Path]] = set()

    def check(self, path: Path, opened: list[Path]) -> _Total:
        """Check one file of MJCF and all that it leads to."""
        self._files += 1
        if len(opened) >= MOST_NESTED or path in opened:
            what = f"<include> or <model> of '{path.name}': in a circle, or too deep"
            raise WorldFileError(self._top, what)
        if self._files > MAX_MODEL_FILES:
            raise WorldFileError(self._top, f"names more than {MAX_MODEL_FILES} files of MJCF")
        tree = read_xml(path)
        elements = list(_walk(tree))
        folders = {
            one.attributes[key] for one in elements for key in FOLDERS if key in one.attributes
        }
        models: dict[str, _Total] = {}
        for element in elements:
            self._check_element(path, element, ("", *sorted(folders)))
            if element.tag == "model":
                name = element.attributes.get("name", element.attributes.get("file", ""))
                models[name] = self._named(path, element, opened)
        return self._total(path, tree, models, opened)

    def _total(
        self, path: Path, element: Element, models: dict[str, _Total], opened: list[Path]
    ) -> _Total:
        """Count what is copied, bodies and geoms in an element, copies included."""
        total = np.array([0.0, element.tag == "body", element.tag == "geom"], np.float64)
        if element.tag == "include":
            total += self._named(path, element, opened)
        if element.tag == "attach":
            total += models.get(element.attributes.get("model", ""), 0.0)
        for child in element.children:
            total += self._total(path, child, models, opened)
        if (times := copies(path, element)) > 1.0:
            total[0] = total[1] + total[2]
        total *= times
        for count, what, most in zip(total.tolist(), *COUNTED, strict=True):
            hold(path, element, what, count, most)
        return total

    def _check_element(self, path: Path, element: Element, folders: tuple[str, ...]) -> None:
        if element.tag in CODE:
            what = f"<{element.tag}>: loads code, cannot be taken over"
            raise WorldFileError(path, what, element.line)
        self._bounds.check(path, element)
        for key, name in element.attributes.items():
            if key.startswith("file"):
                for folder in folders:
                    self._check_named(path, element, str(Path(folder) / name))

    def _check_named(self, path: Path, element: Element, name: str) -> None:
        """Refuse a file outside, taken from the scene's folder and from the file's own."""
        for base in (self._top, path):
            file = base.parent / name
            if not file.resolve().is_relative_to(self._root):
                what = f"<{element.tag}>: '{name}' lies outside the scene's folder; {OUTSIDE}"
                raise WorldFileError(path, what, element.line)
            if not file.exists() or file.is_dir():
                continue  # MuJoCo says what it misses
            if not file.is_file():
                what = f"<{element.tag}>: '{name}' is no plain file"
                raise WorldFileError(path, what, element.line)
            known = (path, element.line, file.resolve())
            if element.tag not in MODEL_ELEMENTS and known not in self._assets:
                self._assets.add(known)
                self._bytes += file.stat().st_size
                hold(path, element, "bytes of all assets", self._bytes, MAX_BYTES)
                if (size := png_size(file)) is not None:
                    self._bounds.add_grid(path, element, *size)

    def _named(self, path: Path, element: Element, opened: list[Path]) -> _Total:
        name = element.attributes.get("file", "")
        file = beside(self._top, name)
        if not file.is_file():
            what = f"<{element.tag}>: no file '{name}' in its folder"
            raise WorldFileError(path, what, element.line)
        return self.check(file, [*opened, path])


def _walk(element: Element) -> Iterator[Element]:
    yield element
    for child in element.children:
        yield from _walk(child)


class Bounds:
    """Sums of the demands of the files of one scene."""

    def __init__(self) -> None:
        """Begin with no demand."""
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
