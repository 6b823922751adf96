"""Depth images in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.beams import Beams, Limits
from wayproof.harness.recordings.depth import Intrinsics, depth_beams, depths_of
from wayproof.harness.recordings.folders import Unreadable
from wayproof.harness.recordings.recording import Faults

MOST_PIXELS = 2**24


class DepthFiles:
    """Reads depth images of 16 bits."""

    def __init__(self, intrinsics: Intrinsics, units_per_metre: float, stride: int) -> None:
        """Read images of a camera at a stride of pixels."""
        self._intrinsics, self._scale, self._stride = intrinsics, units_per_metre, stride

    def __call__(self, path: Path, limits: Limits, faults: Faults) -> Beams:
        """Return the beams of an image.

        Raises:
            Unreadable: It is no image of one channel of 16 bits.
        """
        depths = depths_of(read_pixels(path), self._scale)
        return depth_beams(depths, self._intrinsics, self._stride, limits, faults)


def read_pixels(path: Path) -> NDArray[np.int64]:  # (rows, columns)
    """Return the pixels of a grey image of 16 bits.

    Raises:
        Unreadable: It is none, or of more than `MOST_PIXELS`.
    """
    from PIL import Image

    try:
        with Image.open(path, formats=["PNG", "PPM", "TIFF"]) as image:
            if image.width * image.height > MOST_PIXELS:
                raise Unreadable(f"{path}: {image.width} x {image.height} pixels")
            if not image.mode.startswith("I"):
                raise Unreadable(f"{path}: mode {image.mode}, expected 16 bits of grey")
            return np.asarray(image, np.int64)
    except Unreadable:
        raise
    except Exception as error:  # the decoders of Pillow fail in many ways
        raise Unreadable(f"{path}: {type(error).__name__}") from None
