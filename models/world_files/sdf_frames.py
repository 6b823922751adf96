"""Poses in SDF, each relative to a frame, and frames relative to one another."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import rotation_of, turned_by
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.xml_tree import Element

MERGED = "merged"
"""Tag of a model whose elements are its parent's: it is a frame alone."""

MODELS = ("model", MERGED)

FRAME_ELEMENTS = ("link", "frame", "joint", "ground", "absent", *MODELS)
"""Elements whose name is a frame of the model or world that holds them."""

MAX_CHAIN = 200
"""Maximum number of frames from one to the scope that holds them all."""

MAX_NAMED = 5
"""Number of frames that a refusal names."""


@dataclass(frozen=True)
class Placement:
    """T_outer_inner.

    Attributes:
        position: (3,) m.
        R: (3, 3).
    """

    position: NDArray[np.float64]
    R: NDArray[np.float64]

    def __matmul__(self, inner: Placement) -> Placement:
        """Compose poses: return the inner frame's inner frame in the outer frame."""
        return Placement(self.position + self.R @ inner.position, self.R @ inner.R)

    def inverse(self) -> Placement:
        """Return T_inner_outer."""
        return Placement(-self.R.T @ self.position, self.R.T)


ORIGIN = Placement(np.zeros(3), np.eye(3))


def numbers(path: Path, element: Element, count: int) -> list[float]:
    """Return the finite numbers that an element holds.

    Raises:
        WorldFileError: It holds something else, or not so many.
    """
    try:
        values = [float(word) for word in element.text.split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        got, expected = element.text.strip()[:60], f"{count} numbers" if count > 1 else "a number"
        raise WorldFileError(
            path, f"<{element.tag}>: got '{got}', expected {expected}", element.line
        )
    return values


class Frames:
    """The frames of one model or of the world."""

    def __init__(self, path: Path, scope: Element) -> None:
        """Collect the frames; each pose is read when it is first needed."""
        self._path = path
        self._framed = {
            child.attributes["name"]: child
            for child in scope.children
            if child.tag in FRAME_ELEMENTS and "name" in child.attributes
        }
        self._scope = scope
        self._known: dict[str, Placement] = {"": ORIGIN, "world": ORIGIN, "__model__": ORIGIN}
        self._open: list[str] = []

    def of(self, element: Element) -> Placement:
        """Return the pose of an element of this scope in it.

        Raises:
            WorldFileError: No such frame, a circle of frames, or no pose of six numbers.
        """
        attached = element.attributes.get("attached_to", "")
        if element.tag == "joint" and (child := element.first("child")) is not None:
            attached = child.text.strip()  # a joint's pose is in its child's frame
        pose = element.first("pose")
        if pose is None:
            return self._named(attached, element)
        relative = pose.attributes.get("relative_to") or pose.attributes.get("frame") or attached
        return self._named(relative, pose) @ self._read(pose)

    def placed(self, element: Element, default: Placement, inner: Frames | None) -> Placement:
        """Return the pose of a model or include of this scope, its placement frame observed.

        Args:
            element: The model or include.
            default: Its pose where it gives none: of an include, the model's own.
            inner: Frames within the model; one may be the placement frame.

        Raises:
            WorldFileError: As `of`; or no such placement frame.
        """
        own = element.first("placement_frame")
        name = element.attributes.get("placement_frame", "") if own is None else own.text.strip()
        at = default if element.first("pose") is None and not name else self.of(element)
        if not name or inner is None:
            return at
        return at @ inner._named(name, element).inverse()

    def _named(self, name: str, user: Element) -> Placement:
        if name in self._known:
            return self._known[name]
        head, _, rest = name.partition("::")
        element = self._framed.get(head if rest else name)
        if element is None or (rest and element.tag not in MODELS):
            what = f"<{user.tag}>: no frame '{name}' (available: {', '.join(self._framed)})"
            raise WorldFileError(user.file or self._path, what[:200], user.line)
        if name in self._open or len(self._open) >= MAX_CHAIN:
            circle = " -> ".join([*self._open[:MAX_NAMED], name])
            what = f"frames in a circle, or more than {MAX_CHAIN} deep: {circle}"
            raise WorldFileError(self._path, what, user.line)
        self._open.append(name)
        if element.tag in MODELS:
            within = Frames(element.file or self._path, element)
            self._known[name] = self.placed(element, ORIGIN, within) @ within._named(rest, user)
        else:
            self._known[name] = self.of(element)
        self._open.pop()
        return self._known[name]

    def _read(self, pose: Element) -> Placement:
        if not pose.text.strip():
            return ORIGIN
        if pose.attributes.get("rotation_format") == "quat_xyzw":
            x, y, z, qx, qy, qz, qw = numbers(self._path, pose, 7)
            if not qx * qx + qy * qy + qz * qz + qw * qw > 0.0:
                raise WorldFileError(self._path, "<pose>: a quaternion of length 0", pose.line)
            return Placement(np.array([x, y, z]), rotation_of((qw, qx, qy, qz)))
        values = numbers(self._path, pose, 6)
        angles = values[3:]
        if pose.attributes.get("degrees") in ("true", "1"):
            angles = np.radians(angles).tolist()
        return Placement(np.array(values[:3]), turned_by(*angles))
