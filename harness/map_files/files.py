"""The formats of map files, by the ending of a name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.map_files.cells import cells_of, flat_map_of, moment_at
from wayproof.harness.map_files.occupancy import write_occupancy_map
from wayproof.harness.map_files.octomap import write_octomap
from wayproof.harness.map_files.points import write_pcd, write_ply
from wayproof.harness.outputs import check_target
from wayproof.harness.viewer.moments import Moment
from wayproof.maps import OCCUPIED, VoxelMap


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
    ".yaml": lambda _, moment, path: write_occupancy_map(flat_map_of(moment), path),
    ".bt": lambda log, moment, path: write_octomap(cells_of(log, moment.map), path),
    ".pcd": lambda log, moment, path: write_pcd(cells_of(log, moment.map).centres(OCCUPIED), path),
    ".ply": lambda log, moment, path: write_ply(cells_of(log, moment.map).centres(OCCUPIED), path),
    OWN: _write_own,
}
"""Ending -> writer, which returns the number of cells that it wrote."""


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
