"""Grey images: PGM read here, PNG by Pillow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.imports.reading import MOST_CELLS, Unreadable, check_file

Image = NDArray[np.uint8] | NDArray[np.uint16]


def read_image(path: Path) -> Image:
    """Grey levels (rows, columns), the first row at the top: 8 or 16 bits, 0 is black.

    Raises:
        Unreadable: Neither PGM nor PNG, broken, or too large.
    """
    check_file(path)
    if path.suffix.lower() == ".pgm":
        return _pgm(path)
    if path.suffix.lower() != ".png":
        raise Unreadable(path, "expected an image in PGM or PNG")
    return _png(path)


def _pgm(path: Path) -> Image:
    """Netpbm's grey format, plain (P2) or raw (P5)."""
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
        raise Unreadable(path, "no PGM image")
    width, height, most = (int(word) for word in words[1:])
    if not (0 < width * height <= MOST_CELLS and 0 < most < 65536):
        raise Unreadable(path, f"{width} x {height} pixels up to {most}: not an image taken here")
    kind = np.dtype(np.uint8 if most < 256 else ">u2")
    if words[0] == b"P5":
        body = data[at + 1 : at + 1 + width * height * kind.itemsize]
    else:
        try:
            body = np.array(data[at:].split()[: width * height], np.int64).astype(kind).tobytes()
        except ValueError:
            raise Unreadable(path, "a grey level that is no number") from None
    if len(body) != width * height * kind.itemsize:
        raise Unreadable(path, f"ends early: expected {width} x {height} pixels")
    levels = np.frombuffer(body, kind).reshape(height, width).astype(np.float64)
    if most == 255:
        return levels.astype(np.uint8)
    return np.rint(levels * (65535.0 / most)).clip(0, 65535).astype(np.uint16)


def _png(path: Path) -> Image:
    try:
        from PIL import Image as pillow
    except ImportError:
        raise Unreadable(path, "PNG images need Pillow: pip install pillow") from None
    try:
        with pillow.open(path, formats=["PNG"]) as image:
            if image.width * image.height > MOST_CELLS:
                raise Unreadable(path, f"{image.width} x {image.height} pixels: too large")
            deep = image.mode.startswith("I")
            levels = np.array(image if deep else image.convert("L"))
    except (OSError, ValueError, SyntaxError) as error:
        if isinstance(error, Unreadable):
            raise
        raise Unreadable(path, f"no PNG image ({str(error)[:100]})") from None
    return levels.astype(np.uint16) if deep else levels.astype(np.uint8)
