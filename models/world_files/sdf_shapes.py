"""Geometries of SDF and URDF as parts, and notes on those that are not taken over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.heights import height_part
from wayproof.models.world_files.hulls import hull, prisms
from wayproof.models.world_files.images import read_elevation
from wayproof.models.world_files.locating import Locator
from wayproof.models.world_files.mesh_files import EXTRA
from wayproof.models.world_files.meshes import mesh_parts
from wayproof.models.world_files.options import Found, ImportOptions, Plane
from wayproof.models.world_files.parts import Mesh, Part, axes_of
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.sdf_frames import Placement, numbers
from wayproof.models.world_files.xml_tree import Element
from wayproof.models.worlds.solids import FRICTION

CONE_SIDES = 32
"""Sides of the pyramid in place of a cone, within it."""

NOTED_PLACES = 3
"""Number of places that a note names."""

ORIGIN = (0.0, 0.0, 0.0)

Scale = NDArray[np.float64]
"""(3,) factors that a saved state gives to a model."""


class Shapes:
    """Reader of collision shapes, with its notes on a whole file."""

    def __init__(self, found: Found, options: ImportOptions, locator: Locator) -> None:
        """Begin with a file.

        Args:
            found: Takes planes and notes.
            options: Options of the import.
            locator: Finds meshes and images.
        """
        self._found, self._options, self._locator = found, options, locator
        self._said: dict[str, list[str]] = {}
        self._meshes: dict[tuple[object, ...], list[Part]] = {}
        self._taken = "made solid" if options.visuals else "left out; --visuals makes them solid"

    def say(self, what: str, place: str = "") -> None:
        """Note something that may be so at many places; `finish` writes one line."""
        self._said.setdefault(what, []).append(place)

    def finish(self) -> None:
        """Write the notes, each with its count and its first places."""
        for what, places in self._said.items():
            named = list(dict.fromkeys(filter(None, places)))
            rest = len(named) - NOTED_PLACES
            listed = ", ".join(named[:NOTED_PLACES]) + (f" and {rest} more" if rest > 0 else "")
            self._found.notes.append(f"{len(places)} {what}" + (f" ({listed})" if named else ""))

    def solid_in(self, link: Element, model: str) -> list[Element]:
        """Return a link's collisions; of one with visuals only, those if they are to be solid."""
        shapes, visuals = list(link.all("collision")), list(link.all("visual"))
        for shape in shapes:
            if _differs(shape.text_of("surface", "friction", "ode", "mu"), FRICTION):
                self.say(f"collisions of another friction: {FRICTION:g} here")
        for visual in visuals:
            if _differs(visual.text_of("transparency"), 0.0):
                self.say("transparent visuals: opaque here, also to beams")
        if shapes or not visuals:
            return shapes
        name = f"{model} {link.attributes.get('name', '')}".strip()
        self.say(f"links with visuals only: {self._taken}", f"'{name}' in line {link.line}")
        return visuals if self._options.visuals else []

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
        what = f"<{tag}> of '{name}', not there: left out; --model-path with its folder"
        self.say(what, f"{path.name}:{line}")

    def parts(
        self, path: Path, shape: Element, placed: Placement, model: str, scale: Scale
    ) -> Iterator[Part]:
        """Return the parts of a `<collision>` or `<visual>`, in its own frame.

        Args:
            path: File of the element, for messages and for what it names.
            shape: The element.
            placed: T_world_shape, for planes.
            model: Name of its model.
            scale: Factors of the model.

        Raises:
            WorldFileError: A geometry that cannot be taken over, naming its line.
        """
        geometry = shape.first("geometry")
        children = [] if geometry is None else geometry.children
        tags = {child.tag for child in children}
        if len(tags) != 1 or (len(children) > 1 and tags != {"polyline"}):
            raise WorldFileError(path, f"<{shape.tag}>: expected one geometry", shape.line)
        if shape.tag == "collision" and (why := _untouchable(shape)):
            self.say(f"collisions with {why}: {self._taken}")
            if not self._options.visuals:
                return
        one = children[0]
        try:
            match one.tag:
                case "empty":
                    pass
                case "image":
                    self.say("<image>: left out", f"line {one.line}")
                case "plane":
                    self._plane(path, one, placed, model)
                case "mesh":
                    yield from self._mesh(path, one, scale)
                case "heightmap":
                    yield from self._heightmap(path, one)
                case "polyline":
                    yield from map(_mesh_part, _polylines(path, children, scale))
                case _:
                    yield _primitive(path, one, scale)
        except WorldFileError:
            raise
        except ImportError as error:
            raise WorldFileError(path, f"<{one.tag}>: needs {error.name}: {EXTRA}") from None
        except ValueError as error:
            raise WorldFileError(path, f"<{one.tag}>: {error}", one.line) from None

    def _plane(self, path: Path, shape: Element, placed: Placement, model: str) -> None:
        normal = np.array(_given(path, shape, "normal", 3, (0.0, 0.0, 1.0)))
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            raise WorldFileError(path, "<normal>: got 0 0 0, expected a direction", shape.line)
        normal, half, axes = normal / length, None, None
        if shape.first("size") is not None:
            x, y = _given(path, shape, "size", 2)
            half, axes = (x / 2.0, y / 2.0), placed.R @ axes_of(normal)
        self._found.planes.append(Plane(placed.position, placed.R @ normal, half, model, axes))

    def _file(self, path: Path, shape: Element) -> Path | None:
        """Return the file that a mesh or heightmap names; None if it may be missing, and is."""
        uri = shape.first("uri")
        if uri is None or not uri.text.strip():
            raise WorldFileError(path, f"<{shape.tag}>: expected a <uri>", shape.line)
        file = self._locator.file(uri.text, path)
        if file is None:
            self.missing(shape.tag, uri.text.strip(), path, uri.line)
        return file

    def _mesh(self, path: Path, shape: Element, scale: Scale) -> list[Part]:
        if (file := self._file(path, shape)) is None:
            return []
        own = np.array(_given(path, shape, "scale", 3, (1.0, 1.0, 1.0))) * scale
        submesh, centred = None, False
        if (element := shape.first("submesh")) is not None:
            submesh = element.text_of("name") or element.text.strip()
            centred = element.text_of("center") in ("1", "true")
        key = (file, *own.tolist(), submesh, centred)
        if key not in self._meshes:  # read once for each scale and submesh
            notes = self._found.notes
            self._meshes[key] = mesh_parts(file, own, notes, submesh=submesh, centred=centred)
        return self._meshes[key]

    def _heightmap(self, path: Path, shape: Element) -> Iterator[Part]:
        """Return the field of an image, which spans `<size>` about `<pos>`, black at the bottom."""
        if (file := self._file(path, shape)) is None:
            return
        x, y, z = _given(path, shape, "size", 3, (1.0, 1.0, 1.0))
        heights, metric = read_elevation(file)
        if metric and shape.first("size") is None:
            x, y = float(heights.shape[1] - 1), float(heights.shape[0] - 1)
        elif not metric:
            scale = z / max(float(heights.max()), 1e-300)
            if not math.isfinite(scale):
                raise WorldFileError(path, f"<heightmap>: no field is {z:g} m high", shape.line)
            heights = heights * scale
        yield height_part(file, heights[::-1], (x, y), _given(path, shape, "pos", 3, ORIGIN))


def _untouchable(shape: Element) -> str:
    """Return why no body meets a collision; empty if one does."""
    if shape.text_of("surface", "contact", "collide_without_contact") in ("1", "true"):
        return "collide_without_contact"
    try:
        bits = int(shape.text_of("surface", "contact", "collide_bitmask") or "1", 0)
    except ValueError:
        return ""
    return "" if bits & 0xFFFF else "collide_bitmask 0"


def _differs(text: str, value: float) -> bool:
    """Return whether a text is a number, and another one."""
    try:
        return abs(float(text) - value) > 1e-9
    except ValueError:
        return False


def _given(
    path: Path, shape: Element, tag: str, count: int = 1, default: Sequence[float] | None = None
) -> Sequence[float]:
    """Return the numbers of a child, or the default without one."""
    child = shape.first(tag)
    if child is not None:
        return numbers(path, child, count)
    if default is None:
        raise WorldFileError(path, f"<{shape.tag}>: expected <{tag}>", shape.line)
    return default


def _mesh_part(mesh: Mesh) -> Part:
    return Part("mesh", (), ORIGIN, mesh=mesh)


def _primitive(path: Path, shape: Element, scale: Scale) -> Part:
    """Return a shape that its lengths describe; of a capsule, that of the straight part."""

    def length(tag: str) -> float:
        return float(_given(path, shape, tag)[0])

    x, _, z = scale.tolist()
    match shape.tag:
        case "box":
            half = np.array(_given(path, shape, "size", 3)) * scale / 2.0
            return Part("box", tuple(half.tolist()), ORIGIN)
        case "sphere":
            return Part("sphere", (length("radius") * x,), ORIGIN)
        case "cylinder":
            return Part("cylinder", (length("radius") * x, length("length") * z / 2.0), ORIGIN)
        case "capsule":
            return Part("capsule", (length("radius") * x, length("length") * z / 2.0), ORIGIN)
        case "ellipsoid":
            radii = np.array(_given(path, shape, "radii", 3)) * scale
            return Part("ellipsoid", tuple(radii.tolist()), ORIGIN)
        case "cone":  # the pyramid within it, which stands on its base, its middle at the origin
            size = Part("cylinder", (length("radius"), length("length") / 2.0), ORIGIN).size
            around = np.linspace(0.0, 2.0 * np.pi, CONE_SIDES, endpoint=False)
            rim = size[0] * np.cos(around), size[0] * np.sin(around), np.full(CONE_SIDES, -size[1])
            pyramid = hull(np.vstack([np.column_stack(rim), [0.0, 0.0, size[1]]]) * scale)
            assert pyramid is not None
            return _mesh_part(pyramid)
    known = "box, cylinder, capsule, sphere, ellipsoid, cone, polyline, mesh, heightmap, plane"
    what = f"<{shape.tag}>: cannot be taken over (available: {known}, empty)"
    raise WorldFileError(path, what, shape.line)


def _polylines(path: Path, shapes: Sequence[Element], scale: Scale) -> list[Mesh]:
    """Return the prisms of outlines that rise from z = 0 to `<height>`; inner ones are holes."""
    rises = {float(_given(path, shape, "height", 1, (1.0,))[0]) for shape in shapes}
    if len(rises) > 1:
        raise ValueError(f"outlines of {len(rises)} heights in one geometry, expected one")
    if not min(rises) > 0.0:
        raise WorldFileError(path, "<height>: expected a positive number", shapes[0].line)
    outlines = [
        np.array([numbers(path, point, 2) for point in shape.all("point")]).reshape(-1, 2)
        for shape in shapes
    ]
    return prisms([outline * scale[:2] for outline in outlines], rises.pop() * float(scale[2]))
