"""Files of the map of a decision, by the ending of a name: Nav2, OctoMap, PCD, PLY, and our own."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.map_files.cells import Cells, cells_within
from wayproof.harness.outputs import check_target, written_whole
from wayproof.harness.viewer.layer import layer_at
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, VoxelMap

GREYS = {OCCUPIED: 0, UNKNOWN: 205, FREE: 254}
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
"""Pixels and thresholds of `nav2_map_server` and of ROS 1's `map_saver`, mode trinary. That
of free space is the latter's: with the 0.25 that Nav2's saver writes, its loader takes the grey of
unknown cells (205, an occupancy of 0.1961) for free."""

HALF_TREE = 2**15
"""Cells of an OctoMap from its middle to its border, along an axis."""


def write_map(log: Log, path: Path, decision: int | None = None) -> tuple[int, int]:
    """Write the map of a decision in the format that the file's name says.

    Args:
        log: The log.
        path: File to write.
        decision: Number of the decision; None for the last.

    Returns:
        The number of the decision, and that of the cells that were written.

    Raises:
        InputError: The ending is of no format, there is no such decision, or it cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise InputError(f"--map '{path}': expected a name that ends in {', '.join(WRITERS)}")
    moment = moment_at(log, decision)
    count = WRITERS[ending](log, moment, path)
    return int(moment.decision.sequence), count


def moment_at(log: Log, decision: int | None) -> Moment:
    """Return a decision with its map rebuilt; the last one without a number.

    Raises:
        InputError: There is no such decision.
    """
    last = None
    for moment in moments(log):
        last = moment
        if decision is not None and moment.decision.sequence == decision:
            return moment
    if last is None:
        raise InputError(f"log '{log.path}': without a decision, so without a map")
    if decision is not None:
        most = last.decision.sequence
        raise InputError(f"--at {decision}: no such decision, expected 0 to {most}")
    return last


def cells_of(log: Log, moment: Moment) -> Cells:
    """Return the cells of a map within the operating area of its log."""
    return cells_within(moment.map, log.mission.low, log.mission.high)


def plane_of(moment: Moment) -> NDArray[np.uint8]:
    """Return a plane of the costmap (nx, ny): projected on the ground, or at the robot's height."""
    layer = layer_at(moment.costmap, float(moment.record.inputs.pose.position[2]))
    plane: NDArray[np.uint8] = moment.costmap.state[:, :, layer]
    return plane


def write_nav2(
    states: NDArray[np.uint8], corner: NDArray[np.float64], resolution: float, path: Path
) -> int:
    """Write a map as Nav2's map_server reads it: a `.yaml` and a `.pgm` beside it.

    Args:
        states: (nx, ny) unknown, free or occupied.
        corner: (2,) corner of the first cell, m, world.
        resolution: Edge of a cell, m.
        path: File that ends in `.yaml`.

    Returns:
        The number of cells.

    Raises:
        InputError: A file cannot be written, or the image's name would break the text.
    """
    image = path.with_suffix(".pgm")
    if not image.name.isprintable() or any(sign in image.name for sign in "'\"#:"):
        raise InputError(f"--map: name '{image.name}', expected one without ' \" # :")
    greys = np.array([GREYS[state] for state in range(len(GREYS))], np.uint8)
    pixels = greys[states].T[::-1]  # x to the right, y up
    rows, columns = pixels.shape
    x, y = corner.tolist()
    with written_whole(path, "--map") as text, written_whole(image, "--map") as picture:
        picture.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes())
        text.write_text(
            f"image: {image.name}\nmode: trinary\nresolution: {resolution!r}\n"
            f"origin: [{x!r}, {y!r}, 0]\nnegate: 0\n"
            f"occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n"
        )
    return states.size


def write_octomap(cells: Cells, path: Path) -> int:
    """Write the free and the occupied cells as a binary OctoMap; return their number.

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
    tree, count = pyoctomap.OcTree(cells.resolution), 0
    for state, occupied in ((OCCUPIED, True), (FREE, False)):
        places = np.argwhere(cells.states == state) + np.array(cells.first) - np.array([0, 0, 1])
        if len(places) and int(np.abs(places).max()) >= HALF_TREE:
            words = f"cells beyond {HALF_TREE} from the origin of an OctoMap"
            raise InputError(f"--map FILE.bt: {words}")
        tree.updateNodes(((places + 0.5) * cells.resolution).tolist(), occupied, True)
        count += len(places)
    tree.updateInnerOccupancy()
    with written_whole(path, "--map") as partial:
        if not tree.writeBinary(str(partial)):
            raise InputError(f"--map '{path}': OctoMap cannot write it")
    return count


def write_pcd(points: NDArray[np.float64], path: Path) -> int:
    """Write points (n, 3), m, as PCD 0.7 of float32; return their number."""
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n"
        f"TYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\nDATA binary\n"
    )
    return _write_points(head, points, path)


def write_ply(points: NDArray[np.float64], path: Path) -> int:
    """Write points (n, 3), m, as PLY 1.0 of float32; return their number."""
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return _write_points(head, points, path)


def _write_points(head: str, points: NDArray[np.float64], path: Path) -> int:
    with written_whole(path, "--map") as partial:
        partial.write_bytes(head.encode() + points.astype("<f4").tobytes())
    return len(points)


def _write_own(log: Log, moment: Moment, path: Path) -> int:
    """Write the voxel map itself, which `VoxelMap.load` reads back with all its evidence."""
    if not isinstance(moment.map, VoxelMap):
        raise InputError(
            f"--map '{path}': map.kind '{log.config.map.kind}' has no file of its own, "
            f"expected {', '.join(ending for ending in WRITERS if ending != OWN)}"
        )
    check_target(path, "--map")
    try:
        moment.map.save(path)
    except OSError as error:
        raise InputError(f"--map '{path}': {error.strerror}") from None
    return sum(moment.map.counts().values())


OWN = ".map"

WRITERS: dict[str, Callable[[Log, Moment, Path], int]] = {
    ".yaml": lambda _, moment, path: write_nav2(
        plane_of(moment), moment.costmap.origin[:2], moment.costmap.resolution, path
    ),
    ".bt": lambda log, moment, path: write_octomap(cells_of(log, moment), path),
    ".pcd": lambda log, moment, path: write_pcd(cells_of(log, moment).centres(OCCUPIED), path),
    ".ply": lambda log, moment, path: write_ply(cells_of(log, moment).centres(OCCUPIED), path),
    OWN: _write_own,
}
"""Ending -> writer, which returns the number of cells that it wrote."""
