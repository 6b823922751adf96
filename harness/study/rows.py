"""The table of a study: one row an episode, derived from its log, and a twin beside it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.log.digest import ContentDigest
from wayproof.harness.log.streams import Pairing, compare_hashes
from wayproof.harness.metrics import METRICS, score, trace_of
from wayproof.harness.replay.consistency import refuse_contradictions
from wayproof.harness.replay.content import Content
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.study.file import CLEAN, Arm, Planned
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.store import Store

READ = {kind.DESCRIPTOR.full_name for kind in (pb.Decision, pb.Truth, pb.Streams, pb.Perturbation)}
"""Messages that a row is made of; sweeps, most of a log, stay packed."""

SHORT = 8
"""Of a stream's hash that a row keeps, bytes: enough to tell two apart."""


@dataclass(frozen=True)
class Row:
    """One episode.

    Attributes:
        key: Content address.
        arm: What it shares with others.
        seed: Of the episode.
        outcome: `error` where it left no log.
        reason: In words.
        cause: Of a failure, where one was worked out; the one that a check left, where one was run.
        chain: Hash over its decisions; empty without a log.
        duration: Simulated time, s; 0 without a log.
        metrics: By name; all none without a log, but for a success of 0.
        acts: Digest of each decision's action and committed path.
        declared: Input streams that its perturbation declares to change.
        streams: Names of all streams.
        check: What the check answered to the cause that the facts gave; empty without one.
        hashes: Of each decision, the first bytes of every stream's hash, one after another.
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
    declared: tuple[str, ...] = ()
    streams: tuple[str, ...] = ()
    hashes: tuple[bytes, ...] = ()
    check: str = ""

    @property
    def success(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "success"

    @property
    def ran(self) -> bool:
        """Whether it left a log; an outcome `error` with a log is an episode that failed."""
        return self.outcome != "error" or bool(self.chain)


def read_row(store: Store, planned: Planned, allow_plugins: bool = False) -> Row | None:
    """The row of an episode that has ended, or none.

    Raises:
        ForeignLog: Where its log belongs lies that of another episode.
        InputError: Its log is damaged, or contradicts itself.
    """
    arm, seed, key = planned.arm, planned.seed, planned.key
    error = store.error(key)
    path = store.log(key)
    if error is not None:
        metrics: dict[str, float | None] = {**dict.fromkeys(METRICS), "success": 0.0}
        return Row(key, arm, seed, "error", error, "", "", 0.0, metrics, ())
    if not path.is_file():
        return None
    log = open_planned(path, planned, allow_plugins)
    content = _read(path)
    refuse_contradictions(log, content)
    decisions, streams = content.decisions, content.streams
    done = content.perturbations[0] if content.perturbations else pb.Perturbation()
    names = tuple(one.name for one in streams[0].streams) if streams else ()
    return Row(
        key=key,
        arm=arm,
        seed=seed,
        outcome=log.result["outcome"],
        reason=log.result["reason"],
        cause=log.check.get("cause") or log.result.get("cause", ""),
        check=log.check.get("answer", ""),
        chain=log.result["chain"],
        duration=float(log.result["sim_time_s"]),
        metrics=score(trace_of(log, decisions, content.truths)),
        acts=tuple(_act(one) for one in decisions),
        declared=tuple(done.streams),
        streams=names,
        hashes=tuple(_hashes(one, names) for one in streams),
    )


def _read(path: Path) -> Content:
    content, digest = Content(), ContentDigest()
    for item in walk(path):
        digest.add(item)
        if isinstance(item, Packet) and item.schema in READ:
            content.add(decode(item, path))
    return replace(content, digest=digest.text())


def _act(decision: pb.Decision) -> bytes:
    """What it made the robot do: the same digest means the same action and path."""
    acted = pb.Decision(action=decision.action, trajectory=decision.trajectory)
    data = acted.SerializeToString(deterministic=True)
    return hashlib.blake2b(data, digest_size=8).digest()


def _hashes(message: pb.Streams, names: Sequence[str]) -> bytes:
    """Of all streams in a fixed order; one that is not told is zeros."""
    told = {one.name: one.hash for one in message.streams}
    return b"".join(bytes.fromhex(told.get(name, "00" * SHORT))[:SHORT] for name in names)


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


@dataclass(frozen=True)
class Proof:
    """What the streams of a pair show up to its first differing action.

    Attributes:
        pairing: The streams that differ before it, and the decisions compared.
        undeclared: Those of them that no perturbation of only one of the two declares; nothing if
            the pair differs in what it says it differs in, and in no input besides.
    """

    pairing: Pairing
    undeclared: tuple[str, ...]


def prove(row: Row, twin: Row) -> Proof | None:
    """Hold the hashed streams of a pair against each other; none where one has no log."""
    if not row.hashes or not twin.hashes:
        return None
    both = zip(row.hashes, twin.hashes, strict=False)
    pairing = compare_hashes(
        (number, _by_stream(row, one), _by_stream(twin, other))
        for number, (one, other) in enumerate(both)
    )
    allowed = set(row.declared) ^ set(twin.declared)
    return Proof(pairing, tuple(sorted(pairing.changed - allowed)))


def _by_stream(row: Row, hashes: bytes) -> dict[str, bytes]:
    parts = range(0, len(hashes), SHORT)
    return {name: hashes[at : at + SHORT] for name, at in zip(row.streams, parts, strict=True)}


def write_table(rows: Sequence[Row], first_variant: str, path: Path) -> None:
    """Write the table as Parquet, whole or not at all; each row knows its twin."""
    by_arm = {(row.arm, row.seed): row for row in rows}
    flat = []
    for row in rows:
        reference = reference_of(row.arm, first_variant)
        twin = by_arm.get((reference, row.seed)) if reference else None
        flat.append({**_flat(row), **_paired(row, twin)})
    draft = path.with_suffix(".partial")
    pq.write_table(pa.Table.from_pylist(flat, schema=_schema(flat)), draft)
    draft.replace(path)


def _flat(row: Row) -> dict[str, Any]:
    arm = {**asdict(row.arm), "severity": float(row.arm.severity)}
    fields = {"key": row.key, **arm, "seed": row.seed, "outcome": row.outcome}
    told = {"reason": row.reason, "cause": row.cause, "check": row.check, "chain": row.chain}
    return {**fields, **told, "duration": row.duration, **row.metrics}


def _paired(row: Row, twin: Row | None) -> dict[str, Any]:
    """What the streams say of a row and its twin: nothing where there is no twin."""
    proof = None if twin is None else prove(row, twin)
    if proof is None:
        return dict.fromkeys(PAIRED)
    pairing = proof.pairing
    told = (sorted(pairing.changed), list(proof.undeclared))
    return dict(zip(PAIRED, (*told, pairing.compared, pairing.first_action), strict=True))


PAIRED: dict[str, pa.DataType] = {
    "streams_changed": pa.list_(pa.string()),
    "streams_undeclared": pa.list_(pa.string()),
    "decisions_compared": pa.int64(),
    "first_other_action": pa.int64(),
}
"""Columns of a pair, up to the first decision before which the body was asked for another thing."""


def _schema(flat: Sequence[dict[str, Any]]) -> pa.Schema:
    """Types that do not depend on which of the rows happen to have a value."""
    whole = {"seed": pa.int64(), **PAIRED}
    number = {"severity", "duration", *METRICS}
    kinds = {name: pa.float64() if name in number else pa.string() for name in flat[0]}
    return pa.schema(list({**kinds, **whole}.items()))
