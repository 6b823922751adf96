"""Decoding of the messages of a log, with checks of times, positions and texts."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import DecodeError, Message

from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import MAX_COORDINATE
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.packed import unpack
from wayproof.harness.schema import wayproof_pb2 as pb

Kind = TypeVar("Kind", bound=Message)

LONGEST_DELAY_S = 1e9
"""Longest delay of a decision that a log can hold, s."""


def read_messages(path: Path, after_ns: int = -1) -> Iterator[Message]:
    """Yield every message of a log in file order, decoded.

    Args:
        path: The log.
        after_ns: Simulated time up to which they are passed over, ns.

    Raises:
        InputError: The file breaks off or a checksum does not hold.
    """
    for item in walk(path):
        if isinstance(item, Packet) and item.time_ns > after_ns and is_ours(item):
            yield decode(item, path)


def read_only(path: Path, kind: type[Kind]) -> Iterator[Kind]:
    """Yield the messages of one kind of a log in file order; no other is decoded.

    Raises:
        InputError: The file breaks off or a checksum does not hold.
    """
    for item in walk(path):
        if isinstance(item, Packet) and item.schema == kind.DESCRIPTOR.full_name:
            message = decode(item, path)
            assert isinstance(message, kind)
            yield message


def read_unfinished(path: Path) -> Iterator[Message]:
    """Yield every message of a log that is still being written, up to the last flush.

    The end of the file is no error; the caller checks the number of messages.
    """
    with contextlib.suppress(InputError):
        yield from read_messages(path)


TOPICS: dict[type[Message], str] = {
    pb.Pose: "/pose",
    pb.Goal: "/goal",
    pb.Prediction: "/prediction",
    pb.RecordedMotion: "/recorded",
    pb.Latency: "/latency",
    pb.StackCommand: "/command",
    pb.State: "/state",
    pb.Keyframe: "/keyframe",
    pb.Decision: "/decision",
    pb.Truth: "/truth",
    pb.Streams: "/streams",
    pb.Perturbation: "/perturbation",
}
"""Topic of each message type but those of sensors."""

KINDS: tuple[type[Message], ...] = (pb.SensorInfo, pb.Sweep, *TOPICS)

_MESSAGES = {kind.DESCRIPTOR.full_name: kind for kind in KINDS}


def topic_of(message: Message) -> str:
    """Return the topic of a message."""
    if isinstance(message, pb.SensorInfo):
        return f"/sensor/{message.name}/info"
    if isinstance(message, pb.Sweep):
        return f"/sensor/{message.sensor}"
    return TOPICS[type(message)]


def time_of(message: Message) -> int:
    """Return the simulated time of a message, ns; 0 for beam tables."""
    if isinstance(message, pb.SensorInfo):
        return 0
    time_ns: int = message.timestamp.ToNanoseconds()  # type: ignore[attr-defined]
    return time_ns


def is_ours(packet: Packet) -> bool:
    """Return whether a packet is a message of a log; a file may hold others."""
    return packet.schema in _MESSAGES


def decode(packet: Packet, path: Path) -> Message:
    """Return the message of a packet, see `is_ours`.

    Raises:
        InputError: It is no such message.
    """
    try:
        message = _MESSAGES[packet.schema].FromString(packet.data)
        unpack(message)
        _check_times(message)
        _check_place(message)
        _check_texts(message)
        return message
    except (DecodeError, ValueError):
        raise InputError(
            f"log '{path}': damaged (a message of {packet.topic[:40]!r} at "
            f"{packet.time_ns * 1e-9:.1f} s cannot be decoded)"
        ) from None


def _check_times(message: Message) -> None:
    """Raise a ValueError if a timestamp is out of range."""
    if "timestamp" in message.DESCRIPTOR.fields_by_name:
        message.timestamp.ToNanoseconds()  # type: ignore[attr-defined]
    if isinstance(message, pb.Decision):
        message.trajectory.start.ToNanoseconds()


def _check_place(message: Message) -> None:
    """Raise a ValueError if a true or recorded pose is out of range: squares may overflow."""
    if isinstance(message, pb.RecordedMotion):
        _check_motion(message)
    if isinstance(message, pb.Truth):
        _check_truth(message)
    if isinstance(message, pb.Latency) and not abs(message.delay_s) <= LONGEST_DELAY_S:
        raise ValueError("delay_s")
    if isinstance(message, (pb.Truth, pb.RecordedMotion)) and not all(
        abs(x) <= MAX_COORDINATE for x in message.position
    ):
        raise ValueError("position")


def _check_truth(message: pb.Truth) -> None:
    """Raise a ValueError if a truth has the wrong size, or numbers that no body has."""
    sizes = len(message.position), len(message.quaternion), len(message.velocity)
    movers = {(len(mover.position), len(mover.quaternion)) for mover in message.movers}
    if sizes != (3, 4, 3) or not movers <= {(3, 4)}:
        raise ValueError("truth")
    turns = [message.quaternion, *(mover.quaternion for mover in message.movers)]
    if not all(abs(x) < 2.0 for turn in turns for x in turn):
        raise ValueError("quaternion")
    places = [message.velocity, *(mover.position for mover in message.movers)]
    if not all(abs(x) <= MAX_COORDINATE for place in places for x in place):
        raise ValueError("velocity")


def _check_motion(message: pb.RecordedMotion) -> None:
    """Raise a ValueError if a recorded motion has the wrong size, or numbers out of range."""
    sizes = len(message.position), len(message.quaternion), len(message.velocity)
    if sizes != (3, 4, 3) or not message.way or len(message.way) % 4:
        raise ValueError("motion")
    if not all(abs(x) <= MAX_COORDINATE for x in (*message.velocity, *message.way)):
        raise ValueError("way")
    w, x, y, z = message.quaternion
    if not abs(w * w + x * x + y * y + z * z - 1.0) <= 1e-3:
        raise ValueError("quaternion")


def _check_texts(message: Message) -> None:
    """Raise a ValueError if a text has control characters that a terminal would obey."""
    texts: list[str] = []
    _texts_of(message.DESCRIPTOR)(message, texts)
    if not "".join(texts).isprintable():
        raise ValueError(message.DESCRIPTOR.name)


@functools.cache
def _texts_of(descriptor: Descriptor) -> Callable[[Message, list[str]], None]:
    """Return a function that appends all texts of a message, at any depth, to a list.

    It is made once for each type: looking every field up took half of a state's decoding.
    """
    fields = [
        (
            field.name,
            field.is_repeated,
            None if field.message_type is None else _texts_of(field.message_type),
        )
        for field in _fields_with_texts(descriptor)
    ]

    def append(message: Message, texts: list[str]) -> None:
        for name, repeated, inner in fields:
            value = getattr(message, name)
            if inner is None:
                texts += value if repeated else (value,)
            else:
                for one in value if repeated else (value,):
                    inner(one, texts)

    return append


@functools.cache
def _fields_with_texts(descriptor: Descriptor) -> tuple[FieldDescriptor, ...]:
    """Return the fields that are texts, or messages with such fields."""
    return tuple(
        field
        for field in descriptor.fields
        if field.type == FieldDescriptor.TYPE_STRING
        or (field.message_type and _fields_with_texts(field.message_type))
    )
