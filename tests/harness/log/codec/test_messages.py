"""Decoding of messages: what is out of range is refused."""

from pathlib import Path

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Packet
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.schema import wayproof_pb2 as pb


def early():
    pose = pb.Pose()
    pose.timestamp.nanos = -1
    return pose


def late():
    decision = pb.Decision()
    decision.trajectory.start.seconds = 1 << 60
    return decision


@pytest.mark.parametrize(
    "message",
    [
        early(),
        late(),
        *(pb.Truth(position=[x, 0.0, 1.0]) for x in (1e214, float("inf"), float("nan"))),
        pb.Decision(reason="at rest\x1b[31m"),  # a terminal takes it for a command
        pb.Decision(label="none\nsuccess"),
        pb.Streams(streams=[pb.StreamHash(name="pose\x9b2J")]),
        pb.Perturbation(streams=["pose", "\x07"]),
    ],
)
def test_what_no_episode_has_is_refused(message):
    schema, data = message.DESCRIPTOR.full_name, message.SerializeToString()
    with pytest.raises(InputError, match="cannot be decoded"):
        decode(Packet(schema, "/forged", 0, data), Path("forged.mcap"))
