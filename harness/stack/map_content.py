"""The map of a keyframe: bricks, silent floor and echoes as compressed bytes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import zstandard
from numpy.typing import NDArray

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.echo_history import EchoHistory
from wayproof.maps.ground_fit import TILES
from wayproof.maps.kernels.echo_history import DIRECTIONS
from wayproof.maps.missing_floor import MissingFloor
from wayproof.maps.voxel.brick_index import BRICK_SHAPE
from wayproof.maps.voxel.storage import VoxelContent

LEVEL = 1
"""Level of zstd: higher ones save a tenth of the bytes and take several times as long."""

GREATEST_RATIO = 4096
"""Maximum ratio of the bricks to their compressed bytes, beyond `LEAST_BYTES`."""

LEAST_BYTES = 2**20

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


def write_floor(missing: MissingFloor, message: pb.MapContent) -> None:
    """Write the evidence of missing floor into a message."""
    message.silent_sweeps = zstandard.compress(missing.silent_sweeps.tobytes(), LEVEL)
    message.floor_tile.extend(missing.tile)


def write_echoes(echoes: Mapping[str, EchoHistory], message: pb.MapContent) -> None:
    """Write the echoes of each sensor into a message."""
    for sensor, history in echoes.items():
        packed = zstandard.compress(history.silent_sweeps.tobytes(), LEVEL)
        message.echoes.add(sensor=sensor, silent_sweeps=packed, steady_sweeps=history.steady_sweeps)


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


def read_floor(message: pb.MapContent) -> tuple[NDArray[np.uint8], tuple[int, int]]:
    """Unpack the silent sweeps by tile of floor, and the middle tile.

    Raises:
        ValueError: The bytes are not theirs.
    """
    if len(message.floor_tile) != 2:
        raise ValueError(f"floor about tile {tuple(message.floor_tile)}, expected x and y")
    data = _unpacked(message.silent_sweeps, "floor", TILES * TILES)
    silent_sweeps = np.frombuffer(data, np.uint8).reshape(TILES, TILES)
    return silent_sweeps, (message.floor_tile[0], message.floor_tile[1])


def read_echoes(message: pb.MapContent) -> dict[str, EchoHistory]:
    """Unpack the echoes of each sensor.

    Raises:
        ValueError: The bytes are not theirs, or a sensor comes twice.
    """
    echoes = {}
    for one in message.echoes:
        data = _unpacked(one.silent_sweeps, "echoes", DIRECTIONS)
        echoes[one.sensor] = history = EchoHistory()
        history.restore(np.frombuffer(data, np.uint8), one.steady_sweeps)
    if len(echoes) != len(message.echoes):
        raise ValueError(f"echoes of sensors {[one.sensor for one in message.echoes]}")
    return echoes


def _bytes_of(content: VoxelContent) -> bytes:
    """Encode field by field; cells layer by layer, as neighbours in a layer are more alike."""
    numbers = content.keys, content.observed_ns, content.seen, content.dues, content.fresh
    layers = np.ascontiguousarray(content.cells.transpose(0, 2, 1))
    return b"".join([*(array.tobytes() for array in numbers), layers.tobytes()])


def _unpacked(packed: bytes, what: str, size: int) -> bytes:
    """Decompress bytes.

    Raises:
        ValueError: They are no frame of zstd, or one of another size.
    """
    try:
        declared = zstandard.get_frame_parameters(packed).content_size
        if declared != size:
            raise ValueError(f"{declared} bytes of {what}, expected {size}")
        return zstandard.ZstdDecompressor().decompress(packed)
    except zstandard.ZstdError as error:
        raise ValueError(f"{what} cannot be unpacked: {error}") from None
