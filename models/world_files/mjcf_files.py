"""Files of an MJCF scene, checked before MuJoCo opens any of them.

All that a scene names, and all that its includes and attached models name, has to lie in its folder
or below, be a plain file of a bounded size, and load no code. What they demand is counted over all
of them, copies included.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

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


class _Total(NamedTuple):
    """Counts of elements in a file or below an element, copies included."""

    geoms: float = 0.0
    bodies: float = 0.0
    copied: float = 0.0

    def with_(self, other: _Total) -> _Total:
        return _Total(*(a + b for a, b in zip(self, other, strict=True)))

    def repeated(self, times: float) -> _Total:
        """Return all counts times a number; repeated elements count as copied."""
        copied = self.copied if times <= 1.0 else (self.geoms + self.bodies)
        return _Total(times * self.geoms, times * self.bodies, times * copied)


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
            self._check_element(path, element, folders)
            if element.tag == "model":
                name = element.attributes.get("name", element.attributes.get("file", ""))
                models[name] = self._named(path, element, opened)
        return self._total(path, tree, models, opened)

    def _total(
        self, path: Path, element: Element, models: dict[str, _Total], opened: list[Path]
    ) -> _Total:
        own = _Total(float(element.tag == "geom"), float(element.tag == "body"))
        if element.tag == "include":
            own = own.with_(self._named(path, element, opened))
        if element.tag == "attach":
            own = own.with_(models.get(element.attributes.get("model", ""), _Total()))
        for child in element.children:
            own = own.with_(self._total(path, child, models, opened))
        total = own.repeated(copies(path, element))
        hold(path, element, "copies", total.copied, MAX_COPIES)
        hold(path, element, "bodies", total.bodies, MAX_BODIES)
        hold(path, element, "geoms", total.geoms, MAX_SOLIDS)
        return total

    def _check_element(self, path: Path, element: Element, folders: set[str]) -> None:
        if element.tag in CODE:
            what = f"<{element.tag}>: loads code, cannot be taken over"
            raise WorldFileError(path, what, element.line)
        self._bounds.check(path, element)
        for key, name in element.attributes.items():
            if key.startswith("file"):
                for folder in ("", *sorted(folders)):
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
                raise WorldFileError(
                    path, f"<{element.tag}>: '{name}' is no plain file", element.line
                )
            if element.tag not in MODEL_ELEMENTS:
                self._check_asset(path, element, file)

    def _check_asset(self, path: Path, element: Element, file: Path) -> None:
        known = (path, element.line, file.resolve())
        if known in self._assets:
            return
        self._assets.add(known)
        self._bytes += file.stat().st_size
        hold(path, element, "bytes of all assets", self._bytes, MAX_BYTES)
        size = png_size(file)
        if size is not None and element.tag == "hfield":
            self._bounds.add_heights(path, element, *size)
        elif size is not None:
            self._bounds.add_pixels(path, element, *size)

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
