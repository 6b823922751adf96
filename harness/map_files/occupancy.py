"""Writer of occupancy maps as Nav2's map_server reads them: a `.yaml` and a `.pgm` beside it.

Values of a pixel and the format are those of `nav2_map_server` and of ROS 1's `map_saver`, mode
trinary. The threshold of free space is the latter's 0.196: with the 0.25 that Nav2's saver writes,
its loader takes the grey of unknown cells (205, an occupancy of 0.1961) for free.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.map_files.cells import FlatMap
from wayproof.harness.outputs import written_whole
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

GREYS = {OCCUPIED: 0, UNKNOWN: 205, FREE: 254}
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196


def write_occupancy_map(flat: FlatMap, path: Path) -> int:
    """Write a map as `path`, which ends in `.yaml`, and its image; return the number of cells.

    Raises:
        InputError: A file cannot be written, or the image's name would break the text.
    """
    image = path.with_suffix(".pgm")
    if not image.name.isprintable() or any(sign in image.name for sign in "'\"#:"):
        raise InputError(f"--map: name '{image.name}', expected one without ' \" # :")
    with written_whole(path, "--map") as text, written_whole(image, "--map") as picture:
        picture.write_bytes(as_pgm(flat.states))
        text.write_text(as_yaml(flat, image.name))
    return flat.states.size


def as_pgm(states: NDArray[np.uint8]) -> bytes:
    """Return the states (nx, ny) as a grey image: x to the right, y up."""
    table = np.zeros(max(GREYS) + 1, np.uint8)
    for state, grey in GREYS.items():
        table[state] = grey
    pixels = np.ascontiguousarray(table[states].T[::-1])
    rows, columns = pixels.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes()


def as_yaml(flat: FlatMap, image: str) -> str:
    """Return the text that describes the image."""
    x, y = (float(value) for value in flat.origin)
    return (
        f"image: {image}\n"
        "mode: trinary\n"
        f"resolution: {flat.resolution!r}\n"
        f"origin: [{x!r}, {y!r}, 0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESHOLD}\n"
        f"free_thresh: {FREE_THRESHOLD}\n"
    )
