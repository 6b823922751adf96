"""Grey images: PGM, PNG and TIFF, by Pillow."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.reading import MAX_HEIGHTS, WorldFileError, check_file

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

MAX_PIXELS = 2**26
"""Maximum number of pixels of an image: 8192 x 8192."""

FORMATS = {".pgm": "PPM", ".png": "PNG", ".tif": "TIFF", ".tiff": "TIFF"}
"""Pillow's formats by the ending of a file's name."""

PNG_HEADER = struct.Struct(">8s4s4sII")
"""Layout of a PNG's head: signature, length and name of its first chunk, width, height."""

SIGNATURE = b"\x89PNG\r\n\x1a\n"

Read = TypeVar("Read")


class MapImage(NamedTuple):
    """Pixels of a flat map, the first row at the top; 0 is black.

    Attributes:
        grey: (rows, columns) sum of the channels of a colour, or the grey itself.
        white: Level of white in it.
        opacity: (rows, columns) 0 to a third of `white`; None if all is opaque.
    """

    grey: NDArray[np.unsignedinteger[Any]]
    white: int
    opacity: NDArray[np.unsignedinteger[Any]] | None = None


def read_map_image(path: Path) -> MapImage:
    """Read the pixels of a flat map.

    Raises:
        WorldFileError: As `read_elevation`.
    """
    return _opened(path, _map_image, MAX_PIXELS)


def read_elevation(path: Path) -> tuple[NDArray[np.float64], bool]:
    """Return heights (rows, columns) of a grey image, 0 to 1, or of a TIFF with real numbers, m.

    Returns:
        The heights, the first row at the top; and whether they are in metres.

    Raises:
        WorldFileError: Another format, broken, or too large.
    """
    levels = _opened(path, _levels, MAX_HEIGHTS)
    if levels.dtype.kind == "f":
        return levels.astype(np.float64), True
    return levels / float(np.iinfo(levels.dtype).max), False


def png_size(path: Path) -> tuple[int, int] | None:
    """Return the width and height in a PNG's header, before unpacking; None for others."""
    with path.open("rb") as file:
        head = file.read(PNG_HEADER.size)
    if len(head) < PNG_HEADER.size or not head.startswith(SIGNATURE):
        return None
    _, _, _, width, height = PNG_HEADER.unpack(head)
    return width, height


def _levels(image: PillowImage) -> NDArray[Any]:
    """Return grey levels of 8 or 16 bits, or real numbers."""
    if image.mode == "F":
        return np.array(image)
    if not image.mode.startswith("I"):
        return np.array(image.convert("L"))
    levels = np.array(image)
    if levels.min() < 0 or levels.max() > 65535:
        raise ValueError(f"levels of {levels.min()} to {levels.max()}, expected 16 bits")
    return levels.astype(np.uint16)


def _map_image(image: PillowImage) -> MapImage:
    if image.mode == "F":
        raise ValueError("real numbers, expected grey levels")
    if image.mode.startswith("I"):
        levels = _levels(image)
        clear = image.info.get("transparency")
        if clear is None:
            return MapImage(levels, 65535)
        opacity = np.where(levels == clear, 0, 65535).astype(np.uint32)
        return MapImage(3 * levels.astype(np.uint32), 3 * 65535, opacity)
    if image.mode == "L" and not image.has_transparency_data:
        return MapImage(np.array(image), 255)
    channels = np.asarray(image.convert("RGBA"))
    colours = channels[:, :, :3].sum(axis=2, dtype=np.uint32)
    return MapImage(colours, 3 * 255, channels[:, :, 3] if image.has_transparency_data else None)


def _opened(path: Path, read: Callable[[PillowImage], Read], most: int) -> Read:
    """Open an image of one of `FORMATS` and read it; any error is one line."""
    from PIL import Image

    check_file(path)
    if path.suffix.lower() not in FORMATS:
        raise WorldFileError(
            path, f"image format '{path.suffix}' (available: {', '.join(FORMATS)})"
        )
    kind = FORMATS[path.suffix.lower()]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of tags that nothing here reads
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=[kind]) as image:
                width, height = image.size
                if not 0 < width * height <= most:
                    raise ValueError(f"{width} x {height} pixels, expected 1 to {most}")
                return read(image)
    except (OSError, ValueError, SyntaxError, Warning, Image.DecompressionBombError) as error:
        raise WorldFileError(path, f"no {kind} image ({str(error)[:100]})") from None
