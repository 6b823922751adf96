"""Files of an MJCF scene, checked before MuJoCo opens any of them.

All that a scene names, and all that its includes and attached models name, has to lie in its folder
or below, be a plain file of a bounded size, and load no code. What they demand is counted over all
of them, copies included.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.images import png_size
from wayproof.models.world_files.mjcf_bounds import (
    MAX_BODIES,
    MAX_COPIES,
    Bounds,
    copies,
    hold,
)
from wayproof.models.world_files.reading import MAX_BYTES, MAX_SOLIDS, WorldFileError, beside
from wayproof.models.world_files.xml_tree import Element, read_xml

CODE = ("plugin", "extension")
FOLDERS = ("assetdir", "meshdir", "texturedir")
OUTSIDE = "expected --root with a folder that holds both"
"""Remedy for a scene that reaches out of its folder."""

MODEL_ELEMENTS = ("include", "model")
"""Elements that name another MJCF file."""

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
        self._bounds = Bounds(top)
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
