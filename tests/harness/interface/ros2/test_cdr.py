"""CDR against what ROS 2's own middleware writes: golden bytes of rclpy, and of rosbags."""

import base64
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from tests.harness.interface.ros2.fill import MESSAGES, Fill
from wayproof.harness.interface.ros2 import messages
from wayproof.harness.interface.ros2.cdr import CdrError, Writer, decode, encode, fields_of
from wayproof.harness.interface.ros2.messages import Message

GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text())
"""By `tests/ros2/make_golden.py`: as by default, filled, and filled with empty sequences."""

TYPES = {
    kind.TYPE: kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, Message) and kind is not Message
}
NAMES = {"?": "boolean", "i": "int", "u": "uint", "f": "float"}


def filled(kind, fill):
    """A message of ours with the values that `Fill.message` gives to one of rclpy's."""
    return kind(**{name: value_of(field, fill) for name, field in fields_of(kind)})


def value_of(field, fill):
    if field.code is not None:
        name = NAMES[field.code.dtype[0]]
        if field.code.length is None:
            return fill.number(name)
        count = field.code.length or fill.length
        return np.array([fill.number(name) for _ in range(count)], field.code.dtype)
    if field.message is None:
        return fill.text()
    if field.sequence:
        return tuple(filled(field.message, fill) for _ in range(fill.length))
    return filled(field.message, fill)


def variants(kind):
    return [kind(), filled(kind, Fill(2)), filled(kind, Fill(0))]


def same(one, other):
    if isinstance(one, Message):
        pairs = zip(dataclasses.astuple(one), dataclasses.astuple(other), strict=True)
        return type(one) is type(other) and all(same(a, b) for a, b in pairs)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other)


class Padded(Writer):
    """Pads with ones, which shows where padding is."""

    PADDING = b"\xff"


def without_padding(message, data):
    """The bytes that carry values: Fast DDS leaves those between them as they happen to be."""
    writer = Padded()
    writer.message(message)
    values = [a == b for a, b in zip(encode(message), writer.finish(), strict=True)]
    return bytes(one for one, value in zip(data, values, strict=False) if value)


def test_every_message_is_compared():
    assert set(MESSAGES) == set(TYPES)
    assert set(GOLDEN) == set(MESSAGES) - {"tf2_msgs/msg/TFMessage"}


@pytest.mark.parametrize("name", sorted(GOLDEN))
def test_the_bytes_are_those_of_rclpy_both_ways(name):
    for ours, theirs in zip(variants(TYPES[name]), GOLDEN[name], strict=True):
        data = base64.b64decode(theirs)
        assert without_padding(ours, encode(ours)) == without_padding(ours, data)
        assert 0 <= len(data) - len(encode(ours)) < 4  # to whole words
        assert same(decode(TYPES[name], data), ours)


@pytest.mark.parametrize("name", MESSAGES)
def test_the_bytes_are_those_of_rosbags(name):
    store = get_typestore(Stores.ROS2_JAZZY)
    for ours in variants(TYPES[name]):
        read = store.deserialize_cdr(encode(ours), name)
        assert bytes(store.serialize_cdr(read, name)) == encode(ours)


def test_big_endian_is_read():
    time = decode(messages.Time, b"\0\0\0\0" + bytes([0, 0, 1, 2, 0, 0, 0, 3]))
    assert (time.sec, time.nanosec) == (258, 3)


@pytest.mark.parametrize("name", MESSAGES)
def test_bytes_that_end_early_are_refused(name):
    data = encode(filled(TYPES[name], Fill(2)))
    for end in range(0, len(data), max(1, len(data) // 40)):
        with pytest.raises(CdrError):
            decode(TYPES[name], data[:end])


def test_a_length_beyond_the_data_and_other_encodings_are_refused():
    scan = encode(messages.LaserScan(ranges=np.zeros(3, np.float32)))
    length = len(scan) - 3 * 4 - 4 - 4
    huge = scan[:length] + b"\xff\xff\xff\xff" + scan[length + 4 :]
    with pytest.raises(CdrError, match="sequence of 4294967295"):
        decode(messages.LaserScan, huge)
    with pytest.raises(CdrError, match="encapsulation 0007"):
        decode(messages.Time, b"\0\7\0\0" + bytes(8))
    with pytest.raises(CdrError, match="UTF-8"):
        decode(messages.Header, b"\0\1\0\0" + bytes(8) + b"\2\0\0\0\xff\0")
    with pytest.raises(CdrError, match="got 3 numbers, expected 36"):
        encode(messages.PoseWithCovariance(covariance=np.zeros(3)))


def test_times_are_whole_nanoseconds():
    assert messages.Time.of(1_500_000_001) == messages.Time(1, 500_000_001)
    assert messages.Time.of(-1).ns == -1
