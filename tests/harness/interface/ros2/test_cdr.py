"""CDR against what ROS 2's own middleware writes: golden bytes of rclpy."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import Nodetype

from tests.harness.interface.ros2.fill import MESSAGES, Fill
from wayproof.harness.interface.ros2 import messages
from wayproof.harness.interface.ros2.messages import STORE, CdrError, decode, encode

GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text())
"""By `tests/ros2/make_golden.py`: as by default, filled, and filled with empty sequences."""

TYPES = {
    kind.__msgtype__: kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and hasattr(kind, "__msgtype__") and kind is not messages.Message
}


def filled(name, fill):
    """A message with the values that `Fill.message` gives to one of rclpy's."""
    _, fields = STORE.fielddefs[name]
    return STORE.types[name](*(value_of(*one, fill) for _, one in fields))


def value_of(node, detail, fill):
    if node == Nodetype.NAME:
        return filled(detail, fill)
    if node == Nodetype.BASE:
        return fill.text() if detail[0] == "string" else fill.number(detail[0])
    element, length = detail
    values = [value_of(*element, fill) for _ in range(length or fill.length)]
    return values if element[0] == Nodetype.NAME else np.array(values, element[1][0])


def variants(name):
    return [filled(name, Fill(2)), filled(name, Fill(0))]


def test_every_message_is_compared():
    assert set(MESSAGES) == set(TYPES)
    assert set(GOLDEN) == set(MESSAGES) - {"tf2_msgs/msg/TFMessage"}


@pytest.mark.parametrize("name", sorted(GOLDEN))
def test_the_bytes_are_those_of_rclpy(name):
    for ours, theirs in zip(variants(name), GOLDEN[name][1:], strict=True):
        read = decode(TYPES[name], base64.b64decode(theirs))
        assert encode(read) == encode(ours)
        assert 0 <= len(base64.b64decode(theirs)) - len(encode(ours)) < 4  # to whole words


def test_big_endian_is_read():
    time = decode(messages.Time, b"\0\0\0\0" + bytes([0, 0, 1, 2, 0, 0, 0, 3]))
    assert (time.sec, time.nanosec) == (258, 3)


@pytest.mark.parametrize("name", MESSAGES)
def test_bytes_that_end_early_are_refused(name):
    data = encode(filled(name, Fill(2)))
    for end in range(0, len(data), max(1, len(data) // 40)):
        with pytest.raises(CdrError):
            decode(TYPES[name], data[:end])


def test_a_length_beyond_the_data_and_other_encodings_are_refused():
    grid = encode(filled("nav_msgs/msg/OccupancyGrid", Fill(2)))
    with pytest.raises(CdrError):
        decode(messages.OccupancyGrid, grid[:-6] + b"\xff\xff\xff\xff" + grid[-2:])
    with pytest.raises(CdrError, match="encapsulation"):
        decode(messages.Time, b"\0\7\0\0" + bytes(8))
    with pytest.raises(CdrError):
        decode(messages.Header, b"\0\1\0\0" + bytes(8) + b"\2\0\0\0\xff\0")


def test_times_are_whole_nanoseconds():
    assert messages.time_of(1_500_000_001) == messages.Time(1, 500_000_001)
    assert messages.nanoseconds(messages.time_of(-1)) == -1
