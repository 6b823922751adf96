"""Import of worlds: from another tool's file to a world file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.cells import read_voxel_map
from wayproof.models.world_files.ends import NoSpaceError, complete
from wayproof.models.world_files.ground import settle_ground
from wayproof.models.world_files.heights import read_heights
from wayproof.models.world_files.mesh_files import READERS
from wayproof.models.world_files.meshes import read_mesh
from wayproof.models.world_files.mjcf_scenes import read_mjcf
from wayproof.models.world_files.occupancy_maps import read_occupancy_map
from wayproof.models.world_files.octomaps import read_octomap
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import bounds_of
from wayproof.models.world_files.pcd import read_pcd
from wayproof.models.world_files.reading import FARTHEST, WorldFileError, check_file
from wayproof.models.world_files.sdf import read_sdf
from wayproof.models.world_files.tables import read_table
from wayproof.models.world_files.world_file import FileWorld, world_of, world_text

Reader = Callable[[Path, ImportOptions], Found]

FORMATS: dict[str, Reader] = {
    ".xml": read_mjcf,
    ".mjcf": read_mjcf,
    ".world": read_sdf,
    ".sdf": read_sdf,
    ".csv": read_table,
    ".3dmap": read_voxel_map,
    ".yaml": read_occupancy_map,
    ".bt": read_octomap,
    ".ot": read_octomap,
    ".pcd": read_pcd,
    **dict.fromkeys(READERS, read_mesh),
    ".urdf": read_sdf,
    ".npy": read_heights,
    ".png": read_heights,
}
"""Readers by the ending of a file's name."""


def import_world(
    path: Path,
    options: ImportOptions | None = None,
    start: Vector3 | None = None,
    goal: Vector3 | None = None,
) -> tuple[FileWorld, list[str]]:
    """Read a file of any known format as a world.

    Args:
        path: The file; its ending says the format.
        options: Options for what the file does not contain.
        start: Start on the floor, in place of the file's own, m.
        goal: Goal on the floor, likewise, m.

    Returns:
        The world, and a line for everything that was left out or chosen.

    Raises:
        WorldFileError: Naming the file, and where it can the element and the line.
    """
    options = options or ImportOptions()
    ending = path.suffix.lower()
    if ending in (".las", ".laz"):
        what = f"{ending} is not read: convert it, as by 'pdal translate {path.name} cloud.pcd'"
        raise WorldFileError(path, what)
    if ending not in FORMATS:
        raise WorldFileError(path, f"unknown format '{ending}' (available: {', '.join(FORMATS)})")
    check_file(path)
    found = FORMATS[ending](path, options)
    if found.parts and not (reach := float(np.abs(bounds_of(found.parts)).max())) <= FARTHEST:
        raise WorldFileError(path, f"a solid up to {reach:g} m away, expected {FARTHEST:g} at most")
    if not (found.parts or found.plane or found.planes):
        left_out = "; ".join(note for note in found.notes if "left out" in note)
        what = left_out[:300] or "expected a model with a collision, or a plane as the floor"
        raise WorldFileError(path, f"nothing solid in it: {what}")
    settle_ground(path, found, options)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    found.source = found.source or f"{path.name}, sha256 {digest}"
    found.start, found.goal = start or found.start, goal or found.goal
    try:
        ends = complete(found, options)
    except NoSpaceError as error:
        what = f"{error}, with the floor where it is; --floor for another"
        raise WorldFileError(path, what) from None
    return world_of(world_text(found, ends, path.stem), path), found.notes
