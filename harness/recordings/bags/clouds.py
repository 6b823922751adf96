"""Point clouds of ROS: points of any layout, with or without a time for each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.container import RawMessage
from wayproof.harness.recordings.bags.messages import CLOUD, decode
from wayproof.harness.recordings.bags.parts import Cloud, stamp_of
from wayproof.harness.recordings.bags.vendors import VENDORS
from wayproof.harness.recordings.options import Broken, Faults

TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""`datatype` of a PointField -> type of numpy."""

TIME_FIELDS = ("t", "time", "timestamp", "time_stamp", "ts", "offset_time", "time_offset")
"""Names that drivers give to the time of a point."""

OWN_TIME = "t"
"""Field of a point's time in written clouds: as of Ouster, nanoseconds from the stamp, 32 bits."""

LONGEST_SWEEP_NS = 10 * 10**9
"""Greatest length of a sweep where the time between stamps is not known, ns."""


SHORTEST_SWEEP_NS = 10**6
"""Time that a sweep of points with times takes at least, ns."""

UNITS = {1e9: "s", 1e6: "ms", 1e3: "us", 1.0: "ns"}

FEW = 0.05
"""Share of the times at either end that the length of a sweep is measured without: a few may be
wrong."""

LEAST_POINTS = 20
"""Number of points from which on some are left out of the length."""

LONGEST_SHARE = 1.2
"""Greatest length of a sweep, as a share of the time between stamps."""

MOST_LATENCY_NS = 5e8
"""Time from a stamp within which the points are of the same clock, at least, ns."""


class PointTime(NamedTuple):
    """The field with the time of a point.

    Attributes:
        name: Name of the field.
        unit_ns: Its unit, ns.
        absolute: Whether it counts as the stamps do; else from the sweep's stamp.
        period_ns: Time between stamps, ns; None where it is not known.
    """

    name: str
    unit_ns: float
    absolute: bool
    period_ns: float | None = None

    @property
    def text(self) -> str:
        """Name and unit in words."""
        unit = UNITS.get(self.unit_ns, "share of the period")
        since = "the epoch" if self.absolute else "the stamp"
        return f"'{self.name}', {unit} since {since}"


def read_cloud(raw: RawMessage) -> Cloud:
    """Return the points of a message of `CLOUDS`, with their times if it has some.

    Raises:
        Broken: Its sizes do not agree with each other, or it has no x, y, z.
    """
    return READERS[raw.type](decode(raw))


def _of_fields(message: Any) -> Cloud:
    rows = _rows(message)
    fields = {field.name: field for field in message.fields[:256]}
    if not {"x", "y", "z"} <= fields.keys():
        raise Broken("a cloud without x, y, z")
    order = ">" if message.is_bigendian else "<"
    points = np.empty((len(rows), 3), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for axis, name in enumerate("xyz"):
            points[:, axis] = _column(rows, fields[name], order)
    named = next((name for name in TIME_FIELDS if name in fields), "")
    times = _column(rows, fields[named], order) if named else None
    stamp = stamp_of(message.header)
    return Cloud(points, times, time_field=named, stamp_ns=stamp, frame=message.header.frame_id)


def finite(cloud: Cloud, faults: Faults) -> Cloud:
    """Return a cloud without the points that are not finite, which it counts."""
    good = np.isfinite(cloud.points).all(axis=1)
    if good.all():
        return cloud
    faults["point: not finite"] += int((~good).sum())
    times = None if cloud.times is None else cloud.times[good]
    return cloud._replace(points=cloud.points[good], times=times)


def point_time(cloud: Cloud, period_ns: float | None = None) -> PointTime | None:
    """Determine the unit and the origin of the times of a cloud's points.

    A sweep takes about the time between stamps: the unit is the usual one of the driver if the
    points then lie 0.5 to 1.2 periods apart, else another one in which they do; times from 0 to 1
    may be shares of the period. A recording may have left out sweeps, so the usual unit may also
    make a shorter sweep. The usual one is the only guide without a period.

    Raises:
        Broken: In every unit the points lie further apart than the stamps.
    """
    if cloud.times is None or len(cloud.times) == 0:
        return None
    times = cloud.times[np.isfinite(cloud.times)].astype(np.float64)
    if len(times) == 0:
        return None
    if cloud.is_ns:
        return PointTime(cloud.time_field, 1.0, False, period_ns)
    low, high = float(times.min()), float(times.max())
    if len(times) >= LEAST_POINTS:
        inner = np.quantile(times, (FEW, 1.0 - FEW))
        spread = float(inner[1] - inner[0]) / (1.0 - 2.0 * FEW)
        low, high = max(low, float(inner[0]) - spread), min(high, float(inner[1]) + spread)
    else:
        spread = high - low
    unit = _usual_unit(cloud.times.dtype, spread)
    share = False
    if period_ns is not None and spread > 0.0:
        units = [unit, *(one for one in UNITS if one != unit)]
        fits = [one for one in units if 0.5 <= spread * one / period_ns <= LONGEST_SHARE]
        is_share = 0.5 <= spread <= 1.001 and low > -0.001 and high <= 1.001
        shorter = [one for one in units if 0.02 <= spread * one / period_ns <= LONGEST_SHARE]
        if fits:
            unit = fits[0]
        elif is_share and cloud.times.dtype.kind == "f":
            unit, share = period_ns, True
        elif shorter:
            unit = shorter[0]
        elif spread * unit > LONGEST_SHARE * period_ns:
            raise Broken(
                f"times '{cloud.time_field}' of points {spread:g} apart, in no unit a sweep of"
                f" {period_ns / 1e9:g} s"
            )
    middle = float(np.median(times)) * unit
    absolute = not share and abs(middle - cloud.stamp_ns) < abs(middle)
    return PointTime(cloud.time_field, unit, absolute, period_ns)


def _usual_unit(kind: np.dtype[Any], spread: float) -> float:
    """Return the unit that drivers give to times of a type, ns.

    An integer is in nanoseconds (Ouster's `t`, Livox's `offset_time`), or in microseconds if a
    sweep would else take less than a millisecond (Velodyne's packets), a floating-point number in
    seconds (Velodyne's `time`, Hesai's `timestamp`), or in nanoseconds if the points would else be
    more than 10 s apart (Livox's `timestamp`).
    """
    if kind.kind == "f":
        return 1e9 if spread * 1e9 <= LONGEST_SWEEP_NS else 1.0
    return 1e3 if 1e3 <= spread < SHORTEST_SWEEP_NS else 1.0


def offsets_ns(
    cloud: Cloud, time: PointTime, faults: Faults
) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    """Return times of points after the stamp, ns, and which points (n,) have them.

    Points far from the others in time are left out. Times of another clock than the stamp's are
    counted from the first point. None if many are far from each other.
    """
    assert cloud.times is not None
    times = cloud.times
    if times.dtype.kind in "iu" and time.unit_ns == 1.0 and time.absolute:
        offsets = (times.astype(np.int64) - cloud.stamp_ns).astype(np.float64)
    else:
        with np.errstate(over="ignore", invalid="ignore"):
            offsets = times.astype(np.float64) * time.unit_ns
        if time.absolute:
            offsets -= float(cloud.stamp_ns)
    period = LONGEST_SWEEP_NS if time.period_ns is None else time.period_ns
    finite_ones = offsets[np.isfinite(offsets)]
    middle = float(np.median(finite_ones)) if len(finite_ones) else 0.0
    near = np.abs(offsets - middle) <= LONGEST_SHARE * period  # false for NaN
    faults["point: time far from the others"] += int((~near).sum())
    if near.sum() < 0.9 * len(near):
        return None
    offsets = offsets[near]
    if abs(middle) > max(3.0 * period, MOST_LATENCY_NS):
        faults["sweep: times of another clock, from its first point"] += 1
        offsets = offsets - offsets.min()
    return np.rint(offsets).astype(np.int64), near


def _rows(message: Any) -> NDArray[np.uint8]:  # (n, point_step)
    """Return the bytes of each point; the rows of an organised cloud may have bytes between."""
    height, width, step = int(message.height), int(message.width), int(message.point_step)
    count = height * width
    data: NDArray[np.uint8] = message.data
    if count == 0:
        return np.empty((0, max(step, 1)), np.uint8)
    if step == 0:
        raise Broken("a cloud of points of no bytes")
    row_step = int(message.row_step)
    if row_step <= width * step or height == 1 or len(data) == count * step:
        if len(data) < count * step:
            raise Broken(f"a cloud of {len(data)} bytes for {count} points of {step}")
        return data[: count * step].reshape(count, step)
    if len(data) < height * row_step:
        raise Broken(f"a cloud of {len(data)} bytes for {height} rows of {row_step}")
    rows = data[: height * row_step].reshape(height, row_step)[:, : width * step]
    return np.ascontiguousarray(rows).reshape(count, step)


def _column(rows: NDArray[np.uint8], field: Any, order: str) -> NDArray[Any]:  # (n,)
    """Return one field of all points."""
    if field.datatype not in TYPES:
        raise Broken(f"a field of type {field.datatype}")
    kind = np.dtype(order + TYPES[field.datatype])
    offset = int(field.offset)
    if len(rows) and offset + kind.itemsize > rows.shape[1]:
        raise Broken(f"a field at byte {offset} of {rows.shape[1]}")
    piece = np.ascontiguousarray(rows[:, offset : offset + kind.itemsize])
    return piece.view(kind).reshape(-1) if len(rows) else np.empty(0, kind)


READERS = {kind: read for one in VENDORS for kind, read in one.clouds.items()}
READERS[CLOUD] = _of_fields
"""Type -> reader of its points."""
