"""Files of tables and trajectories: Parquet, CSV, TUM and KITTI."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole
from wayproof.harness.trajectory_error import rotations

POSE_COLUMNS = ("time_s", "x", "y", "z", "qw", "qx", "qy", "qz")
"""Columns that a trajectory file needs."""


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write all columns of a table, units and meanings as metadata of the fields."""
    with written_whole(path, "table") as partial:
        pq.write_table(table, partial)


def write_csv(table: pa.Table, path: Path) -> None:
    """Write the columns of a table but those of lists, which CSV has no form for."""
    flat = [one.name for one in table.schema if not pa.types.is_list(one.type)]
    with written_whole(path, "table") as partial:
        csv.write_csv(table.select(flat), partial)


def write_tum(table: pa.Table, path: Path) -> None:
    """Write a trajectory as the TUM RGB-D benchmark has it: `t x y z qx qy qz qw` a line, s and m.

    Numbers are written so that reading gives the same bits.

    Raises:
        InputError: The table is none of poses.
    """
    time, x, y, z, qw, qx, qy, qz = _poses(table)
    lines = zip(time, x, y, z, qx, qy, qz, qw, strict=True)
    _write_lines(path, lines)


def write_kitti(table: pa.Table, path: Path) -> None:
    """Write a trajectory as KITTI odometry has it: 3 x 4 of T_world_base a line, row by row, m.

    Raises:
        InputError: The table is none of poses.
    """
    _, x, y, z, *turns = _poses(table)
    rows = np.empty((len(x), 3, 4))
    rows[:, :, :3] = rotations(np.stack(turns, axis=1))
    rows[:, :, 3] = np.stack([x, y, z], axis=1)
    _write_lines(path, rows.reshape(-1, 12))


def _poses(table: pa.Table) -> list[NDArray[np.float64]]:
    if not set(POSE_COLUMNS) <= set(table.column_names):
        raise InputError("a trajectory is of poses: expected --table poses or truth")
    return [table[name].to_numpy() for name in POSE_COLUMNS]


def _write_lines(path: Path, lines: Iterable[Iterable[float]]) -> None:
    with written_whole(path, "trajectory") as partial, partial.open("w") as file:
        for line in lines:
            file.write(" ".join(repr(float(one)) for one in line) + "\n")


WRITERS: dict[str, Callable[[pa.Table, Path], None]] = {
    "parquet": write_parquet,
    "csv": write_csv,
    "tum": write_tum,
    "kitti": write_kitti,
}
"""Writers of a table by the name of their option."""
