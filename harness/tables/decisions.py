"""Table of decisions: one row for each, with the fields of its record."""

from __future__ import annotations

import pyarrow as pa

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.tables.column import Column

Value = Column[pb.Decision]

POINTS = pa.list_(pa.list_(pa.float64(), 3))
"""Type of a list of points."""


def _verdict(decision: pb.Decision) -> pb.Verdict | None:
    return decision.verdict if decision.HasField("verdict") else None


def _points(points: object) -> list[tuple[float, float, float]]:
    return [(one.x, one.y, one.z) for one in points]  # type: ignore[attr-defined]  # protobuf's


def _stage(name: str) -> Value:
    field = f"{name}_ms"
    meaning = f"measured wall time of the stage '{name}'"
    return Value(field, pa.float64(), meaning, lambda one: getattr(one.stages, field), "ms")


def _number(name: str, meaning: str, unit: str = "") -> Value:
    return Value(name, pa.float64(), meaning, lambda one: getattr(one, name), unit)


def _text(name: str, meaning: str) -> Value:
    return Value(name, pa.string(), meaning, lambda one: getattr(one, name))


def latency_ms(decision: pb.Decision) -> float:
    """Return the wall time from the sweep to the decision, ms."""
    stages = decision.stages
    return float(stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms)


DECISIONS: tuple[Value, ...] = (
    Value("sequence", pa.int64(), "number of the decision", lambda one: one.sequence),
    Value(
        "time_s",
        pa.float64(),
        "simulated time of its inputs",
        lambda one: one.timestamp.ToNanoseconds() * 1e-9,
        "s",
    ),
    _text("action", "follow, slow, stop_and_wait, explore, recover, goal or abort"),
    _text("label", "failure label; none without a failure"),
    _text("reason", "why the action was chosen, in words"),
    Value("predicate", pa.string(), "kind of the reason", lambda one: one.predicate.kind or None),
    Value("x", pa.float64(), "estimated position", lambda one: one.position[0], "m"),
    Value("y", pa.float64(), "estimated position", lambda one: one.position[1], "m"),
    Value("z", pa.float64(), "estimated position", lambda one: one.position[2], "m"),
    Value("position_sigma", pa.float64(), "of that position", lambda one: one.position_sigma, "m"),
    _text("representation", "kind of the map"),
    _text("map_version", "hash of the map's content"),
    _text("unknown_policy", "forbid, penalize or allow"),
    _number("resolution_m", "edge of a cell", "m"),
    _number("inflation_radius_m", "body, margin and half the diagonal of a cell", "m"),
    _number("localization_margin_m", "part of it for the error of the pose", "m"),
    _number("evidence_age_s", "age of the oldest evidence along the path", "s"),
    _text("planner", "planner of a search; empty where the path was kept"),
    _number("path_length_m", "length of the global path", "m"),
    _number("path_cost", "cost of the global path"),
    _number("committed_length_m", "length of the committed path, which ends at rest", "m"),
    _number("least_clearance_m", "clearance in the map along the committed path, at least", "m"),
    *(_stage(name) for name in ("sense", "map", "costmap", "plan")),
    Value("latency_ms", pa.float64(), "sum of the stages", latency_ms, "ms"),
    _number("delay_s", "simulated delay until the robot follows the decision", "s"),
    _number("deadline_s", "delay from which on the decision is discarded", "s"),
    Value("deadline_missed", pa.bool_(), "whether it was late", lambda one: one.deadline_missed),
    Value(
        "verdict",
        pa.string(),
        "the referee's: admitted, unknown or blocked; null for the built-in stack",
        lambda one: found.verdict if (found := _verdict(one)) else None,
    ),
    Value(
        "verdict_free_m",
        pa.float64(),
        "length of the way before the first overlap",
        lambda one: found.free_m if (found := _verdict(one)) else None,
        "m",
    ),
    Value(
        "guard_cut",
        pa.bool_(),
        "whether the guard braked; null for the built-in stack",
        lambda one: found.cut if (found := _verdict(one)) else None,
    ),
    Value(
        "committed_path",
        POINTS,
        "points (x, y, z) of the committed path",
        lambda one: _points(one.trajectory.path),
        "m",
    ),
    Value(
        "global_path",
        POINTS,
        "points (x, y, z) of the global path",
        lambda one: _points(one.global_path),
        "m",
    ),
    _text("chain", "hash of this record and all before it"),
)
