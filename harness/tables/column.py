"""Columns of tables: name, Arrow type, unit and meaning, and the value of each row."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import pyarrow as pa

Source = TypeVar("Source")


@dataclass(frozen=True)
class Column(Generic[Source]):
    """A column of a table.

    Attributes:
        name: Name of the column.
        type: Arrow type of its values.
        meaning: Meaning, in a few words.
        value: Function from the row's source to its value; None is null.
        unit: Unit of a number; empty without one.
    """

    name: str
    type: pa.DataType
    meaning: str
    value: Callable[[Source], object]
    unit: str = ""

    @property
    def field(self) -> pa.Field:
        """Return the field of an Arrow schema, with unit and meaning as metadata."""
        metadata = {"unit": self.unit, "meaning": self.meaning}
        return pa.field(self.name, self.type, metadata=metadata)


def table_of(columns: Sequence[Column[Source]], rows: Iterable[Source]) -> pa.Table:
    """Return the table of all rows."""
    kept = list(rows)
    arrays = [pa.array([one.value(row) for row in kept], one.type) for one in columns]
    return pa.Table.from_arrays(arrays, schema=pa.schema([one.field for one in columns]))
