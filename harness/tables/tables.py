"""Tables of a log by name, read from the file in one pass each; nothing is simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pyarrow as pa

from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.tables.column import Column, table_of
from wayproof.harness.tables.decisions import DECISIONS
from wayproof.harness.tables.poses import POSES, TRUTH, PosePair
from wayproof.harness.tables.sweeps import SWEEPS


def decisions_table(log: Log) -> pa.Table:
    """Return one row for each decision, of the columns `DECISIONS`.

    Raises:
        InputError: The log is damaged.
    """
    return table_of(DECISIONS, log.decisions())


def truth_table(log: Log) -> pa.Table:
    """Return the true pose, velocity and clearance at each decision, of the columns `TRUTH`.

    A log without a simulator's truth has no rows.

    Raises:
        InputError: The log is damaged.
    """
    return table_of(TRUTH, log.truth())


def poses_table(log: Log) -> pa.Table:
    """Return the estimated pose of each decision and its error, of the columns `POSES`.

    Raises:
        InputError: The log is damaged.
    """
    return table_of(POSES, pose_pairs(log))


def pose_pairs(log: Log) -> list[PosePair]:
    """Return the estimated and the true pose of each decision, in order.

    A log of decisions alone holds no poses of their own: those in its decisions stand for them.
    """
    poses: dict[int, pb.Pose] = {}
    truths: dict[int, pb.Truth] = {}
    for message in read_messages(log.path):
        if isinstance(message, pb.Pose):
            poses[message.sequence] = message
        elif isinstance(message, pb.Truth):
            truths[message.sequence] = message
        elif isinstance(message, pb.Decision) and message.sequence not in poses:
            poses[message.sequence] = pb.Pose(
                timestamp=message.timestamp,
                sequence=message.sequence,
                position=message.position,
                quaternion=message.quaternion,
                position_sigma=message.position_sigma,
            )
    return [PosePair(pose, truths.get(number)) for number, pose in sorted(poses.items())]


def sweeps_table(log: Log) -> pa.Table:
    """Return one row for each sweep, of the columns `SWEEPS`.

    Raises:
        InputError: The log is damaged, or its sweeps were left out.
    """
    log.check_sweeps()
    found = (one for one in read_messages(log.path) if isinstance(one, pb.Sweep))
    return table_of(SWEEPS, found)


TABLES: dict[str, Callable[[Log], pa.Table]] = {
    "decisions": decisions_table,
    "truth": truth_table,
    "poses": poses_table,
    "sweeps": sweeps_table,
}
"""Tables by name."""

COLUMNS: dict[str, Sequence[Column[Any]]] = {
    "decisions": DECISIONS,
    "truth": TRUTH,
    "poses": POSES,
    "sweeps": SWEEPS,
}
"""Columns of each table."""
