"""Decoding of messages: what is out of range is refused."""

from pathlib import Path

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import (
    Packet,
)
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.schema import wayproof_pb2 as pb


def test_a_timestamp_out_of_range_is_refused():
    pose, decision = pb.Pose(), pb.Decision()
    pose.timestamp.nanos = -1
    decision.trajectory.start.seconds = 1 << 60
    for one in (pose, decision):
        schema, data = one.DESCRIPTOR.full_name, one.SerializeToString()
        with pytest.raises(InputError, match="cannot be decoded"):
            decode(Packet(schema, "/forged", 0, data), Path("forged.mcap"))


@pytest.mark.parametrize("x", [1e214, float("inf"), float("nan")])
def test_a_true_position_out_of_range_is_refused(x):
    schema, data = "wayproof.Truth", pb.Truth(position=[x, 0.0, 1.0]).SerializeToString()
    with pytest.raises(InputError, match="cannot be decoded"):
        decode(Packet(schema, "/truth", 0, data), Path("forged.mcap"))


@pytest.mark.parametrize(
    "message",
    [
        pb.Decision(reason="at rest\x1b[31m"),
        pb.Decision(label="none\nsuccess"),
        pb.Streams(streams=[pb.StreamHash(name="pose\x9b2J")]),
        pb.Perturbation(streams=["pose", "\x07"]),
    ],
)
def test_a_text_that_a_terminal_takes_for_a_command_is_refused(message):
    schema, data = message.DESCRIPTOR.full_name, message.SerializeToString()
    with pytest.raises(InputError, match="cannot be decoded"):
        decode(Packet(schema, "/forged", 0, data), Path("forged.mcap"))
