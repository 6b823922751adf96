"""OctoMaps (`.bt`, `.ot`): the occupied leaves as merged boxes.

Both files hold a tree node by node, depth first, each before its children (Hornung et al. 2013,
"OctoMap", Autonomous Robots 34). `.bt` has two bits for each of a node's children; `.ot` has a
node's log-odds and a bit for each child. Read here and not by OctoMap's own library, which follows
a broken file down until its stack ends.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import vector
from wayproof.models.world_files.reading import MAX_CELLS, WorldFileError, check_file
from wayproof.models.world_files.voxel_maps import cell_boxes

MAX_OCTOMAP_BYTES = 8 * 2**20
"""Maximum size of a file, bytes: two of them may stand for eight cells in memory."""

MOST_LEAVES = 2_000_000

MAX_HEADER = 4096
"""Bytes within which the header ends."""

HEADERS = {".bt": b"# Octomap OcTree binary file", ".ot": b"# Octomap OcTree file"}
"""First line of a file by its ending."""

DEPTH = 16
"""Depth of an OctoMap: its root is 2^16 cells wide, with the world's origin in its middle."""

OCCUPIED, INNER = 2, 3
"""Two bits of a child in a `.bt`; 1 is free, 0 unknown."""

VALUE_BYTES = {"OcTree": 4, "ColorOcTree": 7}
"""Bytes of a node in an `.ot` before its children's bits: log-odds as float32, and a colour."""


class Leaf(NamedTuple):
    """A cube of cells: its lowest cell, and its side in cells."""

    x: int
    y: int
    z: int
    side: int

    def child(self, number: int) -> Leaf:
        """Return one of its eight parts: bits of the number are its halves along x, y and z."""
        half = self.side // 2
        return Leaf(
            self.x + half * (number & 1),
            self.y + half * (number >> 1 & 1),
            self.z + half * (number >> 2),
            half,
        )


def read_octomap(path: Path, options: ImportOptions) -> Found:
    """Read the occupied space of an OctoMap.

    Raises:
        WorldFileError: No OctoMap, a damaged one, or one of more cells than allowed.
    """
    check_file(path, MAX_OCTOMAP_BYTES)
    data = path.read_bytes()
    ending = path.suffix.lower()
    if not data.startswith(HEADERS[ending]):
        expected = HEADERS[ending].decode()
        raise WorldFileError(path, f"expected a file that begins with '{expected}'", 1)
    head, separator, nodes = data[:MAX_HEADER].partition(b"\ndata")
    fields = dict(
        line.split(None, 1) for line in head.splitlines() if line[:1] != b"#" and b" " in line
    )
    cell = _number(fields.get(b"res", b""))
    if not separator or not 1e-4 <= cell <= 1e3:
        raise WorldFileError(path, "its header has no 'res' of 0.0001 to 1000 m, or no 'data'")
    nodes = data[len(head) + len(separator) :].partition(b"\n")[2]
    read: Callable[[Path, bytes, str], Iterator[Leaf]] = READERS[ending]
    leaves: list[Leaf] = []
    for leaf in read(path, nodes, fields.get(b"id", b"OcTree").decode(errors="replace").strip()):
        if len(leaves) == MOST_LEAVES:
            raise WorldFileError(path, f"more than {MOST_LEAVES} occupied leaves")
        leaves.append(leaf)
    if not leaves:
        raise WorldFileError(path, "no occupied cell")
    table = np.array(leaves)  # (n, 4)
    first, sides = table[:, :3], table[:, 3]
    low, high = first.min(axis=0), (first + sides[:, None]).max(axis=0)
    if np.prod((high - low).astype(np.float64)) > MAX_CELLS:
        shape = " x ".join(map(str, (high - low).tolist()))
        raise WorldFileError(path, f"{shape} cells, expected at most {MAX_CELLS}")
    occupied = np.zeros(tuple(high - low), np.bool_)
    for (i, j, k), side in zip((first - low).tolist(), sides.tolist(), strict=True):
        occupied[i : i + side, j : j + side, k : k + side] = True
    return Found(parts=cell_boxes(path, occupied, cell, vector(low * cell)), grid=True, closed=True)


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def _root() -> Leaf:
    half = 1 << (DEPTH - 1)
    return Leaf(-half, -half, -half, 2 * half)


def _binary_leaves(path: Path, nodes: bytes, kind: str) -> Iterator[Leaf]:
    """Yield the occupied leaves of a `.bt`, whatever the kind of its tree."""
    waiting, place = [_root()], 0
    while waiting:
        node = waiting.pop()
        _check_node(path, node, place + 2, len(nodes))
        bits = nodes[place] | nodes[place + 1] << 8
        place += 2
        if node.side == 1:
            raise WorldFileError(path, f"deeper than {DEPTH} levels")
        for number in range(7, -1, -1):  # the first child ends up on top
            child = bits >> (2 * number) & 3
            if child == INNER:
                waiting.append(node.child(number))
            elif child == OCCUPIED:
                yield node.child(number)


def _full_leaves(path: Path, nodes: bytes, kind: str) -> Iterator[Leaf]:
    """Yield the leaves of an `.ot` that are at least as likely occupied as free."""
    if kind not in VALUE_BYTES:
        known = ", ".join(VALUE_BYTES)
        raise WorldFileError(path, f"a tree of kind '{kind[:40]}' (available: {known})")
    waiting, place, step = [_root()], 0, VALUE_BYTES[kind] + 1
    while waiting:
        node = waiting.pop()
        _check_node(path, node, place + step, len(nodes))
        children = nodes[place + step - 1]
        if children and node.side == 1:
            raise WorldFileError(path, f"deeper than {DEPTH} levels")
        if not children and struct.unpack_from("<f", nodes, place)[0] >= 0.0:
            yield node
        place += step
        waiting += [node.child(number) for number in range(7, -1, -1) if children >> number & 1]


READERS = {".bt": _binary_leaves, ".ot": _full_leaves}


def _check_node(path: Path, node: Leaf, needed: int, there: int) -> None:
    if needed > there:
        raise WorldFileError(path, f"ends within its tree: {there} bytes of nodes")
