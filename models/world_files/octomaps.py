"""OctoMaps (`.bt`, `.ot`): the occupied leaves as merged boxes.

Both files hold a tree node by node, depth first, each before its children (Hornung et al. 2013,
"OctoMap", Autonomous Robots 34). Read here and not by OctoMap's own library, which follows a broken
file down until its stack ends.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.cells import cell_boxes
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import vector
from wayproof.models.world_files.reading import MAX_CELLS, WorldFileError, check_file

MAX_OCTOMAP_BYTES = 8 * 2**20
"""Maximum size of a file, bytes: two bytes may expand to eight cells in memory."""

MOST_LEAVES = 2_000_000

MAX_HEADER = 4096
"""Bytes within which the header ends."""

HEADERS = {".bt": b"# Octomap OcTree binary file", ".ot": b"# Octomap OcTree file"}
"""First line of a file by its ending."""

DEPTH = 16
"""Depth of an OctoMap: its root is 2^16 cells wide, with the world's origin in its middle."""

FREE, OCCUPIED, INNER = 1, 2, 3
"""Two bits of a child in a `.bt`; 0 is unknown."""

NODE_BYTES = {".bt": 2, "OcTree": 5, "ColorOcTree": 8}
"""Bytes of a node: in a `.bt` two bits for each child; in an `.ot`, by the kind of tree, log-odds
as float32, a colour, and a bit for each child."""


Leaf = tuple[int, int, int, int]
"""A cube of cells: its lowest cell x, y, z, and its side in cells."""


class OctomapCells(NamedTuple):
    """The known cells of an OctoMap within their bounds.

    Attributes:
        occupied: (nx, ny, nz) cells.
        free: (nx, ny, nz) cells; what is neither is unknown.
        resolution: Edge of a cell, m.
        low: Corner of the first cell, m.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    low: Vector3


def read_octomap_cells(path: Path, occupied_only: bool = False) -> OctomapCells:
    """Read the leaves of an OctoMap as cells.

    Args:
        path: Path of the file.
        occupied_only: Whether free leaves are left out, also of the bounds.

    Raises:
        WorldFileError: No OctoMap, a damaged one, or one of more cells than allowed.
    """
    cell, nodes, size = _opened(path)
    leaves: list[Leaf] = []
    states: list[bool] = []
    for leaf, is_occupied in _walk(path, nodes, size):
        if occupied_only and not is_occupied:
            continue
        if len(leaves) == MOST_LEAVES:
            what = "occupied" if occupied_only else "known"
            raise WorldFileError(path, f"more than {MOST_LEAVES} {what} leaves")
        leaves.append(leaf)
        states.append(is_occupied)
    if not any(states):
        raise WorldFileError(path, "no occupied cell")
    table = np.array(leaves)  # (n, 4)
    first, sides = table[:, :3], table[:, 3]
    low, high = first.min(axis=0), (first + sides[:, None]).max(axis=0)
    if np.prod((high - low).astype(np.float64)) > MAX_CELLS:
        shape = " x ".join(map(str, (high - low).tolist()))
        raise WorldFileError(path, f"{shape} cells, expected at most {MAX_CELLS}")
    grids = np.zeros((2, *(high - low)), np.bool_)
    for (i, j, k), side, held in zip((first - low).tolist(), sides.tolist(), states, strict=True):
        grids[int(held), i : i + side, j : j + side, k : k + side] = True
    free, occupied = grids
    return OctomapCells(occupied, free, cell, vector(low * cell))


def read_octomap(path: Path, options: ImportOptions) -> Found:
    """Read the occupied space of an OctoMap; errors as of `read_octomap_cells`."""
    cells = read_octomap_cells(path, occupied_only=True)
    parts = cell_boxes(path, cells.occupied, cells.resolution, cells.low)
    return Found(parts=parts, grid=True, closed=True)


def _opened(path: Path) -> tuple[float, bytes, int]:
    """Return the edge of a cell, m, the nodes, and the size of one, bytes."""
    check_file(path, MAX_OCTOMAP_BYTES)
    data, ending = path.read_bytes(), path.suffix.lower()
    if not data.startswith(HEADERS[ending]):
        expected = HEADERS[ending].decode()
        raise WorldFileError(path, f"expected a file that begins with '{expected}'", 1)
    head, separator, _ = data[:MAX_HEADER].partition(b"\ndata")
    lines = [line.split(None, 1) for line in head.splitlines() if line[:1] != b"#"]
    fields = dict(words for words in lines if len(words) == 2)
    try:
        cell = float(fields.get(b"res", b""))
    except ValueError:
        cell = 0.0
    if not separator or not 1e-4 <= cell <= 1e3:
        raise WorldFileError(path, "its header has no 'res' of 0.0001 to 1000 m, or no 'data'")
    kind = fields.get(b"id", b"OcTree").decode(errors="replace").strip()
    if ending == ".ot" and kind not in NODE_BYTES:
        raise WorldFileError(path, f"a tree of kind '{kind[:40]}' (available: OcTree, ColorOcTree)")
    nodes = data[len(head) + len(separator) :].partition(b"\n")[2]
    return cell, nodes, NODE_BYTES[ending if ending == ".bt" else kind]


def _walk(path: Path, nodes: bytes, size: int) -> Iterator[tuple[Leaf, bool]]:
    """Yield the leaves of a tree whose nodes have a size, bytes, and whether each is occupied."""
    low = -(1 << (DEPTH - 1))
    waiting, place = [(low, low, low, 1 << DEPTH)], 0
    while waiting:
        x, y, z, side = waiting.pop()
        head, place = nodes[place : place + size], place + size
        if len(head) < size:
            raise WorldFileError(path, f"ends within its tree: {len(nodes)} bytes of nodes")
        if size == NODE_BYTES[".bt"]:
            bits = int.from_bytes(head, "little")
            children = [bits >> (2 * number) & 3 for number in range(8)]
        else:
            children = [INNER * (head[-1] >> number & 1) for number in range(8)]
            if not head[-1]:
                yield (x, y, z, side), struct.unpack_from("<f", head)[0] >= 0.0
        if side == 1 and any(children):
            raise WorldFileError(path, f"deeper than {DEPTH} levels")
        half = side // 2
        for number in range(7, -1, -1):  # the first child ends up on top
            # Bits of the number are a child's halves along x, y and z.
            halves = half * (number & 1), half * (number >> 1 & 1), half * (number >> 2)
            child = x + halves[0], y + halves[1], z + halves[2], half
            if children[number] == INNER:
                waiting.append(child)
            elif children[number]:
                yield child, children[number] == OCCUPIED
