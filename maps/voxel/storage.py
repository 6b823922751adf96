"""The file of a voxel map: one header, one record for each brick, one checksum."""

from __future__ import annotations

import hashlib
import json
import os
import struct
from dataclasses import asdict
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.config import DynamicConfig, MapConfig
from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.voxel.bricks import Bricks

MAGIC = b"wayproof voxels 1\n"
HEAD = struct.Struct("<IqI")  # bytes of the settings, ticks, bricks
MAX_SETTINGS = 1 << 16  # bytes
CHECKSUM = 16  # bytes
RECORD = np.dtype(
    [
        ("key", "<i4", 3),
        ("observed_ns", "<i8"),
        ("ticks", "<i8"),
        ("dues", "<i8"),
        ("fresh", "<u8", kernels.COLUMNS),
        ("cells", "i1", (kernels.COLUMNS, kernels.HEIGHT)),
    ]
)


def write(path: str | PathLike[str], config: MapConfig, ticks: int, bricks: Bricks) -> None:
    """Write a map; equal maps give equal files.

    The file is written beside its place and then renamed: a reader never sees half of one.

    Raises:
        OSError: The file cannot be written.
    """
    live = bricks.live()
    live = live[np.lexsort(bricks.keys[live].T[::-1])]
    settings = json.dumps(asdict(config), sort_keys=True).encode()
    final = Path(path)
    temporary = final.with_name(f".{final.name}.{os.getpid()}")
    checksum = hashlib.blake2b(digest_size=CHECKSUM)
    try:
        with temporary.open("wb") as file:
            for part in (MAGIC, HEAD.pack(len(settings), ticks, len(live)), settings):
                checksum.update(part)
                file.write(part)
            for slot in live:
                record = _record(bricks, slot).tobytes()
                checksum.update(record)
                file.write(record)
            file.write(checksum.digest())
        temporary.replace(final)
    finally:
        temporary.unlink(missing_ok=True)


def read(path: str | PathLike[str]) -> tuple[MapConfig, int, NDArray[np.void]]:
    """Read the settings, the number of ticks and the records (k,) of a map.

    Raises:
        ValueError: The file is no map, was cut or changed, or holds more than its memory bound.
        OSError: The file cannot be read.
    """
    size = Path(path).stat().st_size
    with Path(path).open("rb") as file:
        start = file.read(len(MAGIC) + HEAD.size)
        if len(start) < len(MAGIC) + HEAD.size or not start.startswith(MAGIC):
            raise ValueError(f"{path}: no voxel map of this version")
        length, ticks, count = HEAD.unpack(start[len(MAGIC) :])
        expected = len(start) + length + count * RECORD.itemsize + CHECKSUM
        if length > MAX_SETTINGS or size != expected:
            raise ValueError(f"{path}: got {size} bytes, expected {expected}: cut or changed")
        rest = file.read(size - len(start))
    checksum = hashlib.blake2b(start, digest_size=CHECKSUM)
    checksum.update(memoryview(rest)[:-CHECKSUM])
    if checksum.digest() != rest[-CHECKSUM:]:
        raise ValueError(f"{path}: the checksum does not match: cut or changed")
    try:
        settings = json.loads(rest[:length])
        config = MapConfig(**settings | {"dynamic": DynamicConfig(**settings["dynamic"])})
    except (TypeError, KeyError) as error:
        raise ValueError(f"{path}: settings of another version: {error}") from None
    return config, ticks, np.frombuffer(rest, RECORD, count, length)


def restore(records: NDArray[np.void], bricks: Bricks, stamp: int) -> None:
    """Put records into a pool that holds no bricks yet.

    Raises:
        ValueError: The pool does not hold that many.
    """
    if len(records) > bricks.capacity:
        raise ValueError(f"map: got {len(records)} bricks, expected at most {bricks.capacity}")
    slots = bricks.obtain(np.ascontiguousarray(records["key"], np.int32), 0, stamp)
    bricks.observed_ns[slots] = records["observed_ns"]
    bricks.ticks[slots] = records["ticks"]
    bricks.dues[slots] = records["dues"]
    bricks.fresh[slots] = records["fresh"]
    bricks.cells[slots] = records["cells"]
    bricks.dirty[slots] = True
    bricks.stamps[slots] = stamp


def _record(bricks: Bricks, slot: int) -> NDArray[np.void]:
    record = np.zeros(1, RECORD)
    record["key"] = bricks.keys[slot]
    record["observed_ns"] = bricks.observed_ns[slot]
    record["ticks"] = bricks.ticks[slot]
    record["dues"] = bricks.dues[slot]
    record["fresh"] = bricks.fresh[slot]
    record["cells"] = bricks.cells[slot]
    return record
