"""Flat occupancy maps as ROS saves them: a `.yaml` and the grey image that it names.

Source: the documentation of Nav2's map_server. A pixel's occupancy is (255 - grey) / 255, or
grey / 255 where `negate` is set; above `occupied_thresh` it is occupied, below `free_thresh` free.
In the mode `raw` the grey itself is the percentage, whatever `negate` says, and unknown above 100.
As in Nav2's `map_io.cpp` the grey of a colour is the mean of its channels, the opacity is one more
of them in the mode `trinary`, and a pixel that is not opaque is unknown in the mode `scale`. Here
so it is in the mode `raw`, and in no mode is a pixel free that is not opaque or not by its colours.
Nav2's savers wrote a `free_thresh` of 0.25 beside the grey 205 of unknown, which that makes free:
in the mode `trinary` it is unknown here where the image holds a saver's levels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.cells import cell_boxes
from wayproof.models.world_files.images import MapImage, read_map_image
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import vector
from wayproof.models.world_files.reading import WorldFileError, beside, read_text

NEEDED = ("image", "resolution", "origin", "occupied_thresh", "free_thresh")
MODES = ("trinary", "scale", "raw")
FLAGS = {
    **dict.fromkeys(("0", "false", "no", "off", "n"), False),
    **dict.fromkeys(("1", "true", "yes", "on", "y"), True),
}
LARGEST_YAML = 64 * 2**10

SAVED_UNKNOWN = 205
"""Grey that map savers of ROS write where a cell is unknown; 0 is occupied and 254 free."""

SAVED_LEVELS = (0, SAVED_UNKNOWN, 254, 255)
SAVED_SHARE = 0.99
"""Share of those levels from which an image is a saver's."""


class OccupancyGrid(NamedTuple):
    """A flat map as its file holds it.

    Attributes:
        occupied: (nx, ny) cells.
        free: (nx, ny) cells; what is neither is unknown.
        resolution: Edge of a cell, m.
        origin: Corner of the first cell, x and y, m, and turn about it, rad.
        saved_unknown: Number of cells that a saver wrote as unknown and `free_thresh` makes free.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    origin: Vector3
    saved_unknown: int = 0


def read_occupancy_grid(path: Path) -> OccupancyGrid:
    """Read the states of an occupancy map.

    Raises:
        WorldFileError: Naming the entry.
    """
    entries = _entries(path)
    origin = _numbers(path, entries, "origin", "[x, y, yaw]", 3)
    resolution = _number(path, entries, "resolution", 1e-4, 100.0)
    most = _number(path, entries, "occupied_thresh", 0.0, 1.0)
    least = _number(path, entries, "free_thresh", 0.0, 1.0)
    negate = FLAGS[_word(path, entries, "negate", "0", FLAGS)]
    mode = _word(path, entries, "mode", MODES[0], MODES)
    image = read_map_image(beside(path, "".join(entries["image"])))

    def states(levels: NDArray[Any], white: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        occupancy = _occupancies(white, mode, negate)
        return (occupancy > most)[levels], (occupancy < least)[levels]  # NaN is neither

    occupied, free = states(image.grey, image.white)
    if image.opacity is not None:
        opaque = image.opacity == image.white // 3
        if mode == "trinary":
            blended = states(image.grey + image.opacity, image.white + image.white // 3)
            occupied, free = blended[0], free & blended[1] & opaque
        else:
            occupied, free = occupied & opaque, free & opaque
    hidden = np.zeros_like(free)
    if mode == "trinary" and not negate:
        hidden = free & _saved_as_unknown(image)
        free &= ~hidden
    upwards = occupied[::-1].T, free[::-1].T
    return OccupancyGrid(*upwards, resolution, vector(origin), int(hidden.sum()))


def read_occupancy_map(path: Path, options: ImportOptions) -> Found:
    """Read occupied cells, extruded from the floor to `options.height`.

    Raises:
        WorldFileError: Naming the entry.
    """
    occupied, free, resolution, origin, hidden = read_occupancy_grid(path)
    unknown = ~(occupied | free)
    solid = occupied | unknown if options.unknown == "occupied" else occupied
    x, y, yaw = origin
    cell = (resolution, resolution, options.height)
    parts = cell_boxes(path, solid[:, :, None], cell, (x, y, 0.0), yaw)
    found = Found(parts=parts, plane=True, closed=True)
    found.notes.append(
        f"{occupied.sum()} cells occupied, {unknown.sum()} unknown, taken as {options.unknown}"
    )
    if hidden:
        found.notes.append(
            f"{hidden} of them have the grey {SAVED_UNKNOWN} of a saver's unknown, which "
            "free_thresh would make free"
        )
    return found


def _saved_as_unknown(image: MapImage) -> NDArray[np.bool_]:
    """Return the pixels that a map saver wrote as unknown; none in an image of other levels."""
    levels = image.grey.astype(np.int64) * 255
    saved = np.isin(levels, [level * image.white for level in SAVED_LEVELS])
    unknown = levels == SAVED_UNKNOWN * image.white
    return unknown if saved.mean() >= SAVED_SHARE else np.zeros_like(unknown)


def _occupancies(white: int, mode: str, negate: bool) -> NDArray[np.float64]:
    """Return the occupancy of each grey level up to the highest; NaN: unknown."""
    grey = np.arange(white + 1) / white
    if mode == "raw":
        percent = np.rint(grey * 255.0)
        return np.where(percent <= 100.0, percent / 100.0, np.nan)
    return grey if negate else 1.0 - grey


def _entries(path: Path) -> dict[str, list[str]]:
    """Return the words of the entries of the first document, one but for a list.

    Scalars keep their text: each is read as yaml-cpp reads it for what is wanted of it. What is
    nested deeper, as by aliases of aliases, is not looked at.
    """
    try:
        entries = next(yaml.load_all(read_text(path, LARGEST_YAML), yaml.BaseLoader), None)
    except (yaml.YAMLError, RecursionError) as error:
        raise WorldFileError(path, f"no YAML ({' '.join(str(error).split())[:100]})") from None
    if not isinstance(entries, dict):
        raise WorldFileError(path, f"expected a mapping with {', '.join(NEEDED)}")
    missing = [key for key in NEEDED if key not in entries]
    if missing:
        raise WorldFileError(path, f"no {', '.join(missing)}")
    listed = {key: one if isinstance(one, list) else [one] for key, one in entries.items()}
    return {key: [word if isinstance(word, str) else "" for word in words]
            for key, words in listed.items()}  # fmt: skip


def _numbers(
    path: Path, entries: dict[str, list[str]], key: str, expected: str, count: int = 1,
    low: float = -math.inf, high: float = math.inf,
) -> list[float]:  # fmt: skip
    try:
        values = [float(word) for word in entries[key]]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(v) and low <= v <= high for v in values):
        got = ", ".join(entries[key])[:60]
        raise WorldFileError(path, f"{key}: got '{got}', expected {expected}")
    return values


def _number(path: Path, entries: dict[str, list[str]], key: str, low: float, high: float) -> float:
    return _numbers(path, entries, key, f"{low:g} to {high:g}", 1, low, high)[0]


def _word(
    path: Path, entries: dict[str, list[str]], key: str, default: str, known: Iterable[str]
) -> str:
    """Return an entry in lower case, one of the known words."""
    word = ", ".join(entries.get(key, [default])).lower()
    if word not in known:
        raise WorldFileError(path, f"{key}: got '{word[:60]}', expected {', '.join(known)}")
    return word
