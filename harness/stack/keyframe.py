"""Keyframes: the state of the stack after a decision, from which a replay can start.

That is the planner state, the chain, and in some keyframes the map; costmap and distances follow
from the map. A keyframe is a claim of the log until a replay arrives at it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import zstandard
from numpy.typing import NDArray

from wayproof.harness.config import BUILTIN, PLUGIN, Config
from wayproof.harness.decision import Difference, message_differences
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.state_messages import read_state, state_message
from wayproof.maps import VoxelMap
from wayproof.maps.voxel.bricks import BRICK_SHAPE
from wayproof.maps.voxel.storage import VoxelContent

FARTHEST = 1 << 24
"""Farthest cell of an operating area along an axis: 1e4 m at 1 cm, and to spare."""

STATES_IN_PERIOD = 4
"""Keyframes in one period; the last holds the map: a planner state takes few bytes, and
the map before it is soon integrated again."""


MAP_SHARE = 0.02
"""Maximum size of a map in units of that of the sweeps since the one before, uncompressed. Sweeps
compress to 0.14 (100,000 beams) to 0.36 of it, so that maps take at most a seventh of a log."""

LAST_SHARE = 1.0 / 7.0
"""Maximum size of all maps in units of that of the log, where the last decision has one."""


def has_keyframes(config: Config) -> bool:
    """Return whether the stack of these settings writes keyframes.

    A stack on trial, a planner of the user's own and a recording are replayed from the start.
    """
    return (
        config.keyframe_period > 0.0
        and config.record != "decisions"
        and config.stack.name == BUILTIN
        and PLUGIN not in config.planner.name
        and config.recording is None
    )


def has_maps(config: Config) -> bool:
    """Return whether keyframes of these settings hold maps: voxel maps without classes.

    Nor where sweeps come late: they are placed by the poses before.
    """
    kept = config.map.kind == "voxel" and not config.sensors.semantics
    return has_keyframes(config) and kept and not config.sweeps_come_late


class Schedule:
    """Schedule of keyframes in an episode: by time, and maps by a share of the log as well."""

    def __init__(self, config: Config, begun_ns: int) -> None:
        """Begin at a time, ns, with the settings of the episode."""
        self._writes, self._with_maps = has_keyframes(config), has_maps(config)
        self._period_ns = round(config.keyframe_period * 1e9)
        self._newest = self._map_quarter = self._quarter(begun_ns)
        self._sensed_bytes = self._map_bytes = self._all_map_bytes = 0

    def is_due(self, now_ns: int, sensed_bytes: int) -> bool:
        """Return whether a keyframe is due after a decision.

        Args:
            now_ns: Time of the decision, ns.
            sensed_bytes: Size of its sweeps as messages.
        """
        self._sensed_bytes += sensed_bytes
        before, self._newest = self._newest, self._quarter(now_ns)
        return self._writes and self._newest > before

    def holds_map(self, now_ns: int, is_last: bool) -> bool:
        """Return whether a keyframe that is due holds the map.

        That of the last decision, due or not, does where it `has_room`, unless there is one shortly
        before: no decision is explained more often.
        """
        passed = self._quarter(now_ns) - self._map_quarter
        due = passed >= STATES_IN_PERIOD and self._map_bytes <= MAP_SHARE * self._sensed_bytes
        return self._with_maps and (due or (is_last and passed > 0))

    def has_room(self, map_bytes: int, log_bytes: int) -> bool:
        """Return whether a log has room for one more map, by the sizes of both without it."""
        maps = self._all_map_bytes + map_bytes
        return maps <= LAST_SHARE * (log_bytes + map_bytes)

    def wrote_map(self, now_ns: int, map_bytes: int) -> None:
        """Note that a map was written: after the decision of a time, ns, and its size."""
        self._sensed_bytes, self._map_bytes = 0, map_bytes
        self._all_map_bytes += map_bytes
        self._map_quarter = self._quarter(now_ns)

    def _quarter(self, time_ns: int) -> int:
        return time_ns * STATES_IN_PERIOD // self._period_ns if self._writes else 0


def keyframe_of(navigator: Navigator, decision: pb.Decision, with_map: bool) -> pb.Keyframe:
    """Return the state of a stack after a decision that it committed."""
    keyframe = pb.Keyframe(
        timestamp=decision.timestamp,
        sequence=decision.sequence,
        chain=decision.chain,
        state=state_message(navigator.state),
    )
    if with_map:
        write_bricks(_voxel_map(navigator).content(), keyframe.map)
        keyframe.map.window.extend(navigator.mapper.window.centre)
        write_filters(navigator.mapper.filters.contents(), keyframe.map)
    return keyframe


def restore_state(navigator: Navigator, keyframe: pb.Keyframe) -> None:
    """Take over the planner state and the chain of a keyframe.

    Raises:
        ValueError: The state is none.
    """
    navigator.load_state(read_state(keyframe.state), keyframe.chain)


def restore_map(navigator: Navigator, keyframe: pb.Keyframe) -> None:
    """Take over the map of a keyframe.

    Raises:
        ValueError: It is none of such a stack.
    """
    voxel_map = _voxel_map(navigator)
    content = read_bricks(keyframe.map, voxel_map.most_bricks)
    centre = tuple(keyframe.map.window)
    if len(centre) != 2 or max(map(abs, centre)) > FARTHEST:
        raise ValueError(f"a rolling window centred on {centre}")
    voxel_map.check(content, keyframe.timestamp.ToNanoseconds())
    navigator.mapper.filters.restore(read_filters(keyframe.map))
    voxel_map.restore(content)
    navigator.mapper.move_window(centre)


def keyframe_differences(
    recorded: pb.Keyframe, navigator: Navigator, decision: pb.Decision
) -> list[Difference]:
    """Return every value of a keyframe that differs from a stack's state after its decision."""
    frame = pb.Keyframe()
    frame.CopyFrom(recorded)
    frame.ClearField("map")
    found = message_differences(frame, keyframe_of(navigator, decision, with_map=False))
    if not recorded.HasField("map"):
        return found
    try:
        voxel_map = _voxel_map(navigator)
        other = read_bricks(recorded.map, voxel_map.most_bricks)
        remembered, own_memory = read_filters(recorded.map), navigator.mapper.filters.contents()
        found += [
            Difference(f"map.filters {name}", "others", "those of the inputs")
            for name in {**own_memory, **remembered}
            if remembered.get(name) != own_memory.get(name)
        ]
    except ValueError as error:
        return [*found, Difference("map", str(error), "that of the inputs")]
    if (centre := list(recorded.map.window)) != (own := list(navigator.mapper.window.centre)):
        found.append(Difference("map.window", str(centre), str(own)))
    return [
        *found,
        *(
            Difference(f"map.{name}", "others", "those of the inputs")
            for name, one, own in zip(other._fields, *_arrays(other, voxel_map), strict=True)
            if not np.array_equal(one, own)
        ),
    ]


def _arrays(content: VoxelContent, voxel_map: VoxelMap) -> list[list[NDArray[np.generic]]]:
    """Return the fields of a content and those of a map."""
    return [[np.asarray(field) for field in one] for one in (content, voxel_map.content())]


def _voxel_map(navigator: Navigator) -> VoxelMap:
    """Return the map of a stack whose keyframes hold it.

    Raises:
        ValueError: Its map is of another kind.
    """
    if type(navigator.map) is not VoxelMap:
        raise ValueError(f"a map of bricks, but map.kind is {navigator.map.config.kind!r}")
    return navigator.map


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
