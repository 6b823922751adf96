"""PLY files: points, polygons and strips of triangles, in text or binary of either byte order.

Source: Turk, "The PLY Polygon File Format", 1994. Read here, since trimesh takes all lists of a
binary element to be as long as its first.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.reading import WorldFileError

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
"""NumPy's types by the two sets of names in use."""

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

LISTS = ("vertex_indices", "vertex_index")
"""Names of the list of vertices of a face or of a strip of triangles."""


class _Property(NamedTuple):
    """A value of an element, or a list of values after its length."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None = None


class _Element(NamedTuple):
    name: str
    number: int
    properties: list[_Property]


class Ply(NamedTuple):
    """Content of a PLY.

    Attributes:
        vertices: (n, 3) in the file's units.
        polygons: (k, sides) vertices of the faces of each number of sides.
        strips: Vertices of each strip of triangles.
    """

    vertices: NDArray[np.float64]
    polygons: list[NDArray[np.int64]]
    strips: list[NDArray[np.int64]]

    @property
    def triangles(self) -> NDArray[np.int64]:  # (m, 3)
        """All faces and strips as triangles."""
        from trimesh.geometry import triangulate_quads
        from trimesh.util import triangle_strips_to_faces

        found = [np.empty((0, 3), np.int64)]
        found += [triangulate_quads(alike).reshape(-1, 3) for alike in self.polygons]
        found += [triangle_strips_to_faces([strip]) for strip in self.strips if len(strip) > 2]
        return np.concatenate(found).astype(np.int64)


def read_ply(path: Path) -> Ply:
    """Read the vertices and surfaces of a PLY; other elements are passed over.

    Raises:
        WorldFileError: Naming what of its header cannot be read, or where it ends early.
    """
    data = path.read_bytes()
    elements, at, is_text = _header(path, data)
    if is_text:  # as if it were binary, each word a number of 64 bits
        try:
            data, at = np.array(data[at:].split(), np.float64).tobytes(), 0
        except ValueError:
            raise WorldFileError(path, "a word that is no number") from None
    vertices = np.empty((0, 3))
    lists: dict[str, list[NDArray[np.int64]]] = {}
    for element in elements:
        if any(one.length is not None for one in element.properties):
            lists[element.name], at = _lists(path, element, data, at)
            continue
        row = np.dtype([(one.name, one.kind) for one in element.properties])
        end = at + element.number * row.itemsize
        _check(path, element, data, end)
        if element.name == "vertex":
            if not {"x", "y", "z"} <= set(row.names or ()):
                raise WorldFileError(path, "vertices without x, y and z")
            rows = np.frombuffer(data, row, element.number, at)
            vertices = np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])
        at = end
    polygons = [alike for alike in lists.get("face", []) if alike.shape[1] > 2]
    strips = [piece for alike in lists.get("tristrips", []) for one in alike for piece in _cut(one)]
    return Ply(vertices, polygons, strips)


def _cut(strip: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the strips of a list in which -1 stands between two."""
    return [piece[piece >= 0] for piece in np.split(strip, np.flatnonzero(strip < 0))]


def _header(path: Path, data: bytes) -> tuple[list[_Element], int, bool]:
    """Return the elements, where the data begin, and whether they are text."""
    end = data.find(b"end_header")
    begin = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or not begin:
        raise WorldFileError(path, "no header of a PLY", 1)
    order, elements = None, list[_Element]()

    def kind(word: str) -> np.dtype[Any]:
        return np.dtype(f"{order}{TYPES[word]}" if order else np.float64)

    for number, line in enumerate(data[:end].decode("latin-1").splitlines(), 1):
        match line.split():
            case ["format", word, *_] if word in ORDERS:
                order = ORDERS[word]
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count), []))
            case ["property", "list", size, word, name] if {size, word} <= set(TYPES) and elements:
                elements[-1].properties.append(_Property(name, kind(word), kind(size)))
            case ["property", word, name] if word in TYPES and elements:
                elements[-1].properties.append(_Property(name, kind(word)))
            case ["ply" | "comment" | "obj_info", *_] | []:
                pass
            case _:
                raise WorldFileError(path, f"header: got '{line[:60]}'", number)
    if order is None:
        raise WorldFileError(path, f"header: no format (available: {', '.join(ORDERS)})")
    return elements, begin, not order


def _check(path: Path, element: _Element, data: bytes, end: int) -> None:
    if end > len(data):
        raise WorldFileError(path, f"ends within its {element.name} elements")


def _unpacker(kind: np.dtype[Any] | None) -> struct.Struct | None:
    return None if kind is None else struct.Struct(kind.str[0].replace("|", "<") + kind.char)


def _lists(
    path: Path, element: _Element, data: bytes, at: int
) -> tuple[list[NDArray[np.int64]], int]:
    """Return the lists of vertices of an element, those of each length (k, length) together.

    Also returns where the element ends.
    """
    begins: dict[int, list[int]] = {}
    kinds = [np.dtype(np.uint8)]
    kinds += [one.kind for one in element.properties if one.name in LISTS]
    plan = [(one.name in LISTS, one.kind.itemsize, _unpacker(one.length))
            for one in element.properties]  # fmt: skip
    for _ in range(element.number):
        for is_wanted, size, length in plan:
            count = 1
            if length is not None:
                _check(path, element, data, at + length.size)
                (given,) = length.unpack_from(data, at)
                if not 0 <= given < 2**31:
                    what = f"a list of its {element.name} elements of no length"
                    raise WorldFileError(path, what)
                count, at = int(given), at + length.size
            if is_wanted:
                begins.setdefault(count, []).append(at)
            at += count * size
        _check(path, element, data, at)
    raw = np.frombuffer(data, np.uint8)
    found = []
    for count, places in begins.items():
        cut = raw[np.add.outer(places, np.arange(count * kinds[-1].itemsize))]
        found.append(cut.view(kinds[-1]).astype(np.int64).reshape(len(places), count))
    return found, at
