"""Packed logs: the same messages in fewer bytes."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.messages import decode, read_messages
from wayproof.harness.log.codec.packed import HASHES, pack, unpack
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import FORMAT_VERSION
from wayproof.harness.schema import wayproof_pb2 as pb

SHORT = ("empty", "drone", 1, "episode.time_limit=2")
GRAIN = 2.0**-20

numbers = st.floats(allow_nan=True, allow_infinity=True)


def decision(path=(), arcs=(), headings=(), global_path=(), hash_of=lambda name: "0f" * 16):
    message = pb.Decision(sequence=7, action="follow")
    message.trajectory.path.extend(pb.Point(x=x, y=y, z=z) for x, y, z in path)
    message.trajectory.arc_length.extend(arcs)
    message.trajectory.heading.extend(headings)
    message.global_path.extend(pb.Point(x=x, y=y, z=z) for x, y, z in global_path)
    for name in HASHES:
        setattr(message, name, hash_of(name))
    return message


def there_and_back(message):
    again = type(message)()
    again.ParseFromString(pack(message).SerializeToString(deterministic=True))
    unpack(again)
    return again.SerializeToString(deterministic=True)


def test_a_packed_decision_by_hand():
    """2.0 is the bits 2^62; its neighbour 2 + 2^-51 is one more; in a double -2.0, all flip."""
    path = [(2.0, -2.0, 0.0), (2.0 + 2.0**-51, -2.0, 0.0)]
    message = decision(path, [0.0, 3 * GRAIN, 7 * GRAIN], [GRAIN, 0.0])
    packed = pack(message).packed
    two = 2**62
    assert list(packed.path) == [two + 1, -two - 1, 0, -two - 2, two + 1, 0]
    assert list(packed.arc_length) == [7, -11, 1]  # backwards 7 3 0; steps 7 -4 -3; theirs
    assert list(packed.heading) == [0, 1]
    assert packed.hashes == bytes([0x0F]) * 48
    assert there_and_back(message) == message.SerializeToString(deterministic=True)


@given(
    path=st.lists(st.tuples(numbers, numbers, numbers), max_size=6),
    arcs=st.lists(st.integers(-(2**40), 2**40).map(lambda n: n * GRAIN), max_size=6),
    odd=st.lists(numbers, max_size=4),
)
def test_packing_is_lossless(path, arcs, odd):
    for message in (decision(path, arcs, arcs), decision(path, odd), decision(global_path=path)):
        assert there_and_back(message) == message.SerializeToString(deterministic=True)


@pytest.mark.parametrize("text", ["", "0f", "0F" * 16, "no hash", "0f " * 16])
def test_values_that_packing_would_change_stay_unpacked(text):
    message = decision(hash_of=lambda name: text if name == "chain" else "0f" * 16)
    assert pack(message) == message
    streams = pb.Streams(streams=[pb.StreamHash(name="pose", hash=text)])
    assert pack(streams) == streams


def test_hashes_of_streams_take_eight_bytes_each():
    streams = pb.Streams(
        sequence=3, streams=[pb.StreamHash(name=name, hash=8 * name) for name in ("aa", "bb")]
    )
    packed = pack(streams)
    assert packed.packed == 8 * b"\xaa" + 8 * b"\xbb"
    assert [one.hash for one in packed.streams] == ["", ""]
    assert there_and_back(streams) == streams.SerializeToString(deterministic=True)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda packed: packed.path.append(1),
        lambda packed: packed.global_path.append(1),
        lambda packed: packed.arc_length.extend(np.zeros(2**20 + 1, np.int64).tolist()),
        lambda packed: setattr(packed, "hashes", b"short"),
    ],
)
def test_malformed_packed_data_is_refused(spoil):
    message = pack(decision([(0.0, 1.0, 2.0)]))
    spoil(message.packed)
    data = message.SerializeToString()
    with pytest.raises(InputError, match=r"a message of '/decision' at 0\.5 s cannot be decoded"):
        decode(Packet("wayproof.Decision", "/decision", 500_000_000, data), Path("a.mcap"))


def test_a_log_of_decisions_is_packed_and_read_like_any_other(recorded):
    full = Path(recorded(*SHORT).log)
    small = Path(recorded(*SHORT, "record=decisions").log)
    assert open_log(small).run["format_version"] == FORMAT_VERSION
    raw = [one for one in walk(small) if isinstance(one, Packet) and one.topic == "/decision"]
    assert all(pb.Decision.FromString(one.data).HasField("packed") for one in raw)
    kept = (pb.Pose, pb.Latency, pb.Truth, pb.Streams, pb.Decision)
    pairs = zip(bare(full, kept), bare(small, kept), strict=True)
    assert all(one == other for one, other in pairs)
    assert small.stat().st_size < 0.25 * full.stat().st_size


def bare(path, kinds):
    """Messages without what is measured, and without global paths, of which most are left out."""
    for message in read_messages(path):
        if isinstance(message, pb.Decision):
            message.ClearField("stages")
            message.ClearField("global_path")
        if isinstance(message, kinds):
            yield message
