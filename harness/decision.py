"""The record of one decision, and the chain that binds each to all before it."""

from __future__ import annotations

import hashlib
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from harness.schema import wayproof_pb2 as pb
from planners import Trajectory

Action = Literal["follow", "slow", "stop_and_wait", "explore", "recover", "goal", "abort"]
Label = Literal[
    "none",
    "no_path",
    "start_blocked",
    "goal_blocked",
    "unknown_ahead",
    "deadline_missed",
    "map_stale",
    "localization_lost",
]

SAMPLE_PERIOD = 0.1
"""Spacing of the logged samples of a trajectory, s."""


def seal(decision: pb.Decision, previous_chain: str) -> None:
    """Write the decision's chain: blake2b over the previous chain and this record.

    The measured stage latencies are left out: they are recorded, but two runs that decide alike
    are the same run on a slower machine.
    """
    decision.chain = ""
    identity = pb.Decision()
    identity.CopyFrom(decision)
    identity.ClearField("stages")
    digest = hashlib.blake2b(previous_chain.encode(), digest_size=16)
    digest.update(identity.SerializeToString(deterministic=True))
    decision.chain = digest.hexdigest()


def differences(recorded: pb.Decision, recomputed: pb.Decision) -> list[str]:
    """Names of the fields that differ, the measured stage latencies apart."""
    return [
        field.name
        for field in pb.Decision.DESCRIPTOR.fields
        if field.name != "stages"
        and _field_bytes(recorded, field.name) != _field_bytes(recomputed, field.name)
    ]


def trajectory_message(trajectory: Trajectory) -> pb.Trajectory:
    """The trajectory as it is logged: its path, and its profile sampled to its end."""
    count = int(np.ceil(trajectory.duration_s / SAMPLE_PERIOD)) + 1
    period_ns = round(SAMPLE_PERIOD * 1e9)
    samples = [trajectory.at(trajectory.start_ns + k * period_ns) for k in range(count)]
    message = pb.Trajectory(
        duration_s=trajectory.duration_s,
        path=points(trajectory.path),
        arc_length=[sample.arc_length for sample in samples],
        heading=[sample.heading for sample in samples],
        sample_period_s=SAMPLE_PERIOD,
    )
    message.start.FromNanoseconds(trajectory.start_ns)
    return message


def points(path: NDArray[np.float64] | None) -> list[pb.Point]:
    """A path (n, 3) as messages; none for no path."""
    if path is None:
        return []
    return [pb.Point(x=float(x), y=float(y), z=float(z)) for x, y, z in path]


def thinned(path: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Every fifth point of a path and its last: enough to see where a guide leads."""
    return None if path is None else np.vstack([path[:-1:5], path[-1]])


def _field_bytes(decision: pb.Decision, name: str) -> bytes:
    alone = pb.Decision()
    value = getattr(decision, name)
    field = pb.Decision.DESCRIPTOR.fields_by_name[name]
    if field.is_repeated:
        getattr(alone, name).MergeFrom(value)
    elif field.message_type is not None:
        getattr(alone, name).CopyFrom(value)
    else:
        setattr(alone, name, value)
    return alone.SerializeToString(deterministic=True)
