"""Flat occupancy maps as ROS saves them: a `.yaml` and the grey image that it names.

Source: the documentation of Nav2's map_server. A pixel's occupancy is (255 - grey) / 255, or
grey / 255 where `negate` is set; above `occupied_thresh` it is occupied, below `free_thresh` free.
In the mode `raw` the grey itself is the percentage, whatever `negate` says, and unknown above 100.
As in Nav2's `map_io.cpp` the grey of a colour is the mean of its channels, the opacity is one more
of them in the mode `trinary`, and a pixel that is not opaque is unknown in the mode `scale`. Here
so it is in the mode `raw`, and in no mode is a pixel free that is not opaque or not by its colours.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.images import MapImage, read_map_image
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part, vector
from wayproof.models.world_files.reading import WorldFileError, beside, read_text
from wayproof.models.world_files.voxel_maps import cell_boxes

NEEDED = ("image", "resolution", "origin", "occupied_thresh", "free_thresh")
MODES = ("trinary", "scale", "raw")
FLAGS = {"0": False, "1": True, "false": False, "true": True}
LARGEST_YAML = 64 * 2**10


class OccupancyGrid(NamedTuple):
    """A flat map as its file holds it.

    Attributes:
        occupied: (nx, ny) cells.
        free: (nx, ny) cells; what is neither is unknown.
        resolution: Edge of a cell, m.
        origin: Corner of the first cell, x and y, m, and turn about it, rad.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    origin: Vector3


def read_occupancy_grid(path: Path) -> OccupancyGrid:
    """Read the states of an occupancy map.

    Raises:
        WorldFileError: Naming the line or the entry.
    """
    entries = _entries(path)
    origin = _list(path, entries, "origin", 3)
    resolution = _number(path, entries, "resolution", 1e-4, 100.0)
    most = _number(path, entries, "occupied_thresh", 0.0, 1.0)
    least = _number(path, entries, "free_thresh", 0.0, 1.0)
    negate = _flag(path, entries, "negate") if "negate" in entries else False
    mode, line = entries.get("mode", (MODES[0], 0))
    if mode not in MODES:
        raise WorldFileError(path, f"mode: got '{mode}', expected {', '.join(MODES)}", line)
    image = read_map_image(beside(path, entries["image"][0]))
    occupancy = _occupancies(image.most, mode, negate)
    occupied, free = _states(image, occupancy > most, occupancy < least, mode)  # NaN is neither
    return OccupancyGrid(occupied[::-1].T, free[::-1].T, resolution, vector(origin))  # upwards


def read_occupancy_map(path: Path, options: ImportOptions) -> Found:
    """Read occupied cells, extruded from the floor to `options.height`.

    Raises:
        WorldFileError: Naming the line or the entry.
    """
    occupied, free, resolution, origin = read_occupancy_grid(path)
    unknown = ~(occupied | free)
    solid = occupied | unknown if options.unknown == "occupied" else occupied
    parts = _walls(path, solid, resolution, origin, options.height)
    found = Found(parts=parts, plane=True, closed=True)
    found.notes.append(
        f"{occupied.sum()} cells occupied, {unknown.sum()} unknown, taken as {options.unknown}"
    )
    return found


def _states(
    image: MapImage, is_occupied: NDArray[np.bool_], is_free: NDArray[np.bool_], mode: str
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the occupied and the free pixels, given which levels are."""
    occupied, free = is_occupied[image.grey], is_free[image.grey]
    if image.blended is None or image.opaque is None:
        return occupied, free
    if mode == "trinary":
        return is_occupied[image.blended], free & is_free[image.blended] & image.opaque
    return occupied & image.opaque, free & image.opaque


def _occupancies(most: int, mode: str, negate: bool) -> NDArray[np.float64]:
    """Return the occupancy of each grey level up to the highest; NaN: unknown."""
    grey = np.arange(most + 1) / most
    if mode == "raw":
        percent = np.rint(grey * 255.0)
        return np.where(percent <= 100.0, percent / 100.0, np.nan)
    return grey if negate else 1.0 - grey


def _walls(
    path: Path, solid: NDArray[np.bool_], resolution: float, origin: Vector3, height: float
) -> list[Part]:
    """Merge cells (nx, ny) into boxes of the whole height, about the map's own low corner."""
    x, y, yaw = origin
    flat = cell_boxes(path, solid[:, :, None], resolution, (x, y, 0.0), yaw)
    return [
        replace(
            part, size=(*part.size[:2], height / 2.0), position=(*part.position[:2], height / 2.0)
        )
        for part in flat
    ]


def _entries(path: Path) -> dict[str, tuple[str, int]]:
    """Return the `key: value` lines with their numbers: such a file has nothing deeper."""
    entries: dict[str, tuple[str, int]] = {}
    for number, line in enumerate(read_text(path, LARGEST_YAML).splitlines(), start=1):
        bare = line.partition(" #")[0].strip()
        if not bare or bare.startswith("#") or bare == "---":
            continue
        key, colon, value = bare.partition(":")
        if not colon or line[0].isspace() or key in entries:
            raise WorldFileError(
                path, f"got '{bare[:60]}', expected one 'key: value' a line", number
            )
        entries[key.strip()] = (value.strip().strip("'\""), number)
    missing = [key for key in NEEDED if key not in entries]
    if missing:
        raise WorldFileError(path, f"no {', '.join(missing)}")
    return entries


def _number(
    path: Path, entries: dict[str, tuple[str, int]], key: str, low: float, high: float
) -> float:
    text, line = entries[key]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise WorldFileError(path, f"{key}: got '{text}', expected {low:g} to {high:g}", line)
    return value


def _flag(path: Path, entries: dict[str, tuple[str, int]], key: str) -> bool:
    text, line = entries[key]
    if text.lower() not in FLAGS:
        raise WorldFileError(path, f"{key}: got '{text}', expected {', '.join(FLAGS)}", line)
    return FLAGS[text.lower()]


def _list(path: Path, entries: dict[str, tuple[str, int]], key: str, count: int) -> list[float]:
    text, line = entries[key]
    try:
        values = [float(word) for word in text.strip("[]").split(",")]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise WorldFileError(path, f"{key}: got '{text}', expected [x, y, yaw]", line)
    return values
