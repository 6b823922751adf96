"""The content of a voxel map as records, one for each brick, and its file."""

from __future__ import annotations

import hashlib
import json
import os
import struct
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.config import DynamicConfig, MapConfig
from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.kernels.decay import NEVER
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

FIELDS = ("key", "observed_ns", "ticks", "dues", "fresh", "cells")
"""Fields of a record, in the order of `VoxelContent`."""


class VoxelContent(NamedTuple):
    """All that a voxel map holds besides its settings; bricks by ascending key.

    Attributes:
        ticks: Ticks of decay that the map has seen.
        keys: (k, 3) int32 index of each brick.
        observed_ns: (k,) time of its last observation, ns.
        seen: (k,) ticks of decay that its cells have seen.
        dues: (k,) tick at which it has to be looked at.
        fresh: (k, 256) uint64, cells that were updated since the last tick.
        cells: (k, 256, 64) int8, log-odds in units.
    """

    ticks: int
    keys: NDArray[np.int32]
    observed_ns: NDArray[np.int64]
    seen: NDArray[np.int64]
    dues: NDArray[np.int64]
    fresh: NDArray[np.uint64]
    cells: NDArray[np.int8]

    def check(self, ticks: int, time_ns: int, low: int, high: int) -> None:
        """Check that a map can have this content.

        Args:
            ticks: Ticks of decay until then.
            time_ns: Time of the map.
            low: Lower clamp of the log-odds, units.
            high: Upper clamp.

        Raises:
            ValueError: Bricks out of order, or numbers out of range.
        """
        x, y, z = self.keys.astype(np.int64).T
        order = (x * MOST_KEYS + y) * MOST_KEYS + z
        if (np.abs(self.keys) >= MOST_KEYS // 2).any() or (np.diff(order) <= 0).any():
            raise ValueError("bricks out of order")
        if self.ticks != ticks or not ((self.seen >= 0) & (self.seen <= ticks)).all():
            raise ValueError(f"ticks of decay other than {ticks}")
        if not ((self.observed_ns >= -1) & (self.observed_ns <= time_ns)).all():
            raise ValueError("observed in the future")
        if not ((self.dues > ticks) & (self.dues <= NEVER)).all():
            raise ValueError("overdue ticks of decay")
        if self.cells.size and not low <= self.cells.min() <= self.cells.max() <= high:
            raise ValueError(f"log-odds out of {low} to {high}")


MOST_KEYS = 1 << 20
"""Keys of bricks along an axis that a content may have, from -MOST_KEYS / 2."""


def content_of(bricks: Bricks, ticks: int) -> VoxelContent:
    """Copy all bricks in use."""
    live = bricks.live()
    live = live[np.lexsort(bricks.keys[live].T[::-1])]
    return VoxelContent(
        ticks=ticks,
        keys=bricks.keys[live],
        observed_ns=bricks.observed_ns[live],
        seen=bricks.ticks[live],
        dues=bricks.dues[live],
        fresh=bricks.fresh[live],
        cells=bricks.cells[live],
    )


def write(path: str | PathLike[str], config: MapConfig, ticks: int, bricks: Bricks) -> None:
    """Write a map; equal maps give equal files.

    The file is written beside its place and then renamed: a reader never sees half of one.

    Raises:
        OSError: The file cannot be written.
    """
    content = content_of(bricks, ticks)
    records = np.empty(len(content.keys), RECORD)
    for name, values in zip(FIELDS, content[1:], strict=True):
        records[name] = values
    settings = json.dumps(asdict(config), sort_keys=True).encode()
    final = Path(path)
    temporary = final.with_name(f".{final.name}.{os.getpid()}")
    checksum = hashlib.blake2b(digest_size=CHECKSUM)
    try:
        with temporary.open("wb") as file:
            head = HEAD.pack(len(settings), ticks, len(records))
            for part in (MAGIC, head, settings, records.tobytes()):
                checksum.update(part)
                file.write(part)
            file.write(checksum.digest())
        temporary.replace(final)
    finally:
        temporary.unlink(missing_ok=True)


def read(path: str | PathLike[str]) -> tuple[MapConfig, VoxelContent]:
    """Read the settings and the content of a map.

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
    records = np.frombuffer(rest, RECORD, count, length)
    return config, VoxelContent(ticks, *(records[name] for name in FIELDS))


def restore(content: VoxelContent, bricks: Bricks, stamp: int, low: int) -> None:
    """Put a content into a pool in place of all that it holds.

    Args:
        content: Content with keys that differ.
        bricks: The pool.
        stamp: Stamp of the change.
        low: Lower clamp of the log-odds, units.

    Raises:
        ValueError: The pool does not hold that many bricks.
    """
    count = len(content.keys)
    if count > bricks.capacity:
        raise ValueError(f"map: got {count} bricks, expected at most {bricks.capacity}")
    bricks.release(bricks.live(), stamp)
    slots = bricks.obtain(np.ascontiguousarray(content.keys, np.int32), 0, stamp)
    bricks.observed_ns[slots] = content.observed_ns
    bricks.ticks[slots] = content.seen
    bricks.dues[slots] = content.dues
    bricks.fresh[slots] = content.fresh
    bricks.cells[slots] = content.cells
    settled = np.packbits(content.cells == low, axis=-1, bitorder="little")
    bricks.settled[slots] = settled.view(np.uint64)[..., 0]
    bricks.dirty[slots] = True
    bricks.stamps[slots] = stamp
