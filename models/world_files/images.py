"""Grey images: PGM read here, PNG and TIFF by Pillow."""

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

PNG_HEADER = struct.Struct(">8s4s4sII")
"""Layout of a PNG's head: signature, length and name of its first chunk, width, height."""

SIGNATURE = b"\x89PNG\r\n\x1a\n"

Image = NDArray[np.uint8] | NDArray[np.uint16]

Read = TypeVar("Read")


class MapImage(NamedTuple):
    """Pixels of a flat map, the first row at the top; 0 is black.

    Attributes:
        grey: (rows, columns) mean of red, green and blue.
        blended: (rows, columns) mean of red, green, blue and opacity; None if all is opaque.
        opaque: (rows, columns) pixels without any transparency; None if all is opaque.
        most: Level of white, and of full opacity, in both means.
    """

    grey: NDArray[np.unsignedinteger[Any]]
    blended: NDArray[np.unsignedinteger[Any]] | None
    opaque: NDArray[np.bool_] | None
    most: int


def read_image(path: Path, most: int = MAX_PIXELS) -> Image:
    """Read grey levels (rows, columns), the first row at the top: 8 or 16 bits, 0 is black.

    Args:
        path: A PGM or PNG.
        most: Maximum number of pixels, by its header.

    Raises:
        WorldFileError: Neither PGM nor PNG, broken, or too large.
    """
    check_file(path)
    if path.suffix.lower() == ".pgm":
        return _pgm(path, most)
    if path.suffix.lower() != ".png":
        raise WorldFileError(path, "expected an image in PGM or PNG")
    return _png(path, most)


def read_map_image(path: Path) -> MapImage:
    """Read the pixels of a flat map; the grey of a colour is the mean of its channels.

    Raises:
        WorldFileError: As `read_image`.
    """
    if path.suffix.lower() != ".png":
        image = read_image(path)
        return MapImage(image, None, None, int(np.iinfo(image.dtype).max))
    check_file(path)
    _check_png_size(path, MAX_PIXELS)
    return _opened(path, ["PNG"], _map_image, MAX_PIXELS)


def read_elevation(path: Path) -> tuple[NDArray[np.float64], bool]:
    """Return heights (rows, columns) of a grey image, 0 to 1, or of a TIFF with real numbers, m.

    Returns:
        The heights, the first row at the top; and whether they are in metres.

    Raises:
        WorldFileError: Another format, broken, or too large.
    """
    if path.suffix.lower() not in (".tif", ".tiff"):
        image = read_image(path, MAX_HEIGHTS)
        return image / float(np.iinfo(image.dtype).max), False
    check_file(path)
    levels = _opened(path, ["TIFF"], _levels, MAX_HEIGHTS)
    if levels.ndim != 2:
        raise WorldFileError(path, "an image in colour, expected one of heights")
    if levels.dtype.kind == "f":
        return levels.astype(np.float64), True
    return levels.astype(np.float64) / float(np.iinfo(levels.dtype).max), False


def _levels(image: PillowImage) -> NDArray[Any]:
    return np.array(image)


def _check_size(path: Path, width: int, height: int, most: int) -> None:
    if not 0 < width * height <= most:
        raise WorldFileError(path, f"{width} x {height} pixels, expected 1 to {most}")


def _pgm(path: Path, most_pixels: int) -> Image:
    """Read Netpbm's grey format, plain (P2) or raw (P5)."""
    data = path.read_bytes()
    words: list[bytes] = []
    at = 0
    while len(words) < 4 and at < len(data):
        if data[at : at + 1] == b"#":
            at = data.find(b"\n", at) % (len(data) + 1)  # a comment without an end ends the file
        elif data[at : at + 1].isspace():
            at += 1
        else:
            end = at
            while end < len(data) and not data[end : end + 1].isspace():
                end += 1
            words.append(data[at:end])
            at = end
    if len(words) < 4 or words[0] not in (b"P2", b"P5") or not all(map(bytes.isdigit, words[1:])):
        raise WorldFileError(path, "no PGM image")
    width, height, most = (int(word) for word in words[1:])
    _check_size(path, width, height, most_pixels)
    if not 0 < most < 65536:
        raise WorldFileError(path, f"grey levels up to {most}, expected 1 to 65535")
    kind = np.dtype(np.uint8 if most < 256 else ">u2")
    if words[0] == b"P5":
        body = data[at + 1 : at + 1 + width * height * kind.itemsize]
    else:
        try:
            plain = np.array(data[at:].split()[: width * height], np.int64)
        except (ValueError, OverflowError):
            raise WorldFileError(path, "a grey level that is no number") from None
        _check_levels(path, plain, most)
        body = plain.astype(kind).tobytes()
    if len(body) != width * height * kind.itemsize:
        raise WorldFileError(path, f"ends early: expected {width} x {height} pixels")
    levels = np.frombuffer(body, kind).reshape(height, width)
    _check_levels(path, levels, most)
    if most == 255:
        return levels.astype(np.uint8)
    shades = np.rint(np.arange(65536) * (65535.0 / most)).clip(0, 65535).astype(np.uint16)
    grey: Image = shades[levels]
    return grey


def _check_levels(path: Path, levels: NDArray[Any], most: int) -> None:
    wrong = levels[(levels < 0) | (levels > most)]
    if wrong.size:
        raise WorldFileError(path, f"a grey level of {wrong[0]}, expected 0 to {most}")


def png_size(path: Path) -> tuple[int, int] | None:
    """Return the width and height in a PNG's header, before unpacking; None for others."""
    with path.open("rb") as file:
        head = file.read(PNG_HEADER.size)
    if len(head) < PNG_HEADER.size or not head.startswith(SIGNATURE):
        return None
    _, _, _, width, height = PNG_HEADER.unpack(head)
    return width, height


def _check_png_size(path: Path, most: int) -> None:
    width, height = png_size(path) or (0, 0)
    _check_size(path, width, height, most)


def _map_image(image: PillowImage) -> MapImage:
    if image.mode.startswith("I"):
        return _deep_map_image(image)
    if not image.has_transparency_data:
        channels = np.asarray(image.convert("RGB"), np.uint16)
        return MapImage(channels.sum(axis=2, dtype=np.uint16), None, None, 3 * 255)
    channels = np.asarray(image.convert("RGBA"))
    return _means(channels[:, :, :3].sum(axis=2, dtype=np.uint32), channels[:, :, 3], 255)


def _deep_map_image(image: PillowImage) -> MapImage:
    """Return the pixels of an image in grey of 16 bits, of which one level may be transparent."""
    levels = np.asarray(image).astype(np.uint16)
    clear = image.info.get("transparency")
    if clear is None:
        return MapImage(levels, None, None, 65535)
    opacity = np.where(levels == clear, 0, 65535)
    return _means(3 * levels.astype(np.uint32), opacity, 65535)


def _means(colours: NDArray[np.uint32], opacity: NDArray[Any], most: int) -> MapImage:
    """Return both means in levels that hold thirds and quarters exactly."""
    blended = 3 * (colours + opacity.astype(np.uint32))
    return MapImage(4 * colours, blended, opacity == most, 12 * most)


def _png(path: Path, most: int) -> Image:
    _check_png_size(path, most)

    def grey(image: PillowImage) -> NDArray[Any]:
        deep = image.mode.startswith("I")
        levels = np.array(image if deep else image.convert("L"))
        return levels.astype(np.uint16) if deep else levels.astype(np.uint8)

    return _opened(path, ["PNG"], grey, most)


def _opened(path: Path, formats: list[str], read: Callable[[PillowImage], Read], most: int) -> Read:
    """Open an image of one of Pillow's formats and read it; any error is one line."""
    try:
        from PIL import Image as pillow
    except ImportError:
        raise WorldFileError(path, "images need Pillow: pip install pillow") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of tags that nothing here reads
            warnings.simplefilter("error", pillow.DecompressionBombWarning)
            with pillow.open(path, formats=formats) as image:
                _check_size(path, *image.size, most)
                return read(image)
    except (OSError, ValueError, SyntaxError, Warning, pillow.DecompressionBombError) as error:
        if isinstance(error, WorldFileError):
            raise
        what = f"no {' or '.join(formats)} image ({str(error)[:100]})"
        raise WorldFileError(path, what) from None
