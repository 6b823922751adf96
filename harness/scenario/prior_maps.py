"""Prior maps by their source: the geometry of the world, or a file by its ending."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from wayproof.harness.config import HASH_SEPARATOR, Config
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.geometry import least_box
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.perturbations.perturbation import Misplacement
from wayproof.harness.prior.cells import PriorCells, packed
from wayproof.harness.prior.grid import Grid, Placement, States, resampled
from wayproof.harness.prior.of_world import grid_of_world, splat_of_world
from wayproof.harness.prior.splats import poll, read_splat, states_by
from wayproof.harness.prior.spz import read_spz
from wayproof.harness.prior_config import MADE_OF_WORLD, NO_PRIOR, SPLAT, TRUTH, PriorConfig
from wayproof.harness.stack.mapping import Mapper
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, VoxelMap
from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, unpack
from wayproof.maps.voxel.bricks import BELOW, BRICK_SHAPE
from wayproof.models.world_files import read_world_file
from wayproof.models.world_files.occupancy_maps import read_occupancy_grid
from wayproof.models.world_files.octomaps import read_octomap_cells
from wayproof.models.worlds import World

T = TypeVar("T")

SPLATS = {".ply": read_splat, ".spz": read_spz}
"""Readers of splats by the ending of a file."""

HASH_DIGITS = 16
"""Number of hex digits of the hash of a file in a log."""

MOST_BYTES = 2**30
"""Maximum size of a file, bytes."""


def with_prior(config: Config, world: World) -> Config:
    """Return the config for the log, with the cells of its prior map and the identity of its file.

    Args:
        config: Config of an episode.
        world: Its world.

    Raises:
        InputError: There is no such source, its file cannot be read, or it cannot be perturbed so.
    """
    prior, perturbation = config.prior, config.perturbation or UNPERTURBED
    if prior.source == NO_PRIOR:
        if perturbation.changes == "prior":
            raise InputError(
                f"perturbation '{perturbation.kind}': changes the prior map, and there is none; "
                "expected prior.source"
            )
        return replace(config, prior_map=b"") if config.prior_map else config
    if config.recording is not None and prior.source in MADE_OF_WORLD:
        raise InputError(
            f"prior.source: got '{prior.source}' for a recording, whose world is not known; "
            "expected a file"
        )
    if HASH_SEPARATOR in prior.source and config.prior_map:
        return config  # from a log
    shown = _shown(config, world)
    placed = _placed(prior, world, perturbation.misplacement(config.seed))
    window = Window.covering(world.low, world.high, config.map.resolution)
    states, source = _states(config, shown, placed, window)
    box = least_box(states != UNKNOWN)
    x, y, z = np.add(window.first, [part.start for part in box]).tolist()
    cells = PriorCells(window.resolution, (x, y, z), states[box])
    if not any(cells.counts().values()):
        raise InputError(
            f"prior.source: '{prior.source}' has no known cell in the operating area, expected "
            "one that overlaps it; prior.x, y, z and yaw place it"
        )
    return replace(config, prior=replace(prior, source=source), prior_map=packed(cells))


def _placed(prior: PriorConfig, world: World, error: Misplacement) -> Placement:
    """Return the pose of the grid in the world: as the settings say, and then with an error."""
    own = Placement(prior.x, prior.y, prior.z, prior.yaw)
    if error == Misplacement():
        return own
    x, y, _ = world.start
    about_start = Placement(x, y, 0.0, error.turn).after(Placement(-x, -y, 0.0, 0.0))
    moved = Placement(about_start.x + error.x, about_start.y + error.y, 0.0, about_start.yaw)
    return moved.after(own)


def _shown(config: Config, world: World) -> World:
    """Return the world as a prior map shows it."""
    source, perturbation = config.prior.source, config.perturbation or UNPERTURBED
    try:
        shown = perturbation.change_prior(world, config.seed)
    except ValueError as error:
        raise InputError(
            f"world '{config.world}' with perturbation '{perturbation.kind}': {error}"
        ) from None
    if shown is not world and source not in (TRUTH, SPLAT):
        raise InputError(
            f"perturbation '{perturbation.kind}': nothing can be moved in the map of a file, "
            "expected the mode shift or turn, or prior.source=truth"
        )
    return shown


def _states(config: Config, shown: World, placed: Placement, window: Window) -> tuple[States, str]:
    """Return the states of the cells of a window by a source, and the identity of the source."""
    prior = config.prior
    if prior.source == TRUTH:
        return resampled(grid_of_world(shown, window.resolution), placed, window), TRUTH
    if prior.source == SPLAT:
        return states_by(poll(splat_of_world(shown), window, placed)), SPLAT
    path = Path(prior.source)
    if (read_gaussians := SPLATS.get(path.suffix.lower())) is not None:
        splat, source = _read(path, read_gaussians)
        votes = poll(splat, window, placement=placed, scale=prior.scale, up=prior.up)
        return states_by(votes), source
    if path.suffix.lower() not in READERS:
        if HASH_SEPARATOR in path.name:
            raise InputError(f"prior map '{path}' was read from a file: expected the file")
        files = [f"FILE{one}" for one in (*READERS, *SPLATS)]
        raise unknown_name("prior map", prior.source, [NO_PRIOR, TRUTH, SPLAT, *files])
    read = READERS[path.suffix.lower()]
    grid, source = _read(path, lambda path: read(path, config))
    return resampled(grid, placed.after(grid.placement), window), source


def _read(path: Path, read: Callable[[Path], T]) -> tuple[T, str]:
    """Read a file; return its content and its identity, name and hash.

    Raises:
        InputError: There is no such file, or it is of another format.
    """
    try:
        size = path.stat().st_size
        if not path.is_file() or size > MOST_BYTES:
            raise InputError(
                f"prior map '{path}': {size} bytes, expected a file of at most {MOST_BYTES}"
            )
        found = read(path)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()[:HASH_DIGITS]
    except OSError as error:
        raise InputError(f"prior map '{path}': {error.strerror}") from None
    except ValueError as error:
        text = str(error).removeprefix(f"{path}: ")
        raise InputError(f"prior map '{path}': {text}") from None
    return found, f"{path.name}{HASH_SEPARATOR}{digest}"


def _read_occupancy_map(path: Path, config: Config) -> Grid:
    """Return a flat map, whose image may be turned about its corner."""
    flat = read_occupancy_grid(path)
    states = np.where(flat.occupied, OCCUPIED, flat.free * FREE).astype(np.uint8)[:, :, None]
    x, y, yaw = flat.origin
    placement = Placement(x, y, 0.0, yaw)
    return Grid(
        states,
        origin=np.zeros(3),
        resolution=flat.resolution,
        height=config.prior.height,
        placement=placement,
    )


def _read_octomap(path: Path, config: Config) -> Grid:
    del config
    cells = read_octomap_cells(path)
    states = np.where(cells.occupied, OCCUPIED, cells.free * FREE).astype(np.uint8)
    return Grid(states, np.array(cells.low), cells.resolution)


def _read_own_map(path: Path, config: Config) -> Grid:
    """Return a voxel map that was saved, within the bounds of its bricks."""
    del config
    voxel_map = VoxelMap.load(path)
    keys = voxel_map.content().keys.astype(np.int64)
    if not len(keys):
        raise ValueError("no known cell")
    first = keys.min(axis=0) * BRICK_SHAPE - BELOW
    end = (keys.max(axis=0) + 1) * BRICK_SHAPE - BELOW
    (x, y, z), (nx, ny, nz) = first.tolist(), (end - first).tolist()
    return _grid_of(voxel_map, Window(voxel_map.resolution, (x, y, z), (nx, ny, nz)))


def _grid_of(a_map: ColumnMap, window: Window) -> Grid:
    nx, ny, nz = window.shape
    occupied, free = a_map.columns(window.first, (nx, ny, -(-nz // WORD_BITS)))
    states = unpack(free, nz) * np.uint8(FREE) + unpack(occupied, nz) * np.uint8(OCCUPIED)
    return Grid(states, window.origin, window.resolution)


def _read_log(path: Path, config: Config) -> Grid:
    """Return the map at the end of a log, built again from its sweeps."""
    del config
    log = open_log(path)
    begins = {fork.at for fork in log.forks}
    parts = [*(fork.beams for fork in log.forks), log.beams]
    mapper = Mapper(log.config, log.mission, parts[0])
    for record in log.records():
        if record.inputs.sequence in begins:
            parts.pop(0)
            mapper.set_sensors(parts[0])
        mapper.integrate(record.inputs)
    window = Window.covering(log.mission.low, log.mission.high, log.config.map.resolution)
    return _grid_of(mapper.map, window)


def _read_world(path: Path, config: Config) -> Grid:
    return grid_of_world(read_world_file(path), config.map.resolution)


READERS: dict[str, Callable[[Path, Config], Grid]] = {
    ".yaml": _read_occupancy_map,
    ".bt": _read_octomap,
    ".ot": _read_octomap,
    ".map": _read_own_map,
    ".mcap": _read_log,
    ".xml": _read_world,
}
"""Reader by the ending of a file's name."""
