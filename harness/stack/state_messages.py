"""The planner state as a message of a log, and read back: exactly, field by field."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.geometry import polyline_length
from wayproof.harness.input_messages import MAX_COORDINATE
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.state import ClosedGap, PlannerState, Route
from wayproof.planners import Trajectory
from wayproof.planners.jerk_limited import Profile

T = TypeVar("T")

MOST_NUMBERS = 1 << 18
"""Maximum number of values in one field; a path has some hundred points."""

MOST_RECORDS = 1000
"""Maximum number of records in one field."""

LONGEST = 1e5
"""Maximum length of a path, m, and duration of a motion, s: both are sampled."""

MOST_NS = 1 << 60
"""Times beyond every episode, ns."""


def state_message(state: PlannerState) -> pb.PlannerState:
    """Encode a planner state."""
    message = pb.PlannerState()
    _write(state, message)
    return message


def read_state(message: pb.PlannerState) -> PlannerState:
    """Read a planner state back, bit by bit.

    Raises:
        ValueError: It is none: a field has another size, or numbers out of range.
    """
    return _read(message, PlannerState)


def _write(record: object, message: Message) -> None:
    """Write the fields of a record into those of a message with the same names."""
    for field in message.DESCRIPTOR.fields:
        value, into = getattr(record, field.name), getattr(message, field.name)
        if isinstance(into, pb.Points):
            into.coordinates.extend(value.ravel().tolist())
        elif field.message_type and field.is_repeated:
            for one in value:
                _write(one, into.add())
        elif field.message_type and value is not None:
            into.SetInParent()
            _write(value, into)
        elif field.is_repeated:
            into.extend(np.asarray(value).tolist())
        elif value is not None:
            setattr(message, field.name, value)


def _read(message: Message, kind: type[T]) -> T:
    """Return the record of a kind that a message holds."""
    hints = get_type_hints(kind)
    fields = message.DESCRIPTOR.fields
    record = kind(**{one.name: _value(message, one, hints[one.name]) for one in fields})
    CHECKS.get(kind, lambda _: None)(record)
    return record


def _value(message: Message, field: Any, hint: Any) -> Any:
    """Return the value of a field by the type of its record's field."""
    value, name = getattr(message, field.name), field.name
    if isinstance(value, pb.Points):
        return _numbers(value.coordinates, name, columns=3).reshape(-1, 3)
    if field.message_type and field.is_repeated:
        if len(value) > MOST_RECORDS:
            raise ValueError(f"{name}: {len(value)} records, expected at most {MOST_RECORDS}")
        return tuple(_read(one, get_args(hint)[0]) for one in value)
    if field.message_type:
        kinds = [one for one in get_args(hint) if one is not type(None)] or [hint]
        absent = len(get_args(hint)) > 0 and not message.HasField(name)
        return None if absent else _read(value, kinds[0])
    if field.is_repeated and get_origin(hint) is tuple:
        numbers = _numbers(value, name, columns=1).tolist()
        if len(numbers) != len(get_args(hint)):
            raise ValueError(f"{name}: {len(numbers)} numbers, expected {len(get_args(hint))}")
        return tuple(numbers)
    if field.is_repeated:
        return _numbers(value, name, columns=1)
    if get_origin(hint) is Literal and value not in get_args(hint):
        raise ValueError(f"{name}: got {value[:40]!r}")
    if isinstance(value, float):
        _numbers([value], name, columns=1)
    if isinstance(value, int) and not abs(value) < MOST_NS:
        raise ValueError(f"{name}: {value}")
    return value


def _numbers(numbers: Any, name: str, columns: int) -> NDArray[np.float64]:
    """Return the numbers of a field, finite and as many as fill rows of some columns."""
    if len(numbers) > MOST_NUMBERS or len(numbers) % columns:
        raise ValueError(f"{name}: {len(numbers)} numbers, expected {columns} for each row")
    values = np.array(numbers, np.float64)
    if not (np.abs(values) <= MAX_COORDINATE).all():
        raise ValueError(f"{name}: numbers out of range")
    return values


def _check_path(record: Trajectory | Route) -> None:
    path = record.path
    if len(path) == 0 or polyline_length(path) > LONGEST:
        raise ValueError(f"path: {len(path)} points, expected some, and at most {LONGEST} m")


def _check_profile(profile: Profile) -> None:
    times = profile.times
    if not len(times) == len(profile.states) == len(profile.jerks) or (np.diff(times) < 0.0).any():
        raise ValueError("profile: pieces that do not follow each other")
    if not 0.0 <= profile.duration <= LONGEST:
        raise ValueError(f"duration: {profile.duration} s")


def _check_gap(gap: ClosedGap) -> None:
    if gap.tries == 0:
        raise ValueError("closed: a gap that was never tried")


def _check_state(state: PlannerState) -> None:
    if not state.committed:
        raise ValueError("committed: no trajectory")


CHECKS: dict[type, Callable[[Any], None]] = {
    Trajectory: _check_path,
    Route: _check_path,
    Profile: _check_profile,
    ClosedGap: _check_gap,
    PlannerState: _check_state,
}
"""Checks of what a record must be besides the types of its fields."""
