"""PLY files: points, polygons and strips of triangles, in text or binary of either byte order.

Source: Turk, "The PLY Polygon File Format", 1994. Read here, since trimesh takes all lists of a
binary element to be as long as its first.
"""

from __future__ import annotations

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

Property = tuple[str, np.dtype[Any], np.dtype[Any] | None]
"""Name and type of a value, and of a list of values that of its length."""

Lists = list[NDArray[np.int64]]


class Ply(NamedTuple):
    """Content of a PLY.

    Attributes:
        vertices: (n, 3) in the file's units.
        polygons: Vertices of each face.
        strips: Vertices of each strip of triangles.
    """

    vertices: NDArray[np.float64]
    polygons: Lists
    strips: Lists

    @property
    def triangles(self) -> NDArray[np.int64]:  # (m, 3)
        """All faces and strips as triangles."""
        from trimesh.geometry import triangulate_quads
        from trimesh.util import triangle_strips_to_faces

        found = [np.empty((0, 3), np.int64), triangulate_quads(self.polygons).reshape(-1, 3)]
        found += [triangle_strips_to_faces([strip]) for strip in self.strips]
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
    vertices, lists = np.empty((0, 3)), dict[str, Lists]()
    for name, number, properties in elements:
        if any(length is not None for _, _, length in properties):
            lists[name], at = _lists(path, name, number, properties, data, at)
            continue
        row = np.dtype([(one, kind) for one, kind, _ in properties])
        if number * row.itemsize > len(data) - at:
            raise WorldFileError(path, f"ends within its {name} elements")
        if name == "vertex":
            if not {"x", "y", "z"} <= set(row.names or ()):
                raise WorldFileError(path, "vertices without x, y and z")
            rows = np.frombuffer(data, row, number, at)
            vertices = np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])
        at += number * row.itemsize
    strips = [  # -1 stands between two
        piece[piece >= 0]
        for strip in lists.get("tristrips", [])
        for piece in np.split(strip, np.flatnonzero(strip < 0))
    ]
    long = [[one for one in given if len(one) > 2] for given in (lists.get("face", []), strips)]
    return Ply(vertices, *long)


def _header(path: Path, data: bytes) -> tuple[list[tuple[str, int, list[Property]]], int, bool]:
    """Return the elements, where the data begin, and whether they are text."""
    end = data.find(b"end_header")
    begin = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or not begin:
        raise WorldFileError(path, "no header of a PLY", 1)
    order, elements = None, list[tuple[str, int, list[Property]]]()

    def kind(word: str) -> np.dtype[Any]:
        return np.dtype(f"{order}{TYPES[word]}" if order else np.float64)

    for number, line in enumerate(data[:end].decode("latin-1").splitlines(), 1):
        match line.split():
            case ["format", word, *_] if word in ORDERS:
                order = ORDERS[word]
            case ["element", name, count] if count.isdecimal():
                elements.append((name, int(count), []))
            case ["property", "list", size, word, name] if {size, word} <= set(TYPES) and elements:
                elements[-1][2].append((name, kind(word), kind(size)))
            case ["property", word, name] if word in TYPES and elements:
                elements[-1][2].append((name, kind(word), None))
            case ["ply" | "comment" | "obj_info", *_] | []:
                pass
            case _:
                raise WorldFileError(path, f"header: got '{line[:60]}'", number)
    if order is None:
        raise WorldFileError(path, f"header: no format (available: {', '.join(ORDERS)})")
    return elements, begin, not order


def _lists(
    path: Path, name: str, number: int, properties: list[Property], data: bytes, at: int
) -> tuple[Lists, int]:
    """Return the list of vertices of each row of an element, and where the element ends."""
    found: Lists = []
    for _ in range(number):
        for one, kind, length in properties:
            count = 1
            if length is not None and at + length.itemsize <= len(data):
                count = int(np.frombuffer(data, length, 1, at)[0])
                at += length.itemsize
                if not 0 <= count < 2**31:
                    raise WorldFileError(path, f"a list of its {name} elements of no length")
            if at + count * kind.itemsize > len(data):
                raise WorldFileError(path, f"ends within its {name} elements")
            if one in LISTS:
                found.append(np.frombuffer(data, kind, count, at).astype(np.int64))
            at += count * kind.itemsize
    return found, at
