"""Table of a study: one row for each episode, derived from its log and that of its twin."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from wayproof.harness.config import HASH_SEPARATOR
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.log.digest import ContentDigest
from wayproof.harness.log.reader import Log
from wayproof.harness.log.streams import Pairing, compare_hashes
from wayproof.harness.metrics import METRICS, score
from wayproof.harness.replay.consistency import refuse_contradictions
from wayproof.harness.replay.content import Content
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.summary import Summary, summarize
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import Arm, Planned
from wayproof.harness.study.store import Store
from wayproof.harness.trace import trace_of
from wayproof.models.world_files import shape_digest
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

READ = {
    kind.DESCRIPTOR.full_name
    for kind in (pb.Decision, pb.Truth, pb.Streams, pb.Perturbation, pb.RecordedMotion, pb.Pose)
}
"""Schemas of the messages that are decoded; sweeps, most of a log, are not."""

SHORT = 8
"""Number of bytes of a stream's hash that a row keeps."""


@dataclass(frozen=True)
class Row:
    """One episode.

    Attributes:
        key: Content address of the episode.
        arm: Arm of the episode.
        seed: Seed of the episode.
        outcome: Outcome; `error` without a log.
        reason: Reason of the outcome.
        cause: Cause of a failure, as corrected by a check; empty without one.
        evidence: Evidence for the cause that the episode recorded, in words.
        log: Path of the log; empty without one.
        chain: Hash over the decisions; empty without a log.
        duration: Simulated time, s; 0 without a log.
        metrics: Name -> value; without a log all are None but a success of 0.
        acts: Digest of each decision's action and committed path.
        declared: Input streams that its perturbation declares to change.
        streams: Names of all streams.
        check: Answer of the check of the cause; empty without one.
        hashes: First bytes of all streams' hashes of each decision, concatenated.
        actions: Action of each decision.
        way: Judgement of a recording's way; None of a simulated episode.
        world: Digest of an imported world's shape, or of a recording; empty of a generated world.
        reference: Arm that it is compared with; None of one that others refer to.
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
    actions: tuple[str, ...] = ()
    way: Summary | None = None
    world: str = ""
    reference: Arm | None = None
    evidence: str = ""
    log: str = ""

    @property
    def success(self) -> bool:
        """Return whether the goal was reached."""
        return self.outcome == "success"

    @property
    def ran(self) -> bool:
        """Return whether there is a log; an outcome `error` with a log is a failed episode.

        A stack that fails in its first decision leaves no chain, but a cause.
        """
        return self.outcome != "error" or bool(self.chain or self.cause)


def read_row(store: Store, planned: Planned, allow_plugins: bool = False) -> Row | None:
    """Return the row of an episode; None if it has not ended.

    Raises:
        ForeignLog: In place of its log is that of another episode.
        InputError: Its log is damaged, or contradicts itself.
    """
    arm, seed, key = planned.arm, planned.seed, planned.key
    error = store.error(key)
    path = store.log(key)
    if error is not None:
        return Row(
            key=key,
            arm=arm,
            seed=seed,
            outcome="error",
            reason=error,
            cause="",
            chain="",
            duration=0.0,
            metrics=_without_decisions(),
            acts=(),
            reference=planned.reference,
        )
    if not path.is_file():
        return None
    log = open_planned(path, planned, allow_plugins)
    content = _read(path)
    refuse_contradictions(log, content)
    decisions, streams = content.decisions, content.streams
    done = content.perturbations[0] if content.perturbations else pb.Perturbation()
    names = tuple(one.name for one in streams[0].streams) if streams else ()
    way = _judge_way(path, content.digest, allow_plugins) if planned.source else None
    return Row(
        key=key,
        arm=arm,
        seed=seed,
        outcome=log.result["outcome"],
        reason=log.result["reason"],
        cause=log.check.get("cause") or log.result.get("cause", ""),
        evidence=log.result.get("cause_evidence", ""),
        log=str(path),
        check=log.check.get("answer", ""),
        chain=log.result["chain"],
        duration=float(log.result["sim_time_s"]),
        metrics=_metrics(log, content, way) if decisions else _without_decisions(),
        acts=tuple(_act(one) for one in decisions),
        declared=tuple(done.streams),
        streams=names,
        hashes=tuple(_hashes(one, names) for one in streams),
        actions=tuple(one.action for one in decisions),
        way=way,
        world=_world_of(log, planned),
        reference=planned.reference,
    )


def _world_of(log: Log, planned: Planned) -> str:
    """Return the digest of what a world or a recording is, whatever its name and its spelling.

    Raises:
        InputError: The scene is not one of ours.
    """
    _, imported, digest = log.config.world.partition(HASH_SEPARATOR)
    if not imported or planned.source is not None:
        return digest
    try:
        return shape_digest(safe_scene(log.scene))
    except NOT_COMPILED as error:
        raise InputError(
            f"log '{log.path}': its scene: {' '.join(str(error).split())[:200]}"
        ) from None


def _metrics(log: Log, content: Content, way: Summary | None) -> dict[str, float | None]:
    trace = trace_of(
        log,
        content.decisions,
        content.truths,
        content.motions,
        content.poses,
        content.perturbations,
    )
    if way is not None:
        trace = replace(trace, admitted_share=way.admitted_share)
    return score(trace)


@functools.cache
def _judge_way(log: Path, digest: str, allow_plugins: bool) -> Summary:
    """Judge the way of a log over a recording, once for each digest of its content."""
    return summarize(assess(log, allow_plugins))


def _without_decisions() -> dict[str, float | None]:
    """Return the metrics of an episode that ended before its first decision: no success."""
    return {**dict.fromkeys(METRICS), "success": 0.0, "progress": 0.0}


def _read(path: Path) -> Content:
    content, digest = Content(), ContentDigest()
    for item in walk(path):
        digest.add(item)
        if isinstance(item, Packet) and item.schema in READ:
            content.add(decode(item, path))
    return replace(content, digest=digest.text())


def _act(decision: pb.Decision) -> bytes:
    """Return a digest of the action and the path of a decision."""
    acted = pb.Decision(action=decision.action, trajectory=decision.trajectory)
    data = acted.SerializeToString(deterministic=True)
    return hashlib.blake2b(data, digest_size=8).digest()


def _hashes(message: pb.Streams, names: Sequence[str]) -> bytes:
    """Return the short hashes of all streams in a fixed order; zeros for a missing one."""
    hashes = {one.name: one.hash for one in message.streams}
    return b"".join(bytes.fromhex(hashes.get(name, "00" * SHORT))[:SHORT] for name in names)


def twins_of(rows: Sequence[Row]) -> dict[str, Row]:
    """Return key of a row -> the row of its reference and seed, of those that have one."""
    by_arm = {(row.arm, row.seed): row for row in rows}
    pairs = ((row.key, by_arm.get((row.reference, row.seed))) for row in rows if row.reference)
    return {key: twin for key, twin in pairs if twin is not None}


def first_difference(row: Row, twin: Row) -> int | None:
    """Return the number of the first decision with another action or path; None without one."""
    for number, (one, other) in enumerate(zip(row.acts, twin.acts, strict=False)):
        if one != other:
            return number
    return None if len(row.acts) == len(twin.acts) else min(len(row.acts), len(twin.acts))


def other_action(row: Row, twin: Row) -> int | None:
    """Return the number of the first decision with another action; None without one."""
    both = zip(row.actions, twin.actions, strict=False)
    return next((number for number, (one, other) in enumerate(both) if one != other), None)


def share_differing(acts: Sequence[object], others: Sequence[object]) -> float:
    """Return the share of decisions, of the longer episode, that acted otherwise."""
    longest = max(len(acts), len(others))
    alike = sum(one == other for one, other in zip(acts, others, strict=False))
    return 1.0 - alike / longest if longest else 0.0


@dataclass(frozen=True)
class Proof:
    """Comparison of the streams of a pair up to its first differing action.

    Attributes:
        pairing: The streams that differ before it, and the decisions compared.
        undeclared: Differing streams that no perturbation of one of the two declares; empty if the
            pair differs only as declared.
    """

    pairing: Pairing
    undeclared: tuple[str, ...]


def prove(row: Row, twin: Row) -> Proof | None:
    """Compare the hashed streams of a pair; None if one has no log."""
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


def write_table(rows: Sequence[Row], path: Path) -> None:
    """Write the table as Parquet, atomically, with the comparison of each row with its twin.

    Without any row, as where all logs are of other episodes, there is no table.
    """
    if not rows:
        path.unlink(missing_ok=True)
        return
    draft = path.with_suffix(".partial")
    pq.write_table(arrow_table(rows), draft)
    draft.replace(path)


def arrow_table(rows: Sequence[Row]) -> pa.Table:
    """Return the table, with the comparison of each row with its twin; at least one row."""
    twins = twins_of(rows)
    flat = [{**_flat(row), **_paired(row, twins.get(row.key))} for row in rows]
    return pa.Table.from_pylist(flat, schema=_schema(flat))


def _flat(row: Row) -> dict[str, Any]:
    arm = {**asdict(row.arm), "severity": float(row.arm.severity)}
    fields = {"key": row.key, **arm, "seed": row.seed, "outcome": row.outcome}
    texts = {"reason": row.reason, "cause": row.cause, "check": row.check, "chain": row.chain}
    return {**fields, **texts, "duration": row.duration, **row.metrics}


def _paired(row: Row, twin: Row | None) -> dict[str, Any]:
    """Return the columns of the comparison of a row with its twin; empty without one."""
    proof = None if twin is None else prove(row, twin)
    if proof is None:
        return dict.fromkeys(PAIRED)
    pairing = proof.pairing
    return {
        "streams_changed": sorted(pairing.changed),
        "streams_undeclared": list(proof.undeclared),
        "decisions_compared": pairing.compared,
        "first_other_action": pairing.first_action,
    }


PAIRED: dict[str, pa.DataType] = {
    "streams_changed": pa.list_(pa.string()),
    "streams_undeclared": pa.list_(pa.string()),
    "decisions_compared": pa.int64(),
    "first_other_action": pa.int64(),
}
"""Columns of a pair -> type; they cover the decisions up to the first other action."""


def _schema(flat: Sequence[dict[str, Any]]) -> pa.Schema:
    """Return types that do not depend on which rows have a value."""
    whole = {"seed": pa.int64(), **PAIRED}
    number = {"severity", "duration", *METRICS}
    kinds = {name: pa.float64() if name in number else pa.string() for name in flat[0]}
    return pa.schema(list({**kinds, **whole}.items()))
