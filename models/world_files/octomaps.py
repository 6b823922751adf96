"""OctoMaps (`.bt`), by pyoctomap: the occupied leaves as merged boxes."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import vector
from wayproof.models.world_files.reading import MAX_CELLS, WorldFileError, check_file
from wayproof.models.world_files.voxel_maps import cell_boxes

MAX_OCTOMAP_BYTES = 8 * 2**20
"""Maximum size of a file, bytes: two of them may stand for eight cells in memory."""

MOST_LEAVES = 2_000_000

HEADER = b"# Octomap OcTree binary file"


def read_octomap(path: Path, options: ImportOptions) -> Found:
    """Occupied space of a binary OctoMap (Hornung et al. 2013, Autonomous Robots 34).

    Raises:
        WorldFileError: No pyoctomap, no binary OctoMap, or one of more cells than allowed.
    """
    check_file(path, MAX_OCTOMAP_BYTES)
    with path.open("rb") as file:
        if not file.readline().startswith(HEADER):
            raise WorldFileError(path, f"expected a file that begins with '{HEADER.decode()}'", 1)
    try:
        pyoctomap = importlib.import_module("pyoctomap")
    except ImportError:
        raise WorldFileError(path, "OctoMaps need pyoctomap: pip install pyoctomap") from None
    tree = pyoctomap.OcTree(0.1)
    with _silent_library():
        read = tree.readBinary(str(path))
    if not read:
        raise WorldFileError(path, "no binary OctoMap")
    cell = float(tree.getResolution())
    leaves = []
    for count, leaf in enumerate(tree.begin_leafs(), start=1):
        if count > MOST_LEAVES:
            raise WorldFileError(path, f"more than {MOST_LEAVES} leaves")
        if tree.isNodeOccupied(leaf):
            leaves.append((*leaf.getCoordinate(), leaf.getSize()))
    if not leaves:
        raise WorldFileError(path, "no occupied cell")
    table = np.array(leaves)  # (n, 4)
    first = np.rint((table[:, :3] - table[:, 3:] / 2.0) / cell).astype(np.int64)
    sides = np.rint(table[:, 3] / cell).astype(np.int64)
    low, high = first.min(axis=0), (first + sides[:, None]).max(axis=0)
    if np.prod((high - low).astype(np.float64)) > MAX_CELLS:
        shape = " x ".join(map(str, (high - low).tolist()))
        raise WorldFileError(path, f"{shape} cells, expected at most {MAX_CELLS}")
    occupied = np.zeros(tuple(high - low), np.bool_)
    for (i, j, k), side in zip((first - low).tolist(), sides.tolist(), strict=True):
        occupied[i : i + side, j : j + side, k : k + side] = True
    return Found(parts=cell_boxes(path, occupied, cell, vector(low * cell)), grid=True, closed=True)


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
