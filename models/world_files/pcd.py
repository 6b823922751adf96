"""Point clouds of the Point Cloud Library (`.pcd`): each cell with a point is solid."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.models.world_files.cells import cells_of_points
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.reading import WorldFileError, check_file

MAX_HEADER = 8192
"""Bytes within which the header of a PCD ends."""

TYPES = {"F4": "<f4", "F8": "<f8"} | {
    f"{kind}{size}": f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)
}
"""NumPy's types by TYPE and SIZE of a PCD."""

MOST_RATIO = 100
"""Bytes that one byte of LZF can expand to: 264 of three."""

MOST_VALUES = 1000
"""Maximum number of values of a point."""


def read_pcd(path: Path, options: ImportOptions) -> Found:
    """Read a PCD of the Point Cloud Library (version 0.7; ASCII, binary or compressed).

    Raises:
        WorldFileError: Naming what of its header cannot be read.
    """
    check_file(path)
    data = path.read_bytes()
    fields, start = _header(path, data)
    names = fields.get("FIELDS", [])
    counts = [_whole(path, "COUNT", word) for word in fields.get("COUNT", ["1"] * len(names))]
    types = [a + b for a, b in zip(fields.get("TYPE", []), fields.get("SIZE", []), strict=False)]
    if not {"x", "y", "z"} <= set(names) or not len(names) == len(types) == len(counts):
        what = "FIELDS, SIZE, TYPE and COUNT: expected x, y and z among them, and as many of each"
        raise WorldFileError(path, what)
    if unknown := [kind for kind in types if kind not in TYPES]:
        known = ", ".join(TYPES)
        raise WorldFileError(path, f"TYPE and SIZE {unknown[0][:20]} (available: {known})")
    if sum(counts) > MOST_VALUES:
        raise WorldFileError(path, f"{sum(counts)} values a point, expected at most {MOST_VALUES}")
    number = _whole(path, "POINTS", " ".join(fields.get("POINTS", [])))
    shapes = [(TYPES[kind], (count,)) for kind, count in zip(types, counts, strict=True)]
    row = np.dtype([(str(n), *shape) for n, shape in enumerate(shapes)])
    data, places = data[start:], [names.index(axis) for axis in "xyz"]
    match " ".join(fields["DATA"]):
        case "ascii":
            table = _ascii(path, data, number, sum(counts))
            columns = [table[:, sum(counts[:n])] for n in places]
        case "binary":
            if len(data) < number * row.itemsize:
                there = len(data) // row.itemsize
                raise WorldFileError(path, f"POINTS {number}, but {there} are there")
            rows = np.frombuffer(data, row, number)
            columns = [rows[str(n)][:, 0] for n in places]
        case "binary_compressed":  # field by field, each of all points
            raw = _decompressed(path, data, number * row.itemsize)
            begins = number * np.cumsum([0, *(np.dtype(shape).itemsize for shape in shapes)])
            columns = [np.frombuffer(raw, TYPES[types[n]], number * counts[n], begins[n])
                       .reshape(number, -1)[:, 0] for n in places]  # fmt: skip
        case kind:
            known = "ascii, binary or binary_compressed"
            raise WorldFileError(path, f"DATA {kind[:40]}, expected {known}")
    with np.errstate(invalid="ignore"):  # points that are not finite are counted
        points = np.column_stack([column.astype(np.float64) for column in columns])
    return cells_of_points(path, points, options)


def _decompressed(path: Path, data: bytes, size: int) -> bytes:
    """Return the bytes of compressed data: two sizes, of 32 bits each, then LZF.

    Raises:
        WorldFileError: The sizes are not those of the header, or the data are damaged.
    """
    packed, whole = np.frombuffer(data[:8].ljust(8, b"\0"), "<u4").tolist()
    if whole != size or len(data) < 8 + packed:
        raise WorldFileError(
            path,
            f"DATA binary_compressed: {whole} bytes of {packed}, of which {max(len(data) - 8, 0)} "
            f"are there; expected {size} by the header",
        )
    if size > MOST_RATIO * packed:
        raise WorldFileError(path, f"DATA binary_compressed: {size} bytes of {packed} are none")
    out = np.empty(size, np.uint8)
    if decompress_lzf(np.frombuffer(data, np.uint8, packed, 8).copy(), out) != size:
        raise WorldFileError(path, "DATA binary_compressed: damaged")
    return out.tobytes()


@kernel
def decompress_lzf(data: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Decompress data (n,) of LibLZF's format, and return the length; -1 if they are damaged.

    A byte below 32 is followed by so many bytes and one. Any other holds a length, in its upper 3
    bits (7: the next byte is added), and the upper 5 bits of a distance back, whose lower 8 follow.
    """
    read, written = 0, 0
    while read < len(data):
        control = int(data[read])
        read += 1
        if control < 32:
            count = control + 1
            if read + count > len(data) or written + count > len(out):
                return -1
            for _ in range(count):
                out[written] = data[read]
                read += 1
                written += 1
            continue
        count = control >> 5
        if count == 7 and read < len(data):
            count += int(data[read])
            read += 1
        if read >= len(data):
            return -1
        source = written - ((control & 31) << 8) - int(data[read]) - 1
        read += 1
        count += 2
        if source < 0 or written + count > len(out):
            return -1
        for _ in range(count):  # byte by byte, as what is copied may reach into itself
            out[written] = out[source]
            source += 1
            written += 1
    return written


def _header(path: Path, data: bytes) -> tuple[dict[str, list[str]], int]:
    """Return the words of each line of the header, and where the data begin."""
    fields: dict[str, list[str]] = {}
    start = 0
    while start < min(len(data), MAX_HEADER):
        end = data.find(b"\n", start)
        if end < 0:
            break
        words = data[start:end].decode("ascii", errors="replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            fields[words[0]] = words[1:]
            if words[0] == "DATA":
                return fields, start
    raise WorldFileError(path, "no header of a PCD: no line DATA", 1)


def _whole(path: Path, name: str, word: str) -> int:
    if not word.isdecimal() or not 0 < int(word) < 2**40:
        raise WorldFileError(path, f"{name}: got '{word[:40]}', expected a whole number above 0")
    return int(word)


def _ascii(path: Path, data: bytes, number: int, width: int) -> NDArray[np.float64]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # NumPy before 2.3 only warns
            values = np.fromstring(data, np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        raise WorldFileError(path, "DATA ascii: a word that is no number") from None
    if len(values) != number * width:
        raise WorldFileError(
            path, f"POINTS {number} of {width} values each, but {len(values)} numbers are there"
        )
    return values.reshape(number, width)
