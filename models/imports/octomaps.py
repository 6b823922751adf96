"""OctoMaps (`.bt`), by pyoctomap: the occupied leaves as merged boxes."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from wayproof.models.imports.options import Found, ImportOptions
from wayproof.models.imports.parts import vector
from wayproof.models.imports.reading import MOST_CELLS, Unreadable, check_file
from wayproof.models.imports.voxel_maps import cell_boxes

MOST_BYTES = 8 * 2**20
"""Of one file: two bytes of it may stand for eight cells in memory."""

MOST_LEAVES = 2_000_000

HEADER = b"# Octomap OcTree binary file"


def read_octomap(path: Path, options: ImportOptions) -> Found:
    """Occupied space of a binary OctoMap (Hornung et al. 2013, Autonomous Robots 34).

    Raises:
        Unreadable: No pyoctomap, no binary OctoMap, or one of more cells than allowed.
    """
    check_file(path, MOST_BYTES)
    with path.open("rb") as file:
        if not file.readline().startswith(HEADER):
            raise Unreadable(path, f"expected a file that begins with '{HEADER.decode()}'", 1)
    try:
        pyoctomap = importlib.import_module("pyoctomap")
    except ImportError:
        raise Unreadable(path, "OctoMaps need pyoctomap: pip install pyoctomap") from None
    tree = pyoctomap.OcTree(0.1)
    with _silent_library():
        read = tree.readBinary(str(path))
    if not read:
        raise Unreadable(path, "no binary OctoMap")
    cell = float(tree.getResolution())
    leaves = []
    for count, leaf in enumerate(tree.begin_leafs(), start=1):
        if count > MOST_LEAVES:
            raise Unreadable(path, f"more than {MOST_LEAVES} leaves")
        if tree.isNodeOccupied(leaf):
            leaves.append((*leaf.getCoordinate(), leaf.getSize()))
    if not leaves:
        raise Unreadable(path, "no occupied cell")
    table = np.array(leaves)  # (n, 4)
    first = np.rint((table[:, :3] - table[:, 3:] / 2.0) / cell).astype(np.int64)
    sides = np.rint(table[:, 3] / cell).astype(np.int64)
    low, high = first.min(axis=0), (first + sides[:, None]).max(axis=0)
    if np.prod((high - low).astype(np.float64)) > MOST_CELLS:
        shape = " x ".join(map(str, (high - low).tolist()))
        raise Unreadable(path, f"{shape} cells, expected at most {MOST_CELLS}")
    occupied = np.zeros(tuple(high - low), np.bool_)
    for (i, j, k), side in zip((first - low).tolist(), sides.tolist(), strict=True):
        occupied[i : i + side, j : j + side, k : k + side] = True
    return Found(parts=cell_boxes(path, occupied, cell, vector(low * cell)))


@contextmanager
def _silent_library() -> Iterator[None]:
    """Discard what the C++ library prints about a broken file: one line of ours says it."""
    stderr = os.dup(2)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nothing)
