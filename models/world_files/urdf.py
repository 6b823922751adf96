"""URDF files as models of SDF: every link where the joints at zero place it.

Source: the URDF specification of ROS (wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

from pathlib import Path

from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.xml_tree import Element

MAX_LINKS = 5000


def as_model(path: Path, robot: Element) -> Element:
    """Return a `<robot>` as a `<model>`, its root link at the origin.

    Raises:
        WorldFileError: A xacro file, too many links, or a joint without its links.
    """
    if any(":" in child.tag for child in robot.children):
        raise WorldFileError(path, "a xacro file, expected what 'xacro FILE' writes", robot.line)
    links = list(robot.all("link"))
    if len(links) > MAX_LINKS:
        raise WorldFileError(path, f"{len(links)} links, expected at most {MAX_LINKS}")
    joints = {_link_of(path, joint, "child"): joint for joint in robot.all("joint")}
    fixed = all(joint.attributes.get("type") == "fixed" for joint in joints.values())
    children = [Element("static", {}, robot.line, str(int(fixed)))]
    for link in links:
        inner = [_shape(one) for one in link.children if one.tag in ("collision", "visual")]
        if (joint := joints.get(link.attributes.get("name", ""))) is not None:
            pose = _pose(joint)
            pose.attributes["relative_to"] = _link_of(path, joint, "parent")
            inner.append(pose)
        children.append(Element("link", dict(link.attributes), link.line, children=inner))
    return Element("model", dict(robot.attributes), robot.line, children=children)


def _shape(shape: Element) -> Element:
    """Return a collision or visual whose geometry holds its lengths as elements, not attributes."""
    geometry = Element("geometry", {}, shape.line)
    for child in (one for given in shape.all("geometry") for one in given.children):
        lengths = [
            Element("uri" if name == "filename" else name, {}, child.line, text)
            for name, text in child.attributes.items()
        ]
        geometry.children.append(Element(child.tag, {}, child.line, children=lengths))
    return Element(shape.tag, {}, shape.line, children=[_pose(shape), geometry])


def _pose(element: Element) -> Element:
    origin = element.first("origin") or Element("origin", {}, element.line)
    place, turn = (origin.attributes.get(key, "0 0 0") for key in ("xyz", "rpy"))
    return Element("pose", {}, origin.line, f"{place} {turn}")


def _link_of(path: Path, joint: Element, tag: str) -> str:
    child = joint.first(tag)
    if child is None or "link" not in child.attributes:
        raise WorldFileError(path, f"<joint>: expected <{tag} link=...>", joint.line)
    return child.attributes["link"]
