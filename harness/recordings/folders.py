"""Recordings that are folders: a file for each sweep, read one by one, and files with the poses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.beams import FARTHEST, Beams, Limits
from wayproof.harness.recordings.depth import depth_beams, depths_of
from wayproof.harness.recordings.options import Broken, Faults, Intrinsics, RecordingOptions
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.recording import Recording, Stream, recording_of, sensor_of
from wayproof.harness.recordings.transform import Transform, compose, inverse, quaternion_of
from wayproof.harness.recordings.types import SensorKind

MOST_BYTES = 2**28
MOST_STAMP_S = 9_000_000_000
"""Greatest stamp, s: that of 64 bits of nanoseconds."""

MOST_SWEEPS = 1_000_000
MOST_PIXELS = 2**24

SKEW = 0.05
"""Greatest difference of R R' from the identity: beyond it a matrix is no rotation."""

ReadBeams = Callable[[Path, Limits, Faults], Beams]
"""Reads the beams of a file; raises `Broken` if it cannot."""


class Folder(NamedTuple):
    """Contents of a folder.

    Attributes:
        format: Name of the format.
        sensor: Name of the sensor.
        kind: Kind of the sensor.
        files: Stamp, ns, and file of each sweep.
        poses: T_world_body.
        mount: T_body_sensor.
        source: Source of the poses, in words.
        chosen: Further choices and assumptions, in words.
        others: Further files that were read.
        read: Reader of a sweep's file.
    """

    format: str
    sensor: str
    kind: SensorKind
    files: Sequence[tuple[int, Path]]
    poses: StampedPoses
    mount: Transform
    source: str
    chosen: str
    others: Sequence[Path]
    read: ReadBeams


def open_folder(path: Path, found: Folder, options: RecordingOptions, faults: Faults) -> Recording:
    """Open a folder as a recording. With a mount, the body is what carries the sensor.

    Raises:
        InputError: No sweep, no pose, or another sensor was requested.
    """
    if not 0 < len(found.files) <= MOST_SWEEPS:
        said = "no sweep in it" if not found.files else f"more than {MOST_SWEEPS} sweeps"
        raise InputError(said)
    if options.sensors not in ((), (found.sensor,)):
        raise InputError(f"no sensor '{options.sensors[0]}', there is '{found.sensor}'")
    poses, mount, source = found.poses, found.mount, found.source
    if (T_body_sensor := options.T_body_sensor) is not None:
        poses = of_body(poses, T_body_sensor, turn_world=False)
        mount, source = compose(T_body_sensor, mount), f"{source}, moved to the body"
    sensor = sensor_of(found.sensor, found.kind, options)
    paths = [one for _, one in found.files]
    more = f"; {found.chosen}" if found.chosen else ""
    stream = Stream(
        sensor=sensor,
        stamps=np.array([stamp for stamp, _ in found.files], np.int64),
        payloads=partial(iter, paths),
        read=partial(_read, found.read, Limits(0.0, FARTHEST, sensor.range_max, False)),
        mount=mount,
    )
    files = [one for one in [*found.others, *paths] if one.is_file()]
    return recording_of(
        path,
        found.format,
        files,
        [stream],
        poses,
        source + more,
        options,
        faults,
        str(len(paths)) + " sweeps",
    )


def _read(read: ReadBeams, limits: Limits, path: Path, faults: Faults) -> Beams:
    try:
        return read(path, limits, faults)
    except OSError as error:
        raise Broken(f"{path.name}: {error.strerror}") from None


def rows(path: Path, most: int = MOST_BYTES) -> Iterator[list[str]]:
    """Yield the words of each line of a text file; `#` begins a comment.

    Raises:
        InputError: No such file, or over a number of bytes.
    """
    try:
        if path.stat().st_size > most:
            raise InputError(f"{path.name}: over {most} bytes")
        with path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                words = line.partition("#")[0].split()
                if words:
                    yield words
    except OSError as error:
        raise InputError(f"{path.name}: {error.strerror}") from None


def nanoseconds(word: str) -> int:
    """Return a number of seconds as nanoseconds, exactly.

    Raises:
        ValueError, ArithmeticError: It is no number, or more than 64 bits hold.
    """
    seconds = Decimal(word)
    if not abs(seconds) < MOST_STAMP_S:
        raise ValueError(word)
    return int((seconds * 10**9).to_integral_value())


def matrix_of(words: Sequence[str]) -> list[float] | None:
    """Return the numbers of a matrix (3, 4) or (4, 4), row by row; None if it is none."""
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) in (12, 16) else None


def stamped(stamps_ns: Sequence[int], numbers: list[list[float]], faults: Faults) -> StampedPoses:
    """Return poses of matrices (n, 12 or 16), row by row; invalid ones are counted."""
    table = np.array([row[:12] for row in numbers], np.float64).reshape(-1, 3, 4)
    R = table[:, :, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        products = (R[:, :, None, :] * R[:, None, :, :]).sum(axis=3)
        minors = np.cross(R[:, 0], R[:, 1])
        good = np.abs(products - np.eye(3)).max(axis=(1, 2), initial=0.0) < SKEW
        good &= (minors * R[:, 2]).sum(axis=1) > 0.0
    good &= np.isfinite(table).all(axis=(1, 2))
    faults["pose: no rotation"] += int((~good).sum())
    kept = table[good]
    quaternions = np.array([quaternion_of(one) for one in kept[:, :, :3]]).reshape(-1, 4)
    return StampedPoses(np.array(stamps_ns, np.int64)[good], kept[:, :, 3], quaternions)


def of_body(poses: StampedPoses, T_body_frame: Transform, turn_world: bool) -> StampedPoses:
    """Return poses of a body from those of a frame on it.

    Args:
        poses: T_world_frame.
        T_body_frame: Place of the frame on the body.
        turn_world: Whether the world's frame is turned as the frame is on the body, too: where the
            poses are relative to the first one, the world is then one with z up.
    """
    moved = compose(Transform(poses.positions, poses.quaternions), inverse(T_body_frame))
    if turn_world:
        moved = compose(T_body_frame, moved)
    return poses._replace(positions=moved.position, quaternions=moved.quaternion)


def depth_reader(options: RecordingOptions, intrinsics: Intrinsics, scale: float) -> ReadBeams:
    """Return the reader of depth images of a camera, in units of so many in a metre."""

    def read(path: Path, limits: Limits, faults: Faults) -> Beams:
        depths = depths_of(_pixels(path), options.depth_scale or scale)
        return depth_beams(depths, intrinsics, options.pixel_stride, limits, faults)

    return read


def _pixels(path: Path) -> NDArray[np.int64]:  # (rows, columns)
    """Return the pixels of a grey image of 16 bits.

    Raises:
        Broken: It is none, or of more than `MOST_PIXELS`.
    """
    from PIL import Image

    try:
        with Image.open(path, formats=["PNG", "PPM", "TIFF"]) as image:
            if image.width * image.height > MOST_PIXELS:
                raise Broken(f"{path.name}: {image.width} x {image.height} pixels")
            if not image.mode.startswith("I"):
                raise Broken(f"{path.name}: mode {image.mode}, expected 16 bits of grey")
            return np.asarray(image, np.int64)
    except Broken:
        raise
    except Exception as error:  # the decoders of Pillow fail in many ways
        raise Broken(f"{path.name}: {type(error).__name__}") from None
