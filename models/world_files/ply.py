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

LISTS = {"face": ("vertex_indices", "vertex_index"), "tristrips": ("vertex_indices",)}
"""Names of the list of vertices, by the element."""


class _Element(NamedTuple):
    name: str
    number: int
    properties: list[tuple[str, str, str]]
    """Name, type of a value, and type of the length of a list, empty of a single value."""


class Ply(NamedTuple):
    """Content of a PLY.

    Attributes:
        vertices: (n, 3) in the file's units.
        polygons: Vertices of each face.
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
        if self.polygons:
            sides = {len(one) for one in self.polygons}
            polygons = np.array(self.polygons) if len(sides) == 1 else self.polygons
            found.append(np.asarray(triangulate_quads(polygons), np.int64).reshape(-1, 3))
        found += [triangle_strips_to_faces([strip]) for strip in self.strips if len(strip) > 2]
        return np.concatenate(found)


def read_ply(path: Path) -> Ply:
    """Read the vertices and surfaces of a PLY; other elements are passed over.

    Raises:
        WorldFileError: Naming what of its header cannot be read, or where it ends early.
    """
    data = path.read_bytes()
    order, elements, start = _header(path, data)
    words = _numbers(path, data[start:]) if order == "ascii" else np.empty(0)
    at = 0 if order == "ascii" else start
    vertices = np.empty((0, 3))
    lists: dict[str, list[NDArray[np.int64]]] = {name: [] for name in LISTS}
    for element in elements:
        columns, at = _read(path, element, ORDERS[order], words, data, at)
        if element.name == "vertex":
            if not {"x", "y", "z"} <= set(columns):
                raise WorldFileError(path, "vertices without x, y and z")
            vertices = np.column_stack([np.concatenate(columns[axis]) for axis in "xyz"])
        for name in LISTS.get(element.name, ()):
            given = columns.get(name, [])
            if isinstance(given, np.ndarray):
                lists[element.name] += list(given.astype(np.int64))
            else:
                lists[element.name] += [one.astype(np.int64) for one in given]
    strips = [piece for strip in lists["tristrips"] for piece in _cut(strip)]
    polygons = [one for one in lists["face"] if len(one) > 2]
    return Ply(np.asarray(vertices, np.float64), polygons, strips)


def _cut(strip: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the strips of a list in which -1 stands between two."""
    return [piece[piece >= 0] for piece in np.split(strip, np.flatnonzero(strip < 0))]


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    """Return the format, the elements, and where the data begin."""
    end = data.find(b"end_header")
    begin = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or not begin:
        raise WorldFileError(path, "no header of a PLY", 1)
    order, elements = "", list[_Element]()
    for number, line in enumerate(data[:end].decode("latin-1").splitlines(), 1):
        match line.split():
            case ["format", word, *_] if word in ORDERS:
                order = word
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name] if {length, kind} <= set(TYPES):
                elements[-1].properties.append((name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if kind in TYPES and elements:
                elements[-1].properties.append((name, TYPES[kind], ""))
            case ["ply" | "comment" | "obj_info", *_] | []:
                pass
            case _:
                raise WorldFileError(path, f"header: got '{line[:60]}'", number)
    if not order:
        raise WorldFileError(path, f"header: no format (available: {', '.join(ORDERS)})")
    return order, elements, begin


def _numbers(path: Path, text: bytes) -> NDArray[np.float64]:
    try:
        return np.array(text.split(), np.float64)
    except ValueError:
        raise WorldFileError(path, "a word that is no number") from None


def _read(
    path: Path, element: _Element, order: str, words: NDArray[np.float64], data: bytes, at: int
) -> tuple[dict[str, list[NDArray[Any]] | NDArray[Any]], int]:
    """Return each property's values, an array an entry or one of all, and where they end."""
    lists = any(length for _, _, length in element.properties)
    if not element.number or not element.properties:
        return {}, at
    if not lists:
        kinds = np.dtype([(name, order + kind) for name, kind, _ in element.properties])
        if order:
            rows = _taken(path, element, data, kinds, element.number, at)
            return {name: [rows[name]] for name, _, _ in element.properties}, at + rows.nbytes
        width = len(element.properties)
        table = words[at : at + element.number * width]
        if len(table) < element.number * width:
            raise WorldFileError(path, f"ends within its {element.name} elements")
        rows = table.reshape(-1, width)
        return {
            name: [rows[:, n].astype(kind)] for n, (name, kind, _) in enumerate(element.properties)
        }, at + len(table)
    if order and (alike := _alike(element, order, data, at)) is not None:
        return {name: alike[name] for name, _, _ in element.properties}, at + alike.nbytes
    found: dict[str, list[NDArray[Any]]] = {name: [] for name, _, _ in element.properties}
    for _ in range(element.number):
        for name, kind, length in element.properties:
            count = 1
            if length:
                count, at = _length(path, element, order + length, words, data, at)
            if order:
                values = _taken(path, element, data, np.dtype(order + kind), count, at)
                at += values.nbytes
            else:
                values = words[at : at + count]
                at += count
                if len(values) < count:
                    raise WorldFileError(path, f"ends within its {element.name} elements")
            found[name].append(values)
    return {**found}, at


def _alike(element: _Element, order: str, data: bytes, at: int) -> NDArray[Any] | None:
    """Return the rows of a binary element whose lists are all as long as its first row's."""
    fields: list[tuple[Any, ...]] = []
    place = at
    for name, kind, length in element.properties:
        size = np.dtype(order + (length or kind)).itemsize
        if len(data) < place + size:
            return None
        if length:
            count = int(np.frombuffer(data, order + length, 1, place)[0])
            fields += [(f"count of {name}", order + length), (name, order + kind, (count,))]
            place += size + count * np.dtype(kind).itemsize
        else:
            fields.append((name, order + kind))
            place += size
        if not at < place <= len(data):
            return None
    row = np.dtype(fields)
    if len(data) - at < element.number * row.itemsize:
        return None
    rows = np.frombuffer(data, row, element.number, at)
    lists = [name for name, _, length in element.properties if length]
    alike = all((rows[f"count of {one}"] == rows[one].shape[1]).all() for one in lists)
    return rows if alike else None


def _length(
    path: Path, element: _Element, kind: str, words: NDArray[np.float64], data: bytes, at: int
) -> tuple[int, int]:
    """Return the length of a list, and where its values begin."""
    if kind[0] in "<>":
        size = _taken(path, element, data, np.dtype(kind), 1, at)
        at += size.nbytes
    else:
        size, at = words[at : at + 1], at + 1
    if not len(size) or not 0 <= size[0] < 2**31:
        raise WorldFileError(path, f"a list of its {element.name} elements of no length")
    return int(size[0]), at


def _taken(
    path: Path, element: _Element, data: bytes, kind: np.dtype[Any], count: int, at: int
) -> NDArray[Any]:
    if len(data) - at < count * kind.itemsize:
        raise WorldFileError(path, f"ends within its {element.name} elements")
    return np.frombuffer(data, kind, count, at)
