"""Types of ROS 2 messages as DDS announces them: named as ROS's middleware mangles them, final."""

from __future__ import annotations

from typing import Any

from cyclonedds import idl
from cyclonedds.idl import types
from cyclonedds.idl.annotations import extensibility

from wayproof.harness.interface.ros2.cdr import Kind, fields_of
from wayproof.harness.interface.ros2.messages import Message

NUMBERS: dict[str, Any] = {
    "?": bool,
    "i1": types.int8,
    "u1": types.uint8,
    "i4": types.int32,
    "u4": types.uint32,
    "f4": types.float32,
    "f8": types.float64,
}
"""Cyclone DDS's types by numpy's."""

_wire_types: dict[str, Any] = {}
_structs: dict[str, Any] = {}


def wire_type(kind: type[Message]) -> Any:
    """Return the type of a message as it is announced; its samples are bytes, encoded before.

    Cyclone DDS's own encoder in Python takes 130 ms for a cloud of a megabyte.
    """
    if kind.TYPE not in _wire_types:
        made = _struct(kind)
        made.serialize = _encoded
        made.deserialize = classmethod(_received)
        made.deserialize_key = classmethod(_received)  # of a writer that has left
        _wire_types[kind.TYPE] = made
    return _wire_types[kind.TYPE]


def _encoded(sample: Any, *_: object, **__: object) -> bytes:
    data: bytes = sample.data
    return data


def _received(cls: Any, data: bytes, /, *_: object, **__: object) -> Any:
    sample = cls()
    sample.data = data
    return sample


def _struct(kind: type[Message]) -> Any:
    package, _, name = kind.TYPE.rpartition("/")
    typename = f"{package.replace('/', '::')}::dds_::{name}_"
    fields = {field: _type(one) for field, one in fields_of(kind)}
    made = idl.make_idl_struct(name, typename, fields, dataclassify=False)
    return extensibility("final")(made)


def _type(kind: Kind) -> Any:
    if kind.code is not None:
        one = NUMBERS[kind.code.dtype]
        if kind.code.length is None:
            return one
        array: Any = types.array
        return array[one, kind.code.length] if kind.code.length else _sequence(one)
    if kind.message is None:
        return str
    name = kind.message.TYPE
    if name not in _structs:
        _structs[name] = _struct(kind.message)
    return _sequence(_structs[name]) if kind.sequence else _structs[name]


def _sequence(one: Any) -> Any:
    sequence: Any = types.sequence
    return sequence[one]
