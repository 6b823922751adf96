"""Beams of a sensor as data: directions, scan poses and ranges in unsigned millimetres.

Nothing here needs the simulator, so a log can be replayed without it: a decision rebuilds its beams
bit by bit from the numbers of a `BeamTable`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

NO_RETURN = np.uint16(65535)
"""Report of a beam that met nothing within range: it clears space up to the sensor's range."""

DROPPED = np.uint16(0)
"""Report of a beam without information: it neither clears nor occupies."""

MILLIMETRES = 1000.0
"""Millimetres per metre."""

LONGEST_RANGE = 65.534
"""Longest distance that a report of 16 bits can hold, m: of all sensors but those that list their
beams."""

LONGEST_LISTED_RANGE = 1000.0
"""Longest distance of a sensor that lists its beams, m; its reports have 32 bits where needed."""

MOST_GAP = 1.5
"""Gap between the last column and the first, in steps, up to which a grid goes all around."""

MAX_BEAMS = 1 << 24
"""Maximum number of beams in a sweep, checked before an array of that size is made."""

Order = Literal["grid", "pairs", "list"]
Measures = Literal["range", "depth"]


@dataclass(frozen=True, eq=False)
class BeamTable:
    """Tables from which the beams of any sweep of one sensor are rebuilt.

    A `grid` fires every row at every column, the same beams in every sweep. `pairs` never repeats a
    sweep: its beams step through rows and columns at two rates and go on where the sweep before
    ended, see `directions`. A `list` has no tables: each sweep holds its own beams.

    Attributes:
        rows: (r, 2) cos and sin of elevation, or (r, 1) slopes z/x.
        columns: (c, 2) cos and sin of azimuth, or (c, 1) slopes y/x.
        beams: Beams in a sweep; r * c of a grid.
        order: `grid`, `pairs` or `list`.
        row_step: Rows from one beam of `pairs` to the next, up and down again.
        column_step: Columns from one beam of `pairs` to the next, modulo c.
        scan_poses: Sensor poses in one sweep, evenly spread over it; 1 is a global shutter.
        measures: `range` along the beam, or `depth` along the x axis (slopes alone).
    """

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    beams: int
    order: Order = "grid"
    row_step: int = 0
    column_step: int = 0
    scan_poses: int = 1
    measures: Measures = "range"

    def __post_init__(self) -> None:
        """Check the tables and make them read-only.

        Raises:
            ValueError: A table or a number is no sensor's; the message names it.
        """
        for name in ("rows", "columns"):
            table = np.array(getattr(self, name), dtype=np.float64, order="C")
            table.setflags(write=False)
            object.__setattr__(self, name, table)
        if self.listed:
            _check_list(self)
            return
        _check_tables(self)
        _check_order(self)

    @property
    def non_repetitive(self) -> bool:
        """Whether each sweep continues where the one before ended, instead of firing one grid."""
        return self.order == "pairs"

    @property
    def listed(self) -> bool:
        """Whether each sweep holds its own beams."""
        return self.order == "list"

    @property
    def closed(self) -> bool:
        """Whether the columns of a grid go all around, so that the last lies beside the first."""
        if len(self.columns) < 3 or self.columns.shape[1] != 2:
            return False
        step, gap = self.columns[1] - self.columns[0], self.columns[0] - self.columns[-1]
        return bool(np.square(gap).sum() <= MOST_GAP * MOST_GAP * np.square(step).sum())

    def with_every(self, stride: int) -> BeamTable:
        """Return every `stride`-th column of a grid; another order, or a rolling one, as it is."""
        if stride == 1 or self.order != "grid" or self.scan_poses > 1:
            return self
        columns = self.columns[::stride]
        return replace(self, columns=columns, beams=len(self.rows) * len(columns))

    @property
    def image_rows(self) -> int:
        """Rows of a sweep as an image: those of a grid, else one."""
        return 1 if self.non_repetitive else len(self.rows)


def _check_tables(table: BeamTable) -> None:
    shapes = table.rows.shape, table.columns.shape
    if any(len(shape) != 2 or 0 in shape for shape in shapes) or shapes[0][1] != shapes[1][1]:
        raise ValueError(f"rows, columns: got shapes {shapes[0]} and {shapes[1]}, expected one w")
    width = shapes[0][1]
    if width not in (1, 2):
        raise ValueError(f"rows, columns: got width {width}, expected 1 (slopes) or 2 (cos, sin)")
    if table.measures not in ("range", "depth"):
        raise ValueError(f"measures: got '{table.measures}', expected 'range' or 'depth'")
    if table.measures == "depth" and width != 1:
        raise ValueError("measures: got 'depth' with angles, expected slopes: all beams forward")
    for name, values in (("rows", table.rows), ("columns", table.columns)):
        fits = bool(np.isfinite(values).all())
        if fits and width == 2:  # the square of a huge number is none
            fits = bool((np.abs(values) < 2.0).all())
            fits = fits and np.abs(np.sqrt(np.square(values).sum(axis=1)) - 1.0).max() <= 1e-9
        if not fits:
            raise ValueError(f"{name}: expected finite slopes, or cos and sin of one angle a row")


def _check_list(table: BeamTable) -> None:
    if table.rows.size or table.columns.size or table.beams or table.measures != "range":
        raise ValueError(
            f"order: got 'list' with {table.rows.size} rows, {table.columns.size} columns, "
            f"{table.beams} beams and '{table.measures}', expected none and 'range'"
        )


def _check_order(table: BeamTable) -> None:
    full = len(table.rows) * len(table.columns)
    if table.order not in ("grid", "pairs"):
        raise ValueError(f"order: got '{table.order}', expected 'grid', 'pairs' or 'list'")
    if not table.non_repetitive and table.beams != full:
        raise ValueError(f"beams: got {table.beams}, expected rows x columns = {full}")
    if table.non_repetitive and min(table.beams, table.row_step, table.column_step) < 1:
        raise ValueError(
            f"beams, row_step, column_step: got {table.beams}, {table.row_step}, "
            f"{table.column_step}, expected each >= 1"
        )
    if table.beams > MAX_BEAMS:
        raise ValueError(f"beams: got {table.beams}, expected at most {MAX_BEAMS}")
    limit = table.beams if table.non_repetitive else len(table.columns)
    if not 1 <= table.scan_poses <= limit:
        raise ValueError(f"scan_poses: got {table.scan_poses}, expected 1 to {limit}")


def directions(table: BeamTable, sequence: int) -> NDArray[np.float64]:  # (beams, 3)
    """Return unit beam directions of one sweep, sensor frame (x forward, y left, z up).

    For `pairs`, beam k of sweep s is the i-th since the start, i = s * beams + k. Its column is
    (i * column_step) mod c. Its row follows a triangle wave: with p = (i * row_step) mod 2r it is p
    on the way up, p < r, and 2r - 1 - p on the way down, so every row is met equally often.

    Only products, sums and square roots, which IEEE 754 rounds alike everywhere: directions
    rebuilt from logged tables are the same bits on every machine.

    Args:
        table: Beams of the sensor.
        sequence: Number of the sweep, >= 0; a grid's beams do not depend on it.

    Raises:
        ValueError: The order is `list`.
    """
    if table.listed:
        raise ValueError("directions: a sensor of order 'list' has them in its sweeps")
    if not table.non_repetitive:
        return beam_directions(table.rows, table.columns)
    first = sequence * table.beams
    rows, columns = len(table.rows), len(table.columns)
    wave = _steps(first, table.beams, table.row_step, 2 * rows)
    row = np.where(wave < rows, wave, 2 * rows - 1 - wave)
    column = _steps(first, table.beams, table.column_step, columns)
    return _unit_vectors(table.rows[row], table.columns[column])


def _steps(first: int, count: int, step: int, period: int) -> NDArray[np.int64]:
    """Return ((first + k) * step) mod period for k < count; reduced first against overflow."""
    phase, step = int(first) * step % period, step % period
    return (phase + step * np.arange(count, dtype=np.int64)) % period


def pose_indices(table: BeamTable) -> NDArray[np.int32]:  # (beams,)
    """Return the index of the scan pose that each beam leaves from.

    A grid fires column after column in the order of its table, `pairs` beam after beam. Of m poses
    the i-th holds the beams of the i-th m-th of the sweep, and is the pose at the end of that part:
    the last one is the sweep's end.
    """
    if table.non_repetitive:
        return _shares(table.beams, table.scan_poses)
    return np.tile(_shares(len(table.columns), table.scan_poses), len(table.rows))


def _shares(count: int, parts: int) -> NDArray[np.int32]:
    return (np.arange(count, dtype=np.int64) * parts // count).astype(np.int32)


def pose_offsets(table: BeamTable, period_ns: int) -> NDArray[np.int64]:  # (scan_poses,)
    """Return the time of each scan pose from the end of its sweep, ns: increasing, the last is 0.

    Args:
        table: Beams of the sensor.
        period_ns: Time between the ends of two sweeps, ns.
    """
    before_end = np.arange(table.scan_poses - 1, -1, -1, dtype=np.int64)
    return -(before_end * period_ns // table.scan_poses)


def beam_directions(
    rows: NDArray[np.float64], columns: NDArray[np.float64]
) -> NDArray[np.float64]:  # (rows * columns, 3)
    """Return unit beam directions of a grid, sensor frame, row-major; see `directions`.

    Args:
        rows: (r, 2) cos and sin of elevation, or (r, 1) slopes z/x.
        columns: (c, 2) cos and sin of azimuth, or (c, 1) slopes y/x.
    """
    return _unit_vectors(rows[:, None], columns[None]).reshape(-1, 3)


def _unit_vectors(
    row: NDArray[np.float64], column: NDArray[np.float64]
) -> NDArray[np.float64]:  # (..., 3)
    """Return the beams of rows (..., w) and columns (..., w) that broadcast together."""
    if row.shape[-1] == 2:
        x = row[..., 0] * column[..., 0]
        y = row[..., 0] * column[..., 1]
        z = np.broadcast_to(row[..., 1], x.shape)
    else:
        slope_z, slope_y = row[..., 0], column[..., 0]
        norm = np.sqrt(1.0 + slope_z * slope_z + slope_y * slope_y)
        x, y, z = 1.0 / norm, slope_y / norm, slope_z / norm
    return np.stack([x, y, z], axis=-1)


def quantise(distance: NDArray[np.float64], range_limit: float) -> NDArray[np.uint16]:
    """Return ranges (n,), m, in unsigned mm; misses (negative) and ranges beyond: NO_RETURN."""
    millimetres = np.rint(distance * MILLIMETRES)
    beyond = (distance < 0.0) | (distance > range_limit)
    return np.where(beyond, NO_RETURN, np.clip(millimetres, 1, NO_RETURN - 1)).astype(np.uint16)


def ray_ranges(
    table: BeamTable,
    directions: NDArray[np.float64],
    millimetres: NDArray[np.uint16] | NDArray[np.uint32],
) -> NDArray[np.uint16] | NDArray[np.uint32]:  # (n,)
    """Return a report as ranges along its beams, which a map takes, mm.

    A depth along the x axis is divided by the beam's share of that axis, rounded to the millimetre
    and clipped to the largest count. `DROPPED` and `NO_RETURN` stay.

    Args:
        table: Beams of the sensor; `measures` says what it reports.
        directions: (n, 3) sensor frame, as `directions` gives them.
        millimetres: (n,) as reported.
    """
    if table.measures == "range":
        return millimetres
    along = np.minimum(np.rint(millimetres / directions[:, 0]), float(NO_RETURN - 1))
    return np.where(millimetres == NO_RETURN, NO_RETURN, along.astype(np.uint16))


def rotate(
    R_world_sensor: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n, 3)
    """Turn beam directions to the world frame, element by element.

    Not a matrix product: BLAS may fuse or reorder, and a replay must give the same bits anywhere.

    Args:
        R_world_sensor: (3, 3), or (n, 3, 3) with one rotation for each beam.
        directions: (n, 3), sensor frame.
    """
    turned = np.empty((len(directions), 3))
    several = np.ndim(R_world_sensor) == 3
    rotations = R_world_sensor if several else np.asarray(R_world_sensor)[None]
    # Writable, as numba compiles again for arrays that are not.
    writable: tuple[Literal["C"], Literal["W"]] = ("C", "W")
    beams = np.require(directions, np.float64, writable)
    turn(np.require(rotations, np.float64, writable), beams, turned)
    return turned


@kernel
def turn(
    rotations: NDArray[np.float64],  # (n, 3, 3), or (1, 3, 3) for all
    directions: NDArray[np.float64],  # (n, 3)
    turned: NDArray[np.float64],  # (n, 3) out
) -> None:
    """Turn directions by their rotations."""
    step = 1 if len(rotations) > 1 else 0
    for i in range(len(directions)):
        R = rotations[i * step]
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        for axis in range(3):
            turned[i, axis] = x * R[axis, 0] + y * R[axis, 1] + z * R[axis, 2]
