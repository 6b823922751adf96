"""URDF files: the collision shapes of every link, all joints at zero.

Source: the URDF specification of ROS (wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wayproof.models.world_files.locating import Locator
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part, moved, turned_by
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf_frames import ORIGIN, Placement
from wayproof.models.world_files.sdf_shapes import Shapes
from wayproof.models.world_files.xml_tree import Element, read_xml

MAX_LINKS = 5000

LENGTHS = {
    "box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"),
    "sphere": ("radius",),
}  # fmt: skip
"""Attributes with the lengths of a geometry, by element."""


def read_urdf(path: Path, options: ImportOptions) -> Found:
    """Read every collision shape of a robot description, its root link at the origin.

    Raises:
        WorldFileError: Naming the element and its line that cannot be taken over.
    """
    root = read_xml(path)
    if root.tag != "robot":
        raise WorldFileError(path, f"<{root.tag}>: expected <robot>", 1)
    found = Found()
    shapes = Shapes(found, options, Locator(path, options.model_paths))
    found.parts = [part for part, _ in read_links(path, root, shapes)]
    joints = sum(joint.attributes.get("type") != "fixed" for joint in root.all("joint"))
    if joints:
        found.notes.append(f"{joints} joints: everything stands still here")
    shapes.finish()
    return found


def read_links(path: Path, root: Element, shapes: Shapes) -> Iterator[tuple[Part, Element]]:
    """Return the parts of every link in the root link's frame, and the element of each.

    Raises:
        WorldFileError: As `read_urdf`.
    """
    if any(":" in child.tag for child in root.children):
        raise WorldFileError(path, "a xacro file, expected what 'xacro FILE' writes", root.line)
    joints = {_named(path, joint, "child", "link"): joint for joint in root.all("joint")}
    known: dict[str, Placement] = {}
    links = list(root.all("link"))
    if len(links) > MAX_LINKS:
        raise WorldFileError(path, f"{len(links)} links, expected at most {MAX_LINKS}")
    for link in links:
        name = link.attributes.get("name", "")
        at = _placed(path, name, joints, known)
        for collision in shapes.solid_in(link, ""):
            geometry = collision.first("geometry")
            if geometry is None or len(geometry.children) != 1:
                raise WorldFileError(path, "<collision>: expected one geometry", collision.line)
            own = at @ _origin(path, collision)
            for part in _shape(path, geometry.children[0], shapes):
                yield moved(part, own.position, own.R), collision


def _placed(
    path: Path, link: str, joints: dict[str, Element], known: dict[str, Placement]
) -> Placement:
    """Return T_root_link along the joints above it."""
    chain: list[str] = []
    while link in joints and link not in known:
        if link in chain:
            raise WorldFileError(path, f"joints in a circle at link '{link}'", joints[link].line)
        chain.append(link)
        link = _named(path, joints[link], "parent", "link")
    at = known.get(link, ORIGIN)
    for name in reversed(chain):
        at = at @ _origin(path, joints[name])
        known[name] = at
    return at


def _shape(path: Path, shape: Element, shapes: Shapes) -> list[Part]:
    if shape.tag == "mesh":
        named = Element("uri", {}, shape.line, shape.attributes.get("filename", ""))
        scale = Element("scale", {}, shape.line, shape.attributes.get("scale", "1 1 1"))
        element = Element("mesh", {}, shape.line, children=[named, scale])
    elif shape.tag in LENGTHS:
        inner = [
            Element(name, {}, shape.line, shape.attributes.get(name, ""))
            for name in LENGTHS[shape.tag]
        ]
        element = Element(shape.tag, {}, shape.line, children=inner)
    else:
        known = ", ".join([*LENGTHS, "mesh"])
        what = f"<{shape.tag}>: cannot be taken over (available: {known})"
        raise WorldFileError(path, what, shape.line)
    return list(shapes.geometry(path, element, ORIGIN, "", np.ones(3)))


def _origin(path: Path, element: Element) -> Placement:
    origin = element.first("origin")
    if origin is None:
        return ORIGIN
    position = _triple(path, origin, "xyz")
    return Placement(np.array(position), turned_by(*_triple(path, origin, "rpy")))


def _triple(path: Path, element: Element, key: str) -> tuple[float, float, float]:
    text = element.attributes.get(key, "0 0 0")
    try:
        x, y, z = (float(word) for word in text.split())
    except ValueError:
        x = y = z = float("nan")
    if not np.isfinite([x, y, z]).all():
        what = f"<{element.tag}>: {key} '{text[:40]}', expected 3 numbers"
        raise WorldFileError(path, what, element.line)
    return x, y, z


def _named(path: Path, element: Element, tag: str, key: str) -> str:
    child = element.first(tag)
    if child is None or key not in child.attributes:
        raise WorldFileError(path, f"<{element.tag}>: expected <{tag} {key}=...>", element.line)
    return child.attributes[key]
