"""Types of ROS 2 messages as DDS announces them: named as ROS's middleware mangles them, final."""

from __future__ import annotations

from functools import cache
from typing import Any

from cyclonedds import idl
from cyclonedds.idl import types
from cyclonedds.idl.annotations import extensibility
from rosbags.interfaces import Nodetype

from wayproof.harness.interface.ros2.messages import STORE, Message

PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "string": str,
    **{name: getattr(types, name) for name in ("int8", "uint8", "int32", "uint32")},
    **{name: getattr(types, name) for name in ("float32", "float64")},
}
"""Cyclone DDS's types by ROS's names."""


@cache
def wire_type(kind: type[Message]) -> Any:
    """Return the type of a message as it is announced; its samples are bytes, encoded before.

    Cyclone DDS's own encoder in Python takes 130 ms for a cloud of a megabyte.
    """
    made = _struct(kind.__msgtype__)
    made.serialize = _encoded
    made.deserialize = classmethod(_received)
    made.deserialize_key = classmethod(_received)  # of a writer that has left
    return made


def _encoded(sample: Any, *_: object, **__: object) -> bytes:
    data: bytes = sample.data
    return data


def _received(cls: Any, data: bytes, /, *_: object, **__: object) -> Any:
    sample = cls()
    sample.data = data
    return sample


def _struct(name: str) -> Any:
    package, _, short = name.rpartition("/")
    typename = f"{package.replace('/', '::')}::dds_::{short}_"
    _, fields = STORE.fielddefs[name]
    made = idl.make_idl_struct(
        short, typename, {field: _type(one) for field, one in fields}, dataclassify=False
    )
    return extensibility("final")(made)


@cache
def _member(name: str) -> Any:
    return _struct(name)


def _type(description: Any) -> Any:  # nested pairs, as of rosbags
    node, detail = description
    if node is Nodetype.BASE:
        return PRIMITIVES[detail[0]]
    if node is Nodetype.NAME:
        return _member(detail)
    one, length = _type(detail[0]), detail[1]
    array: Any = types.array
    sequence: Any = types.sequence
    return array[one, length] if node is Nodetype.ARRAY else sequence[one]
