"""The map of a keyframe: bricks, and what filters remember, as compressed bytes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import zstandard
from numpy.typing import NDArray

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.voxel.brick_index import BRICK_SHAPE
from wayproof.maps.voxel.storage import VoxelContent

LEVEL = 1
"""Level of zstd: higher ones save a tenth of the bytes and take several times as long."""

GREATEST_RATIO = 4096
"""Maximum ratio of the bricks to their compressed bytes, beyond `LEAST_BYTES`."""

LEAST_BYTES = 2**20

MOST_REMEMBERED = 2**20
"""Maximum size of what a filter remembers, bytes."""

COLUMNS = BRICK_SHAPE[0] * BRICK_SHAPE[1]

FIELDS: tuple[tuple[str, tuple[int, ...]], ...] = (
    ("<i4", (3,)),
    ("<i8", ()),
    ("<i8", ()),
    ("<i8", ()),
    ("<u8", (COLUMNS,)),
    ("|i1", (BRICK_SHAPE[2], COLUMNS)),
)
"""Type and shape of each field of a brick, in the order of `VoxelContent`."""

BRICK_BYTES = np.dtype([(f"field {n}", *field) for n, field in enumerate(FIELDS)]).itemsize


def write_bricks(content: VoxelContent, message: pb.MapContent) -> None:
    """Write the bricks of a map into a message."""
    message.ticks, message.bricks = content.ticks, len(content.keys)
    message.records = zstandard.compress(_bytes_of(content), LEVEL)


def write_filters(contents: Mapping[str, bytes], message: pb.MapContent) -> None:
    """Write what filters remember, by name, into a message."""
    for name, content in contents.items():
        message.filters.add(name=name, content=zstandard.compress(content, LEVEL))


def read_bricks(message: pb.MapContent, most_bricks: int) -> VoxelContent:
    """Unpack the bricks of a keyframe.

    Raises:
        ValueError: They are more than `most_bricks`, or the bytes are not theirs.
    """
    count, packed = message.bricks, message.records
    size = count * BRICK_BYTES
    if count > most_bricks or size > LEAST_BYTES + GREATEST_RATIO * len(packed):
        raise ValueError(f"{count} bricks in {len(packed)} bytes")
    data = _unpacked(packed, "bricks", size)
    arrays: list[NDArray[np.generic]] = []
    place = 0
    for kind, shape in FIELDS:
        array = np.frombuffer(data, kind, count * math.prod(shape), place)
        arrays.append(array.reshape(count, *shape))
        place += array.nbytes
    arrays[-1] = arrays[-1].transpose(0, 2, 1)
    return VoxelContent(message.ticks, *arrays)  # type: ignore[arg-type]


def read_filters(message: pb.MapContent) -> dict[str, bytes]:
    """Unpack what filters remember, by name.

    Raises:
        ValueError: The bytes cannot be unpacked, or a filter comes twice.
    """
    contents = {one.name: _unpacked(one.content, f"filter {one.name}") for one in message.filters}
    if len(contents) != len(message.filters):
        raise ValueError(f"filters {[one.name for one in message.filters]}")
    return contents


def _bytes_of(content: VoxelContent) -> bytes:
    """Encode field by field; cells layer by layer, as neighbours in a layer are more alike."""
    numbers = content.keys, content.observed_ns, content.seen, content.dues, content.fresh
    layers = np.ascontiguousarray(content.cells.transpose(0, 2, 1))
    return b"".join([*(array.tobytes() for array in numbers), layers.tobytes()])


def _unpacked(packed: bytes, what: str, size: int | None = None) -> bytes:
    """Decompress bytes.

    Raises:
        ValueError: They are no frame of zstd, or one of another size.
    """
    try:
        declared = zstandard.get_frame_parameters(packed).content_size
        if declared > MOST_REMEMBERED if size is None else declared != size:
            raise ValueError(f"{declared} bytes of {what}, expected {size or MOST_REMEMBERED}")
        return zstandard.ZstdDecompressor().decompress(packed)
    except zstandard.ZstdError as error:
        raise ValueError(f"{what} cannot be unpacked: {error}") from None
