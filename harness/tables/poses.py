"""Tables of poses: the estimated ones with their error, and the true ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pyarrow as pa

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.tables.column import Column


class PosePair(NamedTuple):
    """The estimated pose of a decision, and the true one; None where nothing knows the truth."""

    estimate: pb.Pose
    truth: pb.Truth | None


def seconds(message: pb.Pose | pb.Truth) -> float:
    """Return the simulated time of a message, s."""
    return message.timestamp.ToNanoseconds() * 1e-9


def position_error(pair: PosePair) -> float | None:
    """Return the distance between the estimated and the true position, m."""
    if pair.truth is None:
        return None
    return math.dist(pair.estimate.position, pair.truth.position)


def heading(quaternion: Sequence[float]) -> float:
    """Return the heading of a quaternion w x y z, rad."""
    w, x, y, z = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def heading_error(pair: PosePair) -> float | None:
    """Return the estimated less the true heading, wrapped to [-pi, pi], rad."""
    if pair.truth is None:
        return None
    both = heading(pair.estimate.quaternion) - heading(pair.truth.quaternion)
    return math.remainder(both, 2.0 * math.pi)


AXES = (("x", 0), ("y", 1), ("z", 2))
TURN = (("qw", 0), ("qx", 1), ("qy", 2), ("qz", 3))


def _estimated(name: str, index: int, part: str, unit: str) -> Column[PosePair]:
    def value(pair: PosePair) -> float:
        return float(getattr(pair.estimate, part)[index])

    return Column(name, pa.float64(), f"estimated {part} of the base", value, unit)


def _true(name: str, index: int, part: str, unit: str) -> Column[pb.Truth]:
    def value(truth: pb.Truth) -> float:
        return float(getattr(truth, part)[index])

    return Column(name, pa.float64(), f"true {part} of the base", value, unit)


def _true_beside(name: str, index: int) -> Column[PosePair]:
    def value(pair: PosePair) -> float | None:
        return None if pair.truth is None else float(pair.truth.position[index])

    return Column(f"true_{name}", pa.float64(), "true position of the base", value, "m")


def _speed(truth: pb.Truth) -> float:
    return math.hypot(*truth.velocity)


Number = Callable[[PosePair], object]

POSES: tuple[Column[PosePair], ...] = (
    Column("sequence", pa.int64(), "number of the decision", lambda one: one.estimate.sequence),
    Column("time_s", pa.float64(), "simulated time", lambda one: seconds(one.estimate), "s"),
    *(_estimated(name, index, "position", "m") for name, index in AXES),
    *(_estimated(name, index, "quaternion", "") for name, index in TURN),
    Column(
        "position_sigma",
        pa.float64(),
        "standard deviation of the position that the estimator states",
        lambda one: one.estimate.position_sigma,
        "m",
    ),
    Column(
        "heading_sigma",
        pa.float64(),
        "the same of the heading",
        lambda one: one.estimate.heading_sigma,
        "rad",
    ),
    *(_true_beside(name, index) for name, index in AXES),
    Column("position_error_m", pa.float64(), "distance of the two positions", position_error, "m"),
    Column("heading_error_rad", pa.float64(), "estimated less true heading", heading_error, "rad"),
)

TRUTH: tuple[Column[pb.Truth], ...] = (
    Column("sequence", pa.int64(), "number of the decision", lambda one: one.sequence),
    Column("time_s", pa.float64(), "simulated time", seconds, "s"),
    *(_true(name, index, "position", "m") for name, index in AXES),
    *(_true(name, index, "quaternion", "") for name, index in TURN),
    *(_true(f"v{name}", index, "velocity", "m/s") for name, index in AXES),
    Column("speed", pa.float64(), "length of the velocity", _speed, "m/s"),
    Column(
        "clearance_m",
        pa.float64(),
        "distance from the body to anything but the floor; 2 is 2 or more",
        lambda one: one.clearance_m,
        "m",
    ),
    Column(
        "collisions",
        pa.int64(),
        "times that it began to touch something",
        lambda one: one.collisions,
    ),
    Column(
        "hit_by_mover",
        pa.int64(),
        "times that a mover ran into it at rest",
        lambda one: one.hit_by_mover,
    ),
)
