"""A lidar, its reports and beam tables, for tests of sensors."""

import dataclasses

import numpy as np

from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import (
    DROPPED,
    BeamTable,
    directions,
)
from wayproof.models.sensors.devices import (
    SpinningLidar,
)
from wayproof.models.sensors.measure import measure

LIDAR = SpinningLidar(
    elevations=(0.0,),
    azimuths=100_000,
    range=50.0,
    minimum_range=0.5,
    rate=10.0,
    no_return_is_free=False,
    source="test",
)
ALONG = directions(LIDAR.beam_table(), 0)  # (100000, 3)


def with_noise(noise, **changes):
    return dataclasses.replace(LIDAR, noise=noise, **changes)


def reports(device, distance, cosine=None, seed=0):
    """Reports of all of LIDAR's beams on one true distance, m; NaN without information."""
    true = np.full(len(ALONG), distance)
    cosines = None if cosine is None else np.full(len(ALONG), cosine)
    millimetres = measure(device, true, cosines, ALONG, stream(seed, "lidar", 7))
    return np.where(millimetres == DROPPED, np.nan, millimetres / 1000.0)


def pairs(rows=5, columns=7, beams=11, row_step=3, column_step=2, **more):
    angle = np.linspace(-0.5, 0.5, max(rows, columns))
    table = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return BeamTable(
        rows=table[:rows],
        columns=table[:columns],
        beams=beams,
        order="pairs",
        row_step=row_step,
        column_step=column_step,
        **more,
    )


def same_after_a_log(table):
    """The table as a log would give it back: plain floats."""
    rows, columns = (np.array(t.ravel().tolist()) for t in (table.rows, table.columns))
    width = table.rows.shape[1]
    return dataclasses.replace(
        table, rows=rows.reshape(-1, width), columns=columns.reshape(-1, width)
    )
