"""Table of sweeps: one row for each, with the ranges of its beams."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from wayproof.harness.input_messages import decode_ranges
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.tables.column import Column
from wayproof.models.sensors.beams import DROPPED, NO_RETURN


def ranges_m(sweep: pb.Sweep) -> NDArray[np.float32]:  # (rows * columns,)
    """Return the ranges of a sweep, m: NaN where the beam was dropped, inf without a return."""
    coded = decode_ranges(sweep)
    metres: NDArray[np.float32] = (coded * np.float32(1e-3)).astype(np.float32)
    metres[coded == DROPPED] = np.nan
    metres[coded == NO_RETURN] = np.inf
    return metres


SWEEPS: tuple[Column[pb.Sweep], ...] = (
    Column("sequence", pa.int64(), "number of the decision", lambda one: one.sequence),
    Column(
        "time_s",
        pa.float64(),
        "simulated time of its end",
        lambda one: one.timestamp.ToNanoseconds() * 1e-9,
        "s",
    ),
    Column("sensor", pa.string(), "name of the sensor", lambda one: one.sensor),
    Column("rows", pa.int64(), "rows of the image", lambda one: one.rows),
    Column("columns", pa.int64(), "columns of the image", lambda one: one.columns),
    Column(
        "ranges_m",
        pa.list_(pa.float32()),
        "range of each beam, row by row; NaN is dropped, inf is without return",
        ranges_m,
        "m",
    ),
)
