"""Writer of binary OctoMaps (`.bt`), by pyoctomap."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.map_files.cells import Cells
from wayproof.harness.outputs import written_whole
from wayproof.maps import FREE, OCCUPIED

HALF_TREE = 2**15
"""Cells of an OctoMap from its middle to its border, along an axis."""


def write_octomap(cells: Cells, path: Path) -> int:
    """Write the free and the occupied cells; return their number.

    The layer of cells k above ours is OctoMap's k - 1: its lattice has a face at z = 0 and ours has
    one three quarters of a cell below, so the file lies a quarter of a cell lower.

    Raises:
        InputError: pyoctomap is not installed, the cells leave its tree, or no file can be written.
    """
    try:
        pyoctomap = importlib.import_module("pyoctomap")
    except ImportError:
        raise InputError(
            "--map FILE.bt: pyoctomap is not installed: pip install pyoctomap (the extra 'imports')"
        ) from None
    tree = pyoctomap.OcTree(cells.resolution)
    count = 0
    for state, occupied in ((OCCUPIED, True), (FREE, False)):
        points = _in_tree(cells, state)
        tree.updateNodes(points.tolist(), occupied, True)
        count += len(points)
    tree.updateInnerOccupancy()
    with written_whole(path, "--map") as partial:
        if not tree.writeBinary(str(partial)):
            raise InputError(f"--map '{path}': OctoMap cannot write it")
    return count


def _in_tree(cells: Cells, state: int) -> NDArray[np.float64]:
    """Return the centres (n, 3) of OctoMap's cells for those of a state, m."""
    places = np.argwhere(cells.states == state) + np.array(cells.first) - np.array([0, 0, 1])
    if len(places) and int(np.abs(places).max()) >= HALF_TREE:
        raise InputError(f"--map FILE.bt: cells beyond {HALF_TREE} from the origin of an OctoMap")
    centres: NDArray[np.float64] = (places + 0.5) * cells.resolution
    return centres
