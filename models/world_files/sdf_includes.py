"""Includes of SDF: a scope with the models that it includes written out in their place.

Written out, a model is a frame of its scope and holds its own frames, as any other model. Sources:
sdformat's `parser.cc` (what an include overrides) and its proposal "Model Composition": by `merge`
the elements of a model become its parent's, relative to a hidden frame.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from wayproof.models.world_files.locating import Locator
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf_frames import MERGED
from wayproof.models.world_files.sdf_shapes import Shapes
from wayproof.models.world_files.urdf import as_model
from wayproof.models.world_files.xml_tree import Element, read_xml

LIGHTS = ("sun",)
"""Models of Gazebo without anything solid."""

GROUND_MODELS = ("ground_plane",)
"""Models of Gazebo and Fuel that are a level plane at their origin."""

MAX_NESTED = 20
"""Maximum depth of includes; deeper ones are a cycle."""

MAX_INCLUDED = 2000
"""Maximum number of included files, counted at every mention."""

SHOWN = " shown"
"""Attribute with the name that an included model is known by; no file can hold it."""

OVERRIDES = ("pose", "static")
"""Children of an include that take the place of the model's own."""


class Includes:
    """The files that one world includes."""

    def __init__(self, locator: Locator, shapes: Shapes) -> None:
        """Begin with no file; what is not there is noted by the shapes."""
        self._locator, self._shapes = locator, shapes
        self._trees: dict[Path, Element] = {}
        self._count = 0

    def written_out(self, path: Path, scope: Element, depth: int = 0) -> Element:
        """Return a world or model whose includes, at any depth, are the models that they mean.

        Args:
            path: File of the scope; elements of another one say so.
            scope: The world or model.
            depth: Number of includes around it.

        Raises:
            WorldFileError: Naming the include that leads to no model, or to too many.
        """
        children: list[Element] = []
        for child in scope.children:
            if child.tag == "include":
                children += self._meant(path, child, scope.tag, depth)
            elif child.tag == "model":
                children.append(self.written_out(path, child, depth))
            else:
                children.append(child)
        return replace(scope, children=children)

    def _meant(self, path: Path, include: Element, within: str, depth: int) -> list[Element]:
        """Return the elements that stand for an include."""
        uri = include.first("uri")
        text = "" if uri is None else uri.text.strip()
        known, name = self._locator.name_of(text), include.first("name")
        given = "" if name is None else name.text.strip()
        if known in LIGHTS:
            return []
        file = self._locator.model(text) if text else None
        if file is None:
            if known not in GROUND_MODELS:
                self._shapes.missing("include", text, path, include.line)
            names = {"name": given or known, SHOWN: given or known}
            tag = "ground" if known in GROUND_MODELS else "absent"
            return [replace(include, tag=tag, attributes=include.attributes | names)]
        self._count += 1
        if depth >= MAX_NESTED or self._count > MAX_INCLUDED:
            what = f"<include>: more than {MAX_NESTED} deep, or {MAX_INCLUDED} in all"
            raise WorldFileError(path, what, include.line)
        if file not in self._trees:
            self._trees[file] = read_xml(file)
        merged = include.attributes.get("merge", "").strip() in ("1", "true")
        root = self._trees[file]
        inner = _top(file, root, merged and within == "world")
        if inner is None:
            if any(root.first(tag) is not None for tag in ("light", "actor")):
                return [_placed(include, one, file, given or one.attributes.get("name", known))
                        for one in root.all("actor")]  # fmt: skip
            what = "expected <sdf> with one <model>, <light> or <actor>"
            raise WorldFileError(file, what, 1)
        own = self.written_out(file, inner, depth + 1)
        own = _placed(include, own, file, given or inner.attributes.get("name", known))
        own.attributes[SHOWN] = given or known
        return _merged(own) if merged else [own]


def _top(file: Path, root: Element, may_be_world: bool) -> Element | None:
    """Return the model of a file; a robot of URDF as a model."""
    if root.tag == "robot":
        return as_model(file, root)
    world = root.first("world") if may_be_world else None
    return world or root.first("model")


def _placed(include: Element, model: Element, file: Path, name: str) -> Element:
    """Return a model or actor of a file with the name and what else its include overrides."""
    own = {tag: include.first(tag) for tag in OVERRIDES}
    children = [child for child in model.children if own.get(child.tag) is None]
    children += [child for child in own.values() if child is not None]
    attributes = model.attributes | {"name": name}
    if (frame := include.first("placement_frame")) is not None:
        attributes["placement_frame"] = frame.text.strip()
    return replace(model, attributes=attributes, children=children, file=file, line=include.line)


def _merged(model: Element) -> list[Element]:
    """Return the elements of a model or world for its parent, and the frame that they hang on."""
    name = f"_merged__{model.attributes['name']}__model__"
    frame = replace(model, tag=MERGED, attributes=model.attributes | {"name": name})
    taken = []
    for child in model.children:
        if child.tag in ("pose", "static"):
            continue
        child = _hung(child, name)
        if child.tag in ("link", "frame", "model", "actor", "ground", "absent", MERGED):
            child = _relative(child, name)
        taken.append(replace(child, file=child.file or model.file))
    return [frame, *taken]


def _hung(element: Element, frame: str) -> Element:
    """Return an element in which a frame takes the place of `__model__`."""
    named = {key: frame for key in ("relative_to", "attached_to")
             if element.attributes.get(key) in ("__model__", "world")}  # fmt: skip
    inner = element.children
    if element.tag not in ("model", MERGED):
        inner = [_hung(child, frame) for child in inner]
    elif (pose := element.first("pose")) is not None:
        inner = [_hung(child, frame) if child is pose else child for child in inner]
    return replace(element, attributes=element.attributes | named, children=inner)


def _relative(element: Element, frame: str) -> Element:
    """Return an element whose pose is relative to a frame if it names no other."""
    pose = element.first("pose") or Element("pose", {}, element.line)
    if pose.attributes.get("relative_to") or element.attributes.get("attached_to"):
        return element
    moved = replace(pose, attributes=pose.attributes | {"relative_to": frame})
    return replace(element, children=[moved, *(one for one in element.children if one is not pose)])
