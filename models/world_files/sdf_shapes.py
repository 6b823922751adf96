"""Geometries of SDF and URDF as parts, and notes on those that are not taken over."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.heights import height_part
from wayproof.models.world_files.images import read_elevation
from wayproof.models.world_files.locating import Locator
from wayproof.models.world_files.mesh_files import EXTRA
from wayproof.models.world_files.meshes import Cuts, mesh_parts
from wayproof.models.world_files.options import Found, ImportOptions, Plane
from wayproof.models.world_files.parts import Mesh, Part, axes_of
from wayproof.models.world_files.polygons import prisms
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf_frames import Placement, numbers
from wayproof.models.world_files.xml_tree import Element
from wayproof.models.worlds.solids import FRICTION

CONE_SIDES = 32
"""Sides of the pyramid in place of a cone, within it."""

NOTED_PLACES = 3
"""Number of lines named for something that is missing often."""


class Shapes:
    """Reader of collision shapes, with its notes on a whole file."""

    def __init__(self, found: Found, options: ImportOptions, locator: Locator) -> None:
        """Begin with a file.

        Args:
            found: Takes planes, notes and what is missing.
            options: Options of the import.
            locator: Finds meshes and images.
        """
        self._found, self._options, self._locator = found, options, locator
        self._missing: dict[tuple[str, str], list[str]] = {}
        self._untouched: Counter[str] = Counter()
        self._changed: Counter[str] = Counter()
        self._meshes: dict[tuple[object, ...], list[Part]] = {}
        self._cuts = Cuts()
        self._drawn: dict[str, list[tuple[str, int]]] = {}

    def solid_in(self, link: Element, model: str) -> list[Element]:
        """Return a link's collisions; of one with visuals only, those if they are to be solid.

        `finish` notes a link with visuals only either way.
        """
        shapes, visuals = list(link.all("collision")), list(link.all("visual"))
        for shape in shapes:
            self._changed[f"collisions of another friction: {FRICTION:g} here"] += _differs(
                _inner(shape, "surface", "friction", "ode", "mu"), FRICTION
            )
        for visual in visuals:
            self._changed["transparent visuals: opaque here, also to beams"] += _differs(
                _inner(visual, "transparency"), 0.0
            )
        if shapes or not visuals:
            return shapes
        self._drawn.setdefault(model, []).append((link.attributes.get("name", ""), link.line))
        return visuals if self._options.visuals else []

    def parts(
        self, path: Path, shape: Element, placed: Placement, model: str, scale: NDArray[np.float64]
    ) -> Iterator[Part]:
        """Return the parts of a `<collision>` or `<visual>`, in its own frame.

        Args:
            path: File of the element, for messages and for what it names.
            shape: The element.
            placed: T_world_shape, for planes.
            model: Name of its model.
            scale: (3,) factors that a saved state gives to the model.

        Raises:
            WorldFileError: A geometry that cannot be taken over, naming its line.
        """
        geometry = shape.first("geometry")
        children = [] if geometry is None else geometry.children
        outlines = [child for child in children if child.tag == "polyline"]
        if not children or (len(children) > 1 and len(outlines) < len(children)):
            raise WorldFileError(path, f"<{shape.tag}>: expected one geometry", shape.line)
        if shape.tag == "collision" and (why := _untouchable(shape)):
            self._untouched[why] += 1
            if not self._options.visuals:
                return
        if outlines:
            yield from _polylines(path, outlines, scale)
            return
        yield from self._geometry(path, children[0], placed, model, scale)

    def _geometry(
        self, path: Path, shape: Element, placed: Placement, model: str, scale: NDArray[np.float64]
    ) -> Iterator[Part]:
        """Return the parts of one geometry, in its own frame; arguments as for `parts`."""
        try:
            if shape.tag == "empty":
                return
            if shape.tag == "plane":
                self._plane(path, shape, placed, model)
            elif shape.tag == "mesh":
                yield from self._mesh(path, shape, scale)
            elif shape.tag == "heightmap":
                yield from self._heightmap(path, shape)
            elif shape.tag in SHAPES:
                yield from SHAPES[shape.tag](path, shape, scale)
            elif shape.tag == "image":
                self._found.notes.append(f"<image> (line {shape.line}): left out")
            else:
                known = ", ".join([*SHAPES, "polyline", "mesh", "heightmap", "plane", "empty"])
                what = f"<{shape.tag}>: cannot be taken over (available: {known})"
                raise WorldFileError(path, what, shape.line)
        except WorldFileError:
            raise
        except ValueError as error:
            raise WorldFileError(path, f"<{shape.tag}>: {error}", shape.line) from None

    def ground(self, placed: Placement, model: str) -> None:
        """Add the level plane of a known ground model."""
        self._found.planes.append(Plane(placed.position, placed.R[:, 2], None, model))

    def missing(self, tag: str, name: str, path: Path, line: int) -> None:
        """Note a model or file that is not there, if that is allowed.

        Raises:
            WorldFileError: It is not.
        """
        if not self._options.skip_missing:
            what = "model" if tag == "include" else "file"
            bare = name.removeprefix("model://")
            text = f"<{tag}>: no {what} '{bare}'; expected --model-path with its folder, "
            raise WorldFileError(path, text + "or --skip-missing to go without", line)
        self._missing.setdefault((tag, name), []).append(f"{path.name}:{line}")

    def finish(self) -> None:
        """Write the notes on parts that were left out."""
        taken = "made solid" if self._options.visuals else "left out; --visuals makes them solid"
        for model, links in self._drawn.items():
            name, line = links[0]
            more = f" and {len(links) - 1} more links" if len(links) > 1 else ""
            self._found.notes.append(
                f"link '{f'{model} {name}'.strip()}' (line {line}){more}: visuals only, {taken}"
            )
        for (tag, name), places in self._missing.items():
            rest = len(places) - NOTED_PLACES
            where = ", ".join(places[:NOTED_PLACES]) + (f" and {rest} more" if rest > 0 else "")
            self._found.notes.append(
                f"<{tag}> '{name}' ({where}): not there, left out; --model-path with its folder"
            )
        for why, count in self._untouched.items():
            self._found.notes.append(f"{count} collisions with {why}: {taken}")
        self._found.notes += [f"{count} {what}" for what, count in self._changed.items() if count]

    def _plane(self, path: Path, shape: Element, placed: Placement, model: str) -> None:
        element = shape.first("normal")
        normal = np.array([0.0, 0.0, 1.0] if element is None else numbers(path, element, 3))
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            raise WorldFileError(path, "<normal>: got 0 0 0, expected a direction", shape.line)
        size = shape.first("size")
        half = None
        if size is not None:
            x, y = (value / 2.0 for value in numbers(path, size, 2))
            half = (x, y)
        axes = None if half is None else placed.R @ axes_of(normal / length)
        plane = Plane(placed.position, placed.R @ (normal / length), half, model, axes)
        self._found.planes.append(plane)

    def _mesh(self, path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
        uri = shape.first("uri")
        if uri is None or not uri.text.strip():
            raise WorldFileError(path, "<mesh>: expected a <uri>", shape.line)
        file = self._locator.file(uri.text, path)
        if file is None:
            self.missing("mesh", uri.text.strip(), path, uri.line)
            return []
        element = shape.first("scale")
        own = np.array([1.0] * 3 if element is None else numbers(path, element, 3))
        name, centred = None, False
        if (submesh := shape.first("submesh")) is not None:
            named, centre = submesh.first("name"), submesh.first("center")
            name = submesh.text.strip() if named is None else named.text.strip()
            centred = centre is not None and centre.text.strip() in ("1", "true")
        key = (file, *(own * scale).tolist(), name, centred)
        if key not in self._meshes:  # read once for each scale and submesh
            self._meshes[key] = mesh_parts(
                file, own * scale, self._found.notes, cuts=self._cuts, submesh=name,
                centred=centred,
            )  # fmt: skip
        return self._meshes[key]

    def _heightmap(self, path: Path, shape: Element) -> Iterator[Part]:
        """Return the field of an image, which spans `<size>` about `<pos>`, black at the bottom."""
        uri = shape.first("uri")
        if uri is None:
            raise WorldFileError(path, "<heightmap>: expected a <uri>", shape.line)
        file = self._locator.file(uri.text, path)
        if file is None:
            self.missing("heightmap", uri.text.strip(), path, uri.line)
            return
        size, pos = shape.first("size"), shape.first("pos")
        x, y, z = [1.0] * 3 if size is None else numbers(path, size, 3)
        heights, metric = read_elevation(file)
        if metric and size is None:
            x, y = float(heights.shape[1] - 1), float(heights.shape[0] - 1)
        elif not metric:
            scale = z / max(float(heights.max()), 1e-300)
            if not math.isfinite(scale):
                raise WorldFileError(path, f"<heightmap>: no field is {z:g} m high", shape.line)
            heights = heights * scale
        centre = [0.0] * 3 if pos is None else numbers(path, pos, 3)
        yield height_part(file, heights[::-1], (x, y), centre)


def _untouchable(shape: Element) -> str:
    """Return why no body meets a collision; empty if one does."""
    if _inner(shape, "surface", "contact", "collide_without_contact") in ("1", "true"):
        return "collide_without_contact"
    try:
        bits = int(_inner(shape, "surface", "contact", "collide_bitmask") or "1", 0)
    except ValueError:
        return ""
    return "" if bits & 0xFFFF else "collide_bitmask 0"


def _differs(text: str, value: float) -> bool:
    """Return whether a text is a number, and another one."""
    try:
        return abs(float(text) - value) > 1e-9
    except ValueError:
        return False


def _inner(element: Element, *tags: str) -> str:
    """Return the text of the element that tags lead to from another; empty without it."""
    found: Element | None = element
    for tag in tags:
        found = None if found is None else found.first(tag)
    return "" if found is None else found.text.strip()


def _child(path: Path, shape: Element, tag: str, count: int = 1) -> list[float]:
    child = shape.first(tag)
    if child is None:
        raise WorldFileError(path, f"<{shape.tag}>: expected <{tag}>", shape.line)
    return numbers(path, child, count)


def _box(path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
    half = [n * k / 2.0 for n, k in zip(_child(path, shape, "size", 3), scale, strict=True)]
    return [Part("box", tuple(map(float, half)), (0.0, 0.0, 0.0))]


def _round(path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
    """Return a cylinder or a capsule; `length` is that of the straight part."""
    (radius,), (length,) = _child(path, shape, "radius"), _child(path, shape, "length")
    kind = "cylinder" if shape.tag == "cylinder" else "capsule"
    size = (radius * float(scale[0]), length * float(scale[2]) / 2.0)
    return [Part(kind, size, (0.0, 0.0, 0.0))]  # type: ignore[arg-type]


def _sphere(path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
    (radius,) = _child(path, shape, "radius")
    return [Part("sphere", (radius * float(scale[0]),), (0.0, 0.0, 0.0))]


def _ellipsoid(path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
    radii = np.array(_child(path, shape, "radii", 3)) * scale
    return [Part("ellipsoid", tuple(radii.tolist()), (0.0, 0.0, 0.0))]


def _cone(path: Path, shape: Element, scale: NDArray[np.float64]) -> list[Part]:
    """Return the pyramid within a cone, which stands on its base, its middle at the origin."""
    (radius,), (length,) = _child(path, shape, "radius"), _child(path, shape, "length")
    if not (radius > 0.0 and length > 0.0):
        raise WorldFileError(path, "<cone>: expected positive lengths", shape.line)
    around = np.linspace(0.0, 2.0 * np.pi, CONE_SIDES, endpoint=False)
    rim = np.column_stack([radius * np.cos(around), radius * np.sin(around)])
    base = np.column_stack([rim, np.full(CONE_SIDES, -length / 2.0)])
    vertices = np.vstack([base, [0.0, 0.0, -length / 2.0], [0.0, 0.0, length / 2.0]]) * scale
    n = np.arange(CONE_SIDES)
    after = (n + 1) % CONE_SIDES
    faces = np.vstack([
        np.column_stack([after, n, np.full(CONE_SIDES, CONE_SIDES)]),
        np.column_stack([n, after, np.full(CONE_SIDES, CONE_SIDES + 1)]),
    ])  # fmt: skip
    return [Part("mesh", (), (0.0, 0.0, 0.0), mesh=Mesh(vertices, faces))]


def _polylines(path: Path, shapes: Sequence[Element], scale: NDArray[np.float64]) -> Iterator[Part]:
    """Yield the prisms of outlines that rise from z = 0 to `<height>`; inner ones are holes."""
    rises = {_rise(path, shape) for shape in shapes}
    if len(rises) > 1:
        what = f"<polyline>: outlines of {len(rises)} heights in one geometry, expected one"
        raise WorldFileError(path, what, shapes[0].line)
    outlines = [_outline(path, shape) * scale[:2] for shape in shapes]
    try:
        meshes = prisms(outlines, rises.pop() * float(scale[2]))
    except ImportError:
        what = f"<polyline>: needs shapely: {EXTRA}"
        raise WorldFileError(path, what, shapes[0].line) from None
    except ValueError as error:
        raise WorldFileError(path, f"<polyline>: {error}", shapes[0].line) from None
    yield from (Part("mesh", (), (0.0, 0.0, 0.0), mesh=mesh) for mesh in meshes)


def _outline(path: Path, shape: Element) -> NDArray[np.float64]:  # (n, 2)
    points = [numbers(path, point, 2) for point in shape.all("point")]
    return np.array(points, np.float64).reshape(-1, 2)


def _rise(path: Path, shape: Element) -> float:
    height = shape.first("height")
    rise = 1.0 if height is None else numbers(path, height, 1)[0]
    if not rise > 0.0:
        raise WorldFileError(path, "<height>: expected a positive number", shape.line)
    return rise


SHAPES: dict[str, Callable[[Path, Element, NDArray[np.float64]], list[Part]]] = {
    "box": _box,
    "cylinder": _round,
    "capsule": _round,
    "sphere": _sphere,
    "ellipsoid": _ellipsoid,
    "cone": _cone,
}
"""Readers of a geometry as parts in its own frame, by element."""
