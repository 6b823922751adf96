"""Values of messages and dataclasses by the names that their fields have in common."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from google.protobuf.message import Message

from wayproof.harness.interface.types import Array
from wayproof.harness.schema import stack_pb2 as sb


def values_for(kind: type[Message], record: object) -> dict[str, Any]:
    """Return the values of a record that a message has fields for, by their common names.

    Points (3,) become vectors, other arrays lists, or bytes where the message has them; fields that
    are other messages are left out.
    """
    values = {}
    for field in kind.DESCRIPTOR.fields:
        value = getattr(record, field.name, None)
        if value is None or (field.message_type and field.message_type.name != "Vector"):
            continue
        if field.message_type:
            value = [*map(vector_message, value)] if field.is_repeated else vector_message(value)
        elif isinstance(value, np.ndarray):
            value = value.tobytes() if field.type == field.TYPE_BYTES else value.ravel().tolist()
        values[field.name] = value
    return values


def values_of(message: Message, record: type) -> dict[str, Any]:
    """Return the values of a message that a dataclass has fields for; see `values_for`.

    Vectors become tuples of three numbers.
    """
    values = {}
    for name in (one.name for one in dataclasses.fields(record)):
        field = message.DESCRIPTOR.fields_by_name.get(name)
        if field is None or (field.message_type and field.message_type.name != "Vector"):
            continue
        value = getattr(message, name)
        if field.message_type:
            value = tuple(map(triple, value)) if field.is_repeated else triple(value)
        values[name] = value
    return values


def vector_message(values: Array | tuple[float, ...]) -> sb.Vector:
    """Encode three numbers."""
    x, y, z = (float(value) for value in values)
    return sb.Vector(x=x, y=y, z=z)


def triple(message: sb.Vector) -> tuple[float, float, float]:
    """Decode three numbers."""
    return message.x, message.y, message.z
