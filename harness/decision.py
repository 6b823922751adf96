"""The record of one decision, and the chain that binds each to all before it."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.planners import Trajectory

Action = Literal["follow", "slow", "stop_and_wait", "explore", "recover", "goal", "abort"]
Label = Literal[
    "none",
    "no_path",
    "start_blocked",
    "goal_blocked",
    "unknown_ahead",
    "path_blocked",
    "deadline_missed",
    "map_stale",
    "localization_lost",
]

SAMPLE_PERIOD = 0.1
"""Spacing of the logged samples of a trajectory, s."""

MOST_WIDENING = 400
"""Greatest widening by the margin of an uncertain axis, cells: nothing is free with that already.
"""

GRAIN = 2.0**-20
"""Grain of logged samples and global paths, m and rad: about a micrometre. The digits beyond it
would be a fifth of a log of decisions."""


WIRE = np.dtype([
    ("field", "u1", 2), ("size", "u1"), ("x_field", "u1"), ("x", "<f8"),
    ("y_field", "u1"), ("y", "<f8"), ("z_field", "u1"), ("z", "<f8"),
])  # fmt: skip
"""One point of a repeated field as protobuf encodes it: a message of three doubles."""


def chain_hash(decision: pb.Decision, previous_chain: str) -> str:
    """Return the chain of a decision: blake2b of the chain before and this record, 32 hex digits.

    The measured stage latencies are left out: two runs that decide alike are the same run, on a
    faster and a slower machine.
    """
    identity = pb.Decision()
    identity.CopyFrom(decision)
    identity.ClearField("stages")
    identity.ClearField("chain")
    digest = hashlib.blake2b(previous_chain.encode(), digest_size=16)
    digest.update(identity.SerializeToString(deterministic=True))
    return digest.hexdigest()


@dataclass(frozen=True)
class Difference:
    """One value that two records of a decision hold differently.

    Attributes:
        field: Its path, such as `trajectory.path[3].x`.
        recorded: Value in the log.
        recomputed: Value of the recomputation.
    """

    field: str
    recorded: str
    recomputed: str


def differences(recorded: pb.Decision, recomputed: pb.Decision) -> list[Difference]:
    """Return every value that differs in a bit, except the measured stage latencies.

    Of repeated fields, the number of elements if that differs, and the first element that does.

    Args:
        recorded: Decision from the log.
        recomputed: Decision from the recomputation.
    """
    pair = []
    for decision in (recorded, recomputed):
        alone = pb.Decision()
        alone.CopyFrom(decision)
        alone.ClearField("stages")
        pair.append(alone)
    return message_differences(*pair)


def message_differences(recorded: Message, recomputed: Message) -> list[Difference]:
    """Return every value of two messages that differs in a bit, as `differences` does."""
    written = [one.SerializeToString(deterministic=True) for one in (recorded, recomputed)]
    return [] if written[0] == written[1] else list(_differences("", recorded, recomputed))


def _differences(prefix: str, old: Message, new: Message) -> Iterator[Difference]:
    for field in old.DESCRIPTOR.fields:
        name = f"{prefix}{field.name}"
        first, second = getattr(old, field.name), getattr(new, field.name)
        if not field.is_repeated:
            yield from _difference(name, first, second)
            continue
        if len(first) != len(second):
            yield Difference(f"len({name})", str(len(first)), str(len(second)))
        for index, (one, other) in enumerate(zip(first, second, strict=False)):
            found = list(_difference(f"{name}[{index}]", one, other))
            if found:
                yield from found
                break


def _difference(name: str, old: Any, new: Any) -> Iterator[Difference]:
    if isinstance(old, Timestamp):
        old, new = old.ToNanoseconds(), new.ToNanoseconds()
    if isinstance(old, Message):
        yield from _differences(f"{name}.", old, new)
    elif isinstance(old, float):
        if struct.pack("<d", old) != struct.pack("<d", new):  # which -0.0 == 0.0 hides
            yield Difference(name, repr(old), repr(new))
    elif isinstance(old, bytes) and old != new:
        yield Difference(name, _summary_of_bytes(old), _summary_of_bytes(new))
    elif old != new:
        yield Difference(name, str(old), str(new))


def _summary_of_bytes(data: bytes) -> str:
    return f"{len(data)} bytes, hash {hashlib.blake2b(data, digest_size=4).hexdigest()}"


def trajectory_message(trajectory: Trajectory) -> pb.Trajectory:
    """Encode a trajectory for the log: its path, and its profile sampled to its end."""
    count = int(np.ceil(trajectory.duration_s / SAMPLE_PERIOD)) + 1
    times = np.arange(count).astype(np.float64) * round(SAMPLE_PERIOD * 1e9) * 1e-9
    message = pb.Trajectory(
        duration_s=trajectory.duration_s,
        arc_length=_in_grains(trajectory.motion.positions(times)).tolist(),
        heading=_in_grains(trajectory.turning.positions(times)).tolist(),
        sample_period_s=SAMPLE_PERIOD,
    )
    add_points(message, "path", trajectory.path)
    message.start.FromNanoseconds(trajectory.start_ns)
    return message


def add_points(message: Message, field: str, path: NDArray[np.float64] | None) -> None:
    """Append a path (n, 3), if there is one, to a message's repeated field of points.

    The points are written as protobuf's wire format has them and read by one call, which takes a
    fifteenth of the time of a message for each.
    """
    if path is None or len(path) == 0:
        return
    number = message.DESCRIPTOR.fields_by_name[field].number
    wire = np.empty(len(path), WIRE)
    wire["field"] = (number & 0x0F) << 3 | 0x82, number >> 4  # a varint of two bytes, of bytes (2)
    wire["size"] = WIRE.itemsize - 3  # of what follows
    for axis, name in enumerate(("x", "y", "z"), start=1):
        wire[f"{name}_field"] = axis << 3 | 1  # a double
        wire[name] = path[:, axis - 1]
    message.MergeFromString(wire.tobytes())


def widening_of(decision: pb.Decision) -> tuple[int, int]:
    """Return the cells by which blocked space was widened along x and y.

    Raises:
        InputError: It is not two numbers, or more than any decision has.
    """
    cells = tuple(decision.widening) or (0, 0)
    if len(cells) != 2 or max(cells) > MOST_WIDENING:
        raise InputError(
            f"decision {decision.sequence}: widening {cells}, expected two of at most "
            f"{MOST_WIDENING} cells"
        )
    return cells


def widened_in_words(decision: pb.Decision) -> str:
    """Describe the margin's excess along x and y, each after a comma; empty without one."""
    more = zip("xy", widening_of(decision), strict=True)
    size = decision.resolution_m
    return "".join(f", {cells * size:.2f} m more along {axis}" for axis, cells in more if cells)


def path_of(points: Iterable[pb.Point]) -> NDArray[np.float64]:
    """Return logged points as a path (n, 3), m."""
    return np.array([(one.x, one.y, one.z) for one in points], np.float64).reshape(-1, 3)


def thinned(path: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Return every fifth point of a path and its last, in grains: enough to see its course."""
    return None if path is None else _in_grains(np.vstack([path[:-1:5], path[-1]]))


def _in_grains(values: NDArray[np.float64]) -> NDArray[np.float64]:
    grains: NDArray[np.float64] = np.rint(values / GRAIN) * GRAIN + 0.0  # no negative zeros
    return grains
