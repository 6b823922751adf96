"""Movie of a log in simulated time, as GIF or MP4."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import check_folder
from wayproof.harness.outputs import check_target, written_whole
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.top_view import TopView

LEAST_PERIOD = 0.02
"""Minimum period of frames, s: viewers play no GIF faster."""

GREATEST_PERIOD = 60.0

GIF_COLOURS = 128

MP4_QUALITY = "23"
"""Constant rate factor; the default of x264."""

Frames = Iterator[Image.Image]


def check_movie(out: Path, period_s: float) -> None:
    """Check all that would otherwise fail after everything is simulated or drawn.

    Raises:
        InputError: The extension or the period is wrong, an encoder is missing, or the folder is
            not writable.
    """
    if out.suffix not in MOVIES:
        endings = " or ".join(MOVIES)
        raise InputError(f"picture '{out}': expected a name that ends in {endings}")
    if not LEAST_PERIOD <= period_s <= GREATEST_PERIOD:
        raise InputError(
            f"--period: got {period_s:g}, expected {LEAST_PERIOD:g} to {GREATEST_PERIOD:g} s"
        )
    if out.suffix == ".mp4":
        _encoder()
    check_target(out, "picture")
    check_folder(out.parent)


def draw_movie(path: Path, out: Path, period_s: float, allow_plugins: bool = False) -> int:
    """Draw a log, one frame per period of simulated time; return the number of frames.

    Raises:
        InputError: The log cannot be read, or the file cannot be written.
    """
    frames = _frames(path, period_s, allow_plugins)
    first = next(frames, None)
    if first is None:
        raise InputError(f"log '{path}': no decisions in it")
    with written_whole(out, "picture") as partial:
        return MOVIES[out.suffix](partial, chain([first], frames), period_s)


def _frames(path: Path, period_s: float, allow_plugins: bool) -> Frames:
    log = open_log(path, allow_plugins)
    view, next_ns = TopView(log), 0
    for moment in moments(log):
        view.follow(moment)
        if moment.time_ns >= next_ns:
            next_ns = moment.time_ns + round(period_s * 1e9) - 1
            yield view.draw(moment)


def _write_gif(path: Path, frames: Frames, period_s: float) -> int:
    few = [one.quantize(GIF_COLOURS, dither=Image.Dither.NONE) for one in frames]
    few[0].save(
        path, format="gif", save_all=True, append_images=few[1:], duration=round(period_s * 1e3),
        loop=0, optimize=True,
    )  # fmt: skip
    return len(few)


def _write_mp4(path: Path, frames: Frames, period_s: float) -> int:
    """Write H.264 by PyAV."""
    av, count = _encoder(), 0
    first = next(frames)
    with av.open(str(path), "w", format="mp4") as file:
        rate = 1 / Fraction(period_s).limit_denominator(1000)
        stream = file.add_stream("libx264", rate, options={"crf": MP4_QUALITY})
        stream.width, stream.height = first.size
        stream.pix_fmt = "yuv420p"  # the format that browsers play
        for frame in chain([first], frames):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(frame), format="rgb24")))
            count += 1
        file.mux(stream.encode(None))
    return count


MOVIES: dict[str, Callable[[Path, Frames, float], int]] = {".gif": _write_gif, ".mp4": _write_mp4}
"""Writers of movies by file extension; each returns the number of frames."""


def _encoder() -> Any:
    try:
        import av
    except ModuleNotFoundError:
        raise InputError(
            "no encoder for .mp4 here: pip install av (the extra 'video'), or name a .gif"
        ) from None
    return av
