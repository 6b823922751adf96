"""Tables of a log by name, read from the file in one pass each; nothing is simulated."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from wayproof.harness.input_messages import decode_ranges
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

INTEGER, NUMBER, TEXT, FLAG = pa.int64(), pa.float64(), pa.string(), pa.bool_()
POINTS = pa.list_(pa.list_(NUMBER, 3))


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        name: Name of the column.
        type: Arrow type of its values.
        unit: Unit of a number; empty without one.
        meaning: Meaning, in a few words.
        value: Function from the source of a row to its value, None for null; its attribute of the
            column's name if None is given.
    """

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    value: Callable[[Any], object] | None = None

    @property
    def field(self) -> pa.Field:
        """Return the field of an Arrow schema, with unit and meaning as metadata."""
        return pa.field(self.name, self.type, metadata={"unit": self.unit, "meaning": self.meaning})

    def array(self, rows: Sequence[Any]) -> pa.Array:
        """Return the values of all rows."""
        value = self.value
        if value is None:
            return pa.array([getattr(row, self.name) for row in rows], self.type)
        return pa.array([value(row) for row in rows], self.type)


class Table(NamedTuple):
    """A kind of table: its columns, and the function that reads the sources of its rows."""

    columns: tuple[Column, ...]
    rows: Callable[[Log], Iterable[Any]]

    def __call__(self, log: Log) -> pa.Table:
        """Return the table of a log.

        Raises:
            InputError: The log is damaged, or what the table is of was left out.
        """
        rows, schema = list(self.rows(log)), pa.schema([one.field for one in self.columns])
        return pa.Table.from_arrays([one.array(rows) for one in self.columns], schema=schema)


class PosePair(NamedTuple):
    """The estimated pose of a decision, and the true one; None where nothing knows the truth."""

    estimate: pb.Pose
    truth: pb.Truth | None


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


def _sweeps(log: Log) -> Iterator[pb.Sweep]:
    log.check_sweeps()
    return log.only(pb.Sweep)


def _ranges_m(sweep: pb.Sweep) -> NDArray[np.float32]:  # (rows * columns,)
    """Return the ranges of a sweep, m: NaN where the beam was dropped, inf without a return."""
    coded = decode_ranges(sweep)
    metres: NDArray[np.float32] = (coded * np.float32(1e-3)).astype(np.float32)
    metres[coded == DROPPED] = np.nan
    metres[coded == NO_RETURN] = np.inf
    return metres


def _heading(quaternion: Sequence[float]) -> float:
    """Return the heading of a quaternion w x y z, rad."""
    w, x, y, z = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _heading_error(pair: PosePair) -> float | None:
    if pair.truth is None:
        return None
    both = _heading(pair.estimate.quaternion) - _heading(pair.truth.quaternion)
    return math.remainder(both, 2.0 * math.pi)


def _position_error(pair: PosePair) -> float | None:
    if pair.truth is None:
        return None
    return math.dist(pair.estimate.position, pair.truth.position)


def _time_s(message: Any) -> float:
    return float(message.timestamp.ToNanoseconds() * 1e-9)


def _latency_ms(decision: pb.Decision) -> float:
    stages = decision.stages
    return float(stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms)


def _points(points: Iterable[pb.Point]) -> list[tuple[float, float, float]]:
    return [(one.x, one.y, one.z) for one in points]


def _vector(
    names: Sequence[str], unit: str, meaning: str, part: Callable[[Any], Sequence[float] | None]
) -> tuple[Column, ...]:
    """Return the columns of the components of a vector, null where there is none."""

    def component(index: int) -> Callable[[Any], object]:
        return lambda row: None if (found := part(row)) is None else float(found[index])

    return tuple(
        Column(name, NUMBER, unit, meaning, component(index)) for index, name in enumerate(names)
    )


def _stage(name: str) -> Column:
    meaning = f"measured wall time of the stage '{name}'"
    return Column(
        f"{name}_ms", NUMBER, "ms", meaning, lambda one: getattr(one.stages, f"{name}_ms")
    )


def _verdict(
    name: str, kind: pa.DataType, unit: str, meaning: str, value: Callable[[pb.Verdict], object]
) -> Column:
    """Return a column of the referee's verdict; null for the built-in stack."""

    def of(decision: pb.Decision) -> object:
        return value(decision.verdict) if decision.HasField("verdict") else None

    return Column(name, kind, unit, meaning, of)


XYZ, WXYZ = ("x", "y", "z"), ("qw", "qx", "qy", "qz")

DECISIONS = (
    Column("sequence", INTEGER, "", "number of the decision"),
    Column("time_s", NUMBER, "s", "simulated time of its inputs", _time_s),
    Column("action", TEXT, "", "follow, slow, stop_and_wait, explore, recover, goal or abort"),
    Column("label", TEXT, "", "failure label; none without a failure"),
    Column("reason", TEXT, "", "why the action was chosen, in words"),
    Column("predicate", TEXT, "", "kind of the reason", lambda one: one.predicate.kind or None),
    *_vector(XYZ, "m", "estimated position", lambda one: one.position),
    Column("position_sigma", NUMBER, "m", "of that position"),
    Column("representation", TEXT, "", "kind of the map"),
    Column("map_version", TEXT, "", "hash of the map's content"),
    Column("unknown_policy", TEXT, "", "forbid, penalize or allow"),
    Column("resolution_m", NUMBER, "m", "edge of a cell"),
    Column("inflation_radius_m", NUMBER, "m", "body, margin and half the diagonal of a cell"),
    Column("localization_margin_m", NUMBER, "m", "part of it for the error of the pose"),
    Column("evidence_age_s", NUMBER, "s", "age of the oldest evidence along the path"),
    Column("planner", TEXT, "", "planner of a search; empty where the path was kept"),
    Column("path_length_m", NUMBER, "m", "length of the global path"),
    Column("path_cost", NUMBER, "", "cost of the global path"),
    Column("committed_length_m", NUMBER, "m", "length of the committed path, which ends at rest"),
    Column(
        "least_clearance_m",
        NUMBER,
        "m",
        "clearance in the map along the committed path, at least",
    ),
    *(_stage(name) for name in ("sense", "map", "costmap", "plan")),
    Column("latency_ms", NUMBER, "ms", "sum of the stages", _latency_ms),
    Column("delay_s", NUMBER, "s", "simulated delay until the robot follows the decision"),
    Column("deadline_s", NUMBER, "s", "delay from which on the decision is discarded"),
    Column("deadline_missed", FLAG, "", "whether it was late"),
    _verdict(
        "verdict",
        TEXT,
        "",
        "the referee's: admitted, stale, unknown or blocked; null for the built-in stack",
        lambda one: one.verdict,
    ),
    _verdict(
        "verdict_free_m",
        NUMBER,
        "m",
        "length of the way before the first overlap",
        lambda one: one.free_m,
    ),
    _verdict(
        "guard_cut",
        FLAG,
        "",
        "whether the guard braked; null for the built-in stack",
        lambda one: one.cut,
    ),
    Column(
        "committed_path",
        POINTS,
        "m",
        "points (x, y, z) of the committed path",
        lambda one: _points(one.trajectory.path),
    ),
    Column(
        "global_path",
        POINTS,
        "m",
        "points (x, y, z) of the global path",
        lambda one: _points(one.global_path),
    ),
    Column("chain", TEXT, "", "hash of this record and all before it"),
)

TRUTH = (
    Column("sequence", INTEGER, "", "number of the decision"),
    Column("time_s", NUMBER, "s", "simulated time", _time_s),
    *_vector(XYZ, "m", "true position of the base", lambda one: one.position),
    *_vector(WXYZ, "", "true quaternion of the base", lambda one: one.quaternion),
    *_vector(("vx", "vy", "vz"), "m/s", "true velocity of the base", lambda one: one.velocity),
    Column("speed", NUMBER, "m/s", "length of the velocity", lambda one: math.hypot(*one.velocity)),
    Column(
        "clearance_m",
        NUMBER,
        "m",
        "distance from the body to what it must not touch; 2 is 2 or more",
    ),
    Column("collisions", INTEGER, "", "times that it began to touch something"),
    Column("hit_by_mover", INTEGER, "", "times that a mover ran into it at rest"),
)

POSES = (
    Column("sequence", INTEGER, "", "number of the decision", lambda one: one.estimate.sequence),
    Column("time_s", NUMBER, "s", "simulated time", lambda one: _time_s(one.estimate)),
    *_vector(XYZ, "m", "estimated position of the base", lambda one: one.estimate.position),
    *_vector(WXYZ, "", "estimated quaternion of the base", lambda one: one.estimate.quaternion),
    Column(
        "position_sigma",
        NUMBER,
        "m",
        "standard deviation of the position that the estimator states",
        lambda one: one.estimate.position_sigma,
    ),
    Column(
        "heading_sigma",
        NUMBER,
        "rad",
        "the same of the heading",
        lambda one: one.estimate.heading_sigma,
    ),
    *_vector(
        ("true_x", "true_y", "true_z"),
        "m",
        "true position of the base",
        lambda one: None if one.truth is None else one.truth.position,
    ),
    Column("position_error_m", NUMBER, "m", "distance of the two positions", _position_error),
    Column("heading_error_rad", NUMBER, "rad", "estimated less true heading", _heading_error),
)

SWEEPS = (
    Column("sequence", INTEGER, "", "number of the decision"),
    Column("time_s", NUMBER, "s", "simulated time of its end", _time_s),
    Column("sensor", TEXT, "", "name of the sensor"),
    Column("rows", INTEGER, "", "rows of the image"),
    Column("columns", INTEGER, "", "columns of the image"),
    Column(
        "ranges_m",
        pa.list_(pa.float32()),
        "m",
        "range of each beam, row by row; NaN is dropped, inf is without return",
        _ranges_m,
    ),
)

TABLES: dict[str, Table] = {
    "decisions": Table(DECISIONS, Log.decisions),
    "truth": Table(TRUTH, Log.truth),
    "poses": Table(POSES, pose_pairs),
    "sweeps": Table(SWEEPS, _sweeps),
}
"""Tables by name; a log without a simulator's truth has no rows of it."""
