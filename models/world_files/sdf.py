"""Gazebo worlds (`.world`, `.sdf`): their collision shapes as one static scene.

Source: the SDFormat specification, versions 1.4 to 1.11. A `<state>` is where Gazebo saved its
models; it holds the poses that count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from wayproof.models.world_files.meshes import mesh_parts
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part, moved
from wayproof.models.world_files.reading import MAX_SOLIDS, WorldFileError, beside
from wayproof.models.world_files.sdf_frames import ORIGIN, Frames, Placement, numbers
from wayproof.models.world_files.xml_tree import Element, read_xml

BUILT_IN_MODELS = ("ground_plane", "sun")
"""Models that every Gazebo has: the floor, which every world here has too, and a light."""

MAX_NESTED = 20
"""Maximum depth of includes; deeper ones are a cycle."""

MAX_INCLUDED = 2000
"""Maximum number of included files, counted at every mention."""

FLAT = 1e-9


def read_sdf(path: Path, options: ImportOptions) -> Found:
    """Read every collision shape of every model.

    Raises:
        WorldFileError: Naming the element and its line that cannot be taken over.
    """
    root = read_xml(path)
    scopes = [child for child in root.children if child.tag in ("world", "model")]
    if root.tag != "sdf" or len(scopes) != 1:
        raise WorldFileError(path, f"<{root.tag}>: expected <sdf> with one <world> or <model>", 1)
    reading = _Reading(options)
    if scopes[0].tag == "model":
        reading.take_model(path, scopes[0], ORIGIN)
    else:
        reading.take_world(path, scopes[0])
    return reading.found


class _Reading:
    """One file and what it includes."""

    def __init__(self, options: ImportOptions) -> None:
        self.found = Found()
        self._options = options
        self._depth = self._included = 0
        self._moving = 0

    def take_world(self, path: Path, world: Element) -> None:
        frames, saved = Frames(path, world), _saved_state(path, world)
        for child in world.children:
            if child.tag == "model":
                name = child.attributes.get("name", "")
                self.take_model(path, child, frames.of(child), saved.get(name))
            elif child.tag == "include":
                self._include(path, child, frames.of(child))
            elif child.tag in ("road", "population", "actor"):
                raise WorldFileError(path, f"<{child.tag}>: cannot be taken over", child.line)
        if self._moving:
            self.found.notes.append(f"{self._moving} models that can move: they stand still here")

    def take_model(
        self, path: Path, model: Element, placed: Placement, state: _State | None = None
    ) -> None:
        """Read all links of a model at T_world_model, or at its saved pose."""
        frames = Frames(path, model)
        static = model.first("static")
        self._moving += static is None or static.text.strip() not in ("1", "true")
        if state is not None and state.placed is not None:
            placed = state.placed
        for child in model.children:
            if child.tag == "link":
                at = placed @ frames.of(child)
                if state is not None:
                    at = state.links.get(child.attributes.get("name", ""), at)
                self._take_link(path, child, at)
            elif child.tag == "model":
                self.take_model(path, child, placed @ frames.of(child))
            elif child.tag == "include":
                self._include(path, child, placed @ frames.of(child))

    def _take_link(self, path: Path, link: Element, placed: Placement) -> None:
        shapes = list(link.all("collision")) or list(link.all("visual"))
        if shapes and shapes[0].tag == "visual":
            name = link.attributes.get("name", "")
            self.found.notes.append(f"link '{name}' (line {link.line}): its visuals made solid")
        frames = Frames(path, link)
        for shape in shapes:
            at = placed @ frames.of(shape)
            geometry = shape.first("geometry")
            if geometry is None or len(geometry.children) != 1:
                raise WorldFileError(path, f"<{shape.tag}>: expected one geometry", shape.line)
            for part in self._shape(path, geometry.children[0], at):
                self.found.parts.append(moved(part, at.position, at.R))
            if len(self.found.parts) > MAX_SOLIDS:
                raise WorldFileError(path, f"more than {MAX_SOLIDS} shapes", shape.line)

    def _shape(self, path: Path, shape: Element, placed: Placement) -> Iterator[Part]:
        if shape.tag == "empty":
            return
        if shape.tag == "plane":
            _check_floor(path, shape, placed)
        elif shape.tag == "mesh":
            yield from self._mesh(path, shape)
        elif shape.tag in SHAPES:
            try:
                yield SHAPES[shape.tag](path, shape)
            except WorldFileError:
                raise
            except ValueError as error:
                raise WorldFileError(path, f"<{shape.tag}>: {error}", shape.line) from None
        else:
            known = ", ".join([*SHAPES, "mesh", "plane", "empty"])
            what = f"<{shape.tag}>: cannot be taken over (available: {known})"
            raise WorldFileError(path, what, shape.line)

    def _mesh(self, path: Path, shape: Element) -> Iterator[Part]:
        uri = shape.first("uri")
        if uri is None or shape.first("submesh") is not None:
            raise WorldFileError(path, "<mesh>: expected a <uri> and no <submesh>", shape.line)
        file = beside(path, _local(uri.text))
        if not file.is_file():
            raise WorldFileError(path, f"<mesh>: no file '{uri.text.strip()}' beside it", uri.line)
        element = shape.first("scale")
        scale = [1.0] * 3 if element is None else numbers(path, element, 3)
        yield from mesh_parts(file, np.array(scale), self.found.notes)

    def _include(self, path: Path, include: Element, placed: Placement) -> None:
        uri = include.first("uri")
        name = "" if uri is None else _local(uri.text)
        if name in BUILT_IN_MODELS:
            return
        file = beside(path, name)
        file = file / "model.sdf" if file.is_dir() else file
        if not name or not file.is_file():
            if self._options.skip_missing:
                text = f"<include> of '{name}' (line {include.line}): not there, left out"
                self.found.notes.append(text)
                return
            what = f"<include>: no model '{name}' beside it; expected --skip-missing to go without"
            raise WorldFileError(path, what, include.line)
        if include.first("placement_frame") is not None or self._depth >= MAX_NESTED:
            what = f"<include>: with a placement frame, or more than {MAX_NESTED} deep"
            raise WorldFileError(path, what, include.line)
        self._depth += 1
        self._included += 1
        if self._included > MAX_INCLUDED:
            raise WorldFileError(path, f"<include>: more than {MAX_INCLUDED}", include.line)
        model = read_xml(file).first("model")
        if model is None:
            raise WorldFileError(file, "expected <sdf> with one <model>", 1)
        own = Frames(file, model).of(model) if include.first("pose") is None else ORIGIN
        self.take_model(file, model, placed @ own)
        self._depth -= 1


class _State:
    """Saved poses of a model and of each of its links, T_world."""

    def __init__(self, path: Path, model: Element) -> None:
        scale = model.first("scale")
        if scale is not None and numbers(path, scale, 3) != [1.0, 1.0, 1.0]:
            raise WorldFileError(path, "<scale>: expected 1 1 1", scale.line)
        nothing = Element("state", {}, model.line)
        frames = Frames(path, nothing)
        self.placed = None if model.first("pose") is None else frames.of(model)
        self.links = {
            link.attributes.get("name", ""): frames.of(link)
            for link in model.all("link")
            if link.first("pose") is not None
        }


def _saved_state(path: Path, world: Element) -> dict[str, _State]:
    state = world.first("state")
    if state is None:
        return {}
    for child in state.children:
        if child.tag in ("insertions", "deletions"):
            raise WorldFileError(path, f"<{child.tag}>: cannot be taken over", child.line)
    return {one.attributes.get("name", ""): _State(path, one) for one in state.all("model")}


def _local(uri: str) -> str:
    """Return the path after `model://` or `file://`, which is looked up beside the file."""
    return uri.strip().partition("://")[2] or uri.strip()


def _check_floor(path: Path, shape: Element, placed: Placement) -> None:
    """Refuse a plane that is not the floor: level, facing up, at height 0."""
    element = shape.first("normal")
    normal = np.array([0.0, 0.0, 1.0] if element is None else numbers(path, element, 3))
    up = placed.R @ normal / np.linalg.norm(normal)
    if abs(up[2] - 1.0) > FLAT or abs(placed.position[2]) > FLAT:
        what = f"<plane>: at height {placed.position[2]:g} m, expected level at 0, as the floor"
        raise WorldFileError(path, what, shape.line)


def _child(path: Path, shape: Element, tag: str, count: int = 1) -> list[float]:
    child = shape.first(tag)
    if child is None:
        raise WorldFileError(path, f"<{shape.tag}>: expected <{tag}>", shape.line)
    return numbers(path, child, count)


def _box(path: Path, shape: Element) -> Part:
    half = [length / 2.0 for length in _child(path, shape, "size", 3)]
    return Part("box", tuple(half), (0.0, 0.0, 0.0))


def _round(path: Path, shape: Element) -> Part:
    """Return a cylinder or a capsule; `length` is that of the straight part."""
    (radius,), (length,) = _child(path, shape, "radius"), _child(path, shape, "length")
    kind = "cylinder" if shape.tag == "cylinder" else "capsule"
    return Part(kind, (radius, length / 2.0), (0.0, 0.0, 0.0))  # type: ignore[arg-type]


def _sphere(path: Path, shape: Element) -> Part:
    return Part("sphere", tuple(_child(path, shape, "radius")), (0.0, 0.0, 0.0))


def _ellipsoid(path: Path, shape: Element) -> Part:
    return Part("ellipsoid", tuple(_child(path, shape, "radii", 3)), (0.0, 0.0, 0.0))


SHAPES: dict[str, Callable[[Path, Element], Part]] = {
    "box": _box,
    "cylinder": _round,
    "capsule": _round,
    "sphere": _sphere,
    "ellipsoid": _ellipsoid,
}
"""Readers of a geometry as a part in its own frame, by element."""
