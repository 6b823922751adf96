"""Lossless packing of decisions and stream hashes, for packed logs.

A path is straight pieces and parabolas, sampled evenly: the second differences of its coordinates
are a bit or two of rounding, or the same from point to point. So are those of arc lengths and
headings. They are taken from the end backwards, because from one decision to the next the end stays
and the beginning moves. Hashes take half the bytes as numbers that they take as text.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.decision import GRAIN, add_points
from wayproof.harness.schema import wayproof_pb2 as pb

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

HASHES = ("map_version", "input_digest", "chain")
HASH_SIZE = 16
"""Size of each hash, bytes."""

STREAM_HASH_SIZE = 8

ORDER = 2
"""Order of the differences; third ones of a path are no smaller, and each corner costs one more."""

LARGEST = np.int64(2**63 - 1)

MOST_NUMBERS = 2**20
"""Maximum number of values in one field; a path has some hundred points."""


def pack(message: Message) -> Message:
    """Return the message packed, or unchanged if it would not be restored bit by bit."""
    try:
        if isinstance(message, pb.Decision):
            packed: pb.Decision | pb.Streams = _pack_decision(message)
        elif isinstance(message, pb.Streams):
            packed = _pack_streams(message)
        else:
            return message
        again = type(packed).FromString(_bytes(packed))
        unpack(again)
    except ValueError:
        return message
    return packed if _bytes(again) == _bytes(message) else message


def unpack(message: Message) -> None:
    """Restore a packed message in place; no effect on one that is not packed.

    Raises:
        ValueError: The packed data has the wrong size.
    """
    if isinstance(message, pb.Decision) and message.HasField("packed"):
        _unpack_decision(message)
    elif isinstance(message, pb.Streams) and message.packed:
        _unpack_streams(message)


def _pack_decision(decision: pb.Decision) -> pb.Decision:
    packed = pb.Decision()
    packed.CopyFrom(decision)
    trajectory, into = packed.trajectory, packed.packed
    into.path.extend(_steps(_ordered(_coordinates(trajectory.path))))
    into.arc_length.extend(_steps(_grains(np.array(trajectory.arc_length)[:, None])))
    into.heading.extend(_steps(_grains(np.array(trajectory.heading)[:, None])))
    into.global_path.extend(_steps(_grains(_coordinates(packed.global_path))))
    into.hashes = _numbers(getattr(decision, name) for name in HASHES)
    for field in ("path", "arc_length", "heading"):
        trajectory.ClearField(field)
    for field in ("global_path", *HASHES):
        packed.ClearField(field)
    return packed


def _unpack_decision(decision: pb.Decision) -> None:
    packed, trajectory = decision.packed, decision.trajectory
    hashes = _texts(packed.hashes, len(HASHES), HASH_SIZE)
    add_points(trajectory, "path", _doubles(_sums(packed.path, 3)))
    trajectory.arc_length.extend((_sums(packed.arc_length, 1)[:, 0] * GRAIN).tolist())
    trajectory.heading.extend((_sums(packed.heading, 1)[:, 0] * GRAIN).tolist())
    path = _sums(packed.global_path, 3).astype(np.float64) * GRAIN
    add_points(decision, "global_path", path)
    for name, text in zip(HASHES, hashes, strict=True):
        setattr(decision, name, text)
    decision.ClearField("packed")


def _pack_streams(streams: pb.Streams) -> pb.Streams:
    packed = pb.Streams()
    packed.CopyFrom(streams)
    packed.packed = _numbers(one.hash for one in streams.streams)
    for one in packed.streams:
        one.ClearField("hash")
    return packed


def _unpack_streams(streams: pb.Streams) -> None:
    hashes = _texts(streams.packed, len(streams.streams), STREAM_HASH_SIZE)
    for one, text in zip(streams.streams, hashes, strict=True):
        one.hash = text
    streams.ClearField("packed")


def _numbers(hashes: Iterable[str]) -> bytes:
    return bytes.fromhex("".join(hashes))


def _texts(data: bytes, count: int, size: int) -> list[str]:
    """Split data into `count` hashes of `size` bytes, in hexadecimal."""
    if len(data) != count * size:
        raise ValueError(f"{len(data)} bytes of hashes, expected {count * size}")
    return [data[k * size : (k + 1) * size].hex() for k in range(count)]


def _coordinates(path: Sequence[pb.Point]) -> Array:  # (n, 3)
    return np.array([(p.x, p.y, p.z) for p in path], np.float64).reshape(-1, 3)


def _grains(values: Array) -> Whole:
    with np.errstate(all="ignore"):  # what overflows is not restored, and stays unpacked
        return np.rint(values / GRAIN).astype(np.int64)


def _ordered(values: Array) -> Whole:
    """Return the bits of doubles as whole numbers in the same order."""
    bits = np.ascontiguousarray(values).view(np.int64)
    return bits ^ ((bits >> 63) & LARGEST)


def _doubles(ordered: Whole) -> Array:
    """Invert `_ordered`."""
    return (ordered ^ ((ordered >> 63) & LARGEST)).view(np.float64)


def _steps(rows: Whole) -> list[int]:
    """Return wrapping second differences of the rows of (n, k), from the last one backwards."""
    rows = rows[::-1]
    for _ in range(ORDER):
        rows = np.vstack([rows[:1], rows[1:] - rows[:-1]])
    steps: list[int] = rows.ravel().tolist()
    return steps


def _sums(steps: Sequence[int], columns: int) -> Whole:  # (n, columns)
    """Invert `_steps`."""
    if len(steps) > MOST_NUMBERS or len(steps) % columns:
        raise ValueError(f"{len(steps)} numbers, expected {columns} for each point")
    rows = np.array(steps, np.int64).reshape(-1, columns)
    for _ in range(ORDER):
        rows = np.cumsum(rows, axis=0)
    return np.ascontiguousarray(rows[::-1])


def _bytes(message: Message) -> bytes:
    return message.SerializeToString(deterministic=True)
