"""Batches of rows for Rerun, sent as columns.

A message costs about as much for one row as for a hundred, and a long log has thousands.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rerun as rr

AT_A_TIME = 64
"""Number of decisions per batch, the pace at which an open viewer updates."""

LIVE_AT_A_TIME = 5
"""Number of decisions per batch of a log that is being written, which gains ten at a time."""


@dataclass
class _Column:
    """Rows of one entity.

    Attributes:
        kind: Archetype.
        places: Index in the batch of the decision of each row.
        values: One value for each row, by component.
        many: Whether a row has any number of instances instead of one.
    """

    kind: Any
    places: list[int] = field(default_factory=list)
    values: dict[str, list[Any]] = field(default_factory=dict)
    many: bool = False


class Rows:
    """Rows of many entities on the timelines `time` and `decision`."""

    def __init__(self, stream: rr.RecordingStream, root: str, at_a_time: int = AT_A_TIME) -> None:
        """Start a batch of a number of decisions for entities under a root."""
        self._stream = stream
        self._root = root
        self._at_a_time = at_a_time
        self._times: list[int] = []
        self._sequences: list[int] = []
        self._columns: dict[str, _Column] = {}

    def begin(self, time_ns: int, sequence: int) -> None:
        """Start a decision; rows added from now on belong to it."""
        if len(self._times) == self._at_a_time:
            self.send()
        self._times.append(time_ns)
        self._sequences.append(sequence)

    def put(self, entity: str, kind: Any, **values: Any) -> None:
        """Add a row of one instance: one value per component."""
        self._add(entity, kind, values)

    def put_many(self, entity: str, kind: Any, **values: Any) -> None:
        """Add a row of any number of instances: per component as many values, or one for all."""
        self._add(entity, kind, values).many = True

    def send(self) -> None:
        """Send the batch."""
        times = np.array(self._times, np.int64).astype("timedelta64[ns]")
        sequences = np.array(self._sequences, np.int64)
        for entity, column in self._columns.items():
            index = [
                rr.TimeColumn("time", duration=times[column.places]),
                rr.TimeColumn("decision", sequence=sequences[column.places]),
            ]
            self._stream.send_columns(f"{self._root}/{entity}", index, _components(column))
        self._times, self._sequences, self._columns = [], [], {}

    def _add(self, entity: str, kind: Any, values: dict[str, Any]) -> _Column:
        column = self._columns.setdefault(entity, _Column(kind))
        column.places.append(len(self._times) - 1)
        for name, value in values.items():
            column.values.setdefault(name, []).append(value)
        return column


def _components(column: _Column) -> Iterator[Any]:
    if not column.many:
        yield from column.kind.columns(**column.values)
        return
    for name, rows in column.values.items():
        columns = column.kind.columns(**{name: _joined(rows)})
        yield from columns.partition([len(row) for row in rows])


def _joined(rows: list[Any]) -> Any:
    """Concatenate the instances of all rows."""
    if isinstance(rows[0], np.ndarray):
        return np.concatenate(rows)
    return [value for row in rows for value in row]
