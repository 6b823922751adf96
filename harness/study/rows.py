"""The table of a study: one row an episode, derived from its log, and a twin beside it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from harness.metrics import METRICS, read_trace, score
from harness.reader import open_log, read_messages
from harness.schema import wayproof_pb2 as pb
from harness.study.file import CLEAN, Arm, Planned
from harness.study.store import Store


@dataclass(frozen=True)
class Row:
    """One episode.

    Attributes:
        key: Content address.
        arm: What it shares with others.
        seed: Of the episode.
        outcome: `error` where it left no log.
        reason: In words.
        cause: Of a failure, where one was worked out.
        chain: Hash over its decisions; empty without a log.
        duration: Simulated time, s; 0 without a log.
        metrics: By name; all none without a log, but for a success of 0.
        acts: Digest of each decision's action and committed path.
    """

    key: str
    arm: Arm
    seed: int
    outcome: str
    reason: str
    cause: str
    chain: str
    duration: float
    metrics: dict[str, float | None]
    acts: tuple[bytes, ...]

    @property
    def success(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "success"


def read_row(store: Store, planned: Planned, key: str, allow_plugins: bool) -> Row | None:
    """The row of an episode that has ended, or none.

    Raises:
        InputError: Its log is damaged.
    """
    error = store.error(key)
    path = store.log(key)
    if error is not None:
        metrics: dict[str, float | None] = {**dict.fromkeys(METRICS), "success": 0.0}
        return Row(key, planned.arm, planned.seed, "error", error, "", "", 0.0, metrics, ())
    if not path.is_file():
        return None
    log = open_log(path, allow_plugins)
    return Row(
        key=key,
        arm=planned.arm,
        seed=planned.seed,
        outcome=log.result["outcome"],
        reason=log.result["reason"],
        cause=log.result.get("cause", ""),
        chain=log.result["chain"],
        duration=float(log.result["sim_time_s"]),
        metrics=score(read_trace(log)),
        acts=_acts(path),
    )


def _acts(path: Path) -> tuple[bytes, ...]:
    """What each decision made the robot do: the same digest means the same action and path."""
    return tuple(_act(m) for m in read_messages(path) if isinstance(m, pb.Decision))


def _act(decision: pb.Decision) -> bytes:
    acted = pb.Decision(action=decision.action, trajectory=decision.trajectory)
    data = acted.SerializeToString(deterministic=True)
    return hashlib.blake2b(data, digest_size=8).digest()


def reference_of(arm: Arm, first_variant: str) -> Arm | None:
    """The arm that this one is paired with: unperturbed, or of the first variant; none for itself.

    An episode and its twin share world, robot and seed.
    """
    if arm.perturbation != CLEAN:
        return Arm(arm.world, arm.robot, arm.variant, CLEAN, 0)
    if arm.variant != first_variant:
        return Arm(arm.world, arm.robot, first_variant, CLEAN, 0)
    return None


def first_difference(row: Row, twin: Row) -> int | None:
    """Number of the first decision that made the robot do something else; none if none did."""
    for number, (one, other) in enumerate(zip(row.acts, twin.acts, strict=False)):
        if one != other:
            return number
    return None if len(row.acts) == len(twin.acts) else min(len(row.acts), len(twin.acts))


def share_differing(row: Row, twin: Row) -> float:
    """Share of the decisions, of the longer of both, that made the robot do something else."""
    longest = max(len(row.acts), len(twin.acts))
    if longest == 0:
        return 0.0
    alike = sum(one == other for one, other in zip(row.acts, twin.acts, strict=False))
    return 1.0 - alike / longest


def write_table(rows: Sequence[Row], path: Path) -> None:
    """Write the table as Parquet, whole or not at all."""
    draft = path.with_suffix(".partial")
    pq.write_table(pa.Table.from_pylist([_flat(row) for row in rows]), draft)
    draft.replace(path)


def _flat(row: Row) -> dict[str, Any]:
    fields = {"key": row.key, **asdict(row.arm), "seed": row.seed, "outcome": row.outcome}
    told = {"reason": row.reason, "cause": row.cause, "chain": row.chain, "duration": row.duration}
    return {**fields, **told, **row.metrics}
