"""Animation of a log in simulated time, as GIF or MP4."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import AbstractContextManager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from PIL import Image

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import check_folder
from wayproof.harness.outputs import check_target, written_whole
from wayproof.harness.viewer.caption import legend_colours
from wayproof.harness.viewer.driver import check_driver
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.picture import Stage, drawn

LEAST_PERIOD = 0.02
"""Minimum period of frames, s: viewers play no GIF faster."""

GREATEST_PERIOD = 60.0

GIF_COLOURS = 64
"""Colours of a frame besides those of the legend, which would otherwise become one another's."""

MP4_QUALITY = "23"
"""Constant rate factor; the default of x264."""


class Movie(AbstractContextManager["Movie"], Protocol):
    """File of frames, complete once its context has ended."""

    size: tuple[int, int]

    def add(self, frame: Image.Image) -> None:
        """Add a frame."""


class Gif:
    """Animated GIF; frames are kept in memory, in few colours."""

    size = (720, 480)

    def __init__(self, path: Path, period_s: float) -> None:
        """Create it without frames; each is shown for a period, s."""
        self._path, self._period_ms = path, round(period_s * 1e3)
        self._frames: list[Image.Image] = []

    def __enter__(self) -> Self:
        """Return this movie."""
        return self

    def add(self, frame: Image.Image) -> None:
        """Add a frame."""
        self._frames.append(_in_few_colours(frame))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Write the frames, unless an exception was raised."""
        if kind is None and self._frames:
            first, *others = self._frames
            first.save(
                self._path,
                format="gif",
                save_all=True,
                append_images=others,
                duration=self._period_ms,
                loop=0,
                optimize=True,
            )


def _in_few_colours(frame: Image.Image) -> Image.Image:
    few = frame.quantize(GIF_COLOURS, dither=Image.Dither.NONE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(few[: 3 * GIF_COLOURS] + list(itertools.chain(*legend_colours())))
    return frame.quantize(palette=palette, dither=Image.Dither.NONE)


class Mp4:
    """H.264 in MP4, by PyAV; frames are encoded at once."""

    size = (720, 480)

    def __init__(self, path: Path, period_s: float) -> None:
        """Open the file; each frame is shown for a period, s."""
        av = _encoder()
        self._frame_of = av.VideoFrame.from_ndarray
        self._file = av.open(str(path), "w", format="mp4")
        rate = 1 / Fraction(period_s).limit_denominator(1000)
        self._stream = self._file.add_stream("libx264", rate, options={"crf": MP4_QUALITY})
        self._stream.width, self._stream.height = self.size
        self._stream.pix_fmt = "yuv420p"  # the format that browsers play

    def __enter__(self) -> Self:
        """Return this movie."""
        return self

    def add(self, frame: Image.Image) -> None:
        """Add a frame."""
        self._file.mux(self._stream.encode(self._frame_of(np.asarray(frame), format="rgb24")))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the file, unless an exception was raised."""
        if kind is None:
            self._file.mux(self._stream.encode(None))
        self._file.close()


MOVIES: dict[str, Callable[[Path, float], Movie]] = {".gif": Gif, ".mp4": Mp4}
"""Types of animations by file extension."""


def check_movie(out: Path, period_s: float) -> None:
    """Check all that would otherwise fail after everything is simulated or drawn.

    Raises:
        InputError: The extension or the period is wrong, an encoder or a driver is missing, or the
            folder is not writable.
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
    check_driver()


def draw_movie(path: Path, out: Path, period_s: float, allow_plugins: bool = False) -> int:
    """Draw a log, one frame per period of simulated time; return the number of frames.

    Raises:
        InputError: The log cannot be read, the file cannot be written, or nothing can be drawn.
    """
    log = open_log(path, allow_plugins)
    count = next_ns = 0
    with written_whole(out, "picture") as partial:
        with (
            MOVIES[out.suffix](partial, period_s) as movie,
            Stage(log, movie.size, smooth=False) as stage,
        ):
            for moment in moments(log):
                stage.follow(moment)
                if moment.time_ns >= next_ns:
                    next_ns = moment.time_ns + round(period_s * 1e9) - 1
                    movie.add(drawn(stage, moment))
                    count += 1
        if not count:
            raise InputError(f"log '{path}': no decisions in it")
    return count


def _encoder() -> Any:
    try:
        import av
    except ModuleNotFoundError:
        raise InputError(
            "no encoder for .mp4 here: pip install av (the extra 'video'), or name a .gif"
        ) from None
    return av
