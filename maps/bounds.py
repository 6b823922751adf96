"""Bounds of settings, declared in the annotations of their fields."""

from __future__ import annotations

import functools
from collections.abc import Hashable
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints


class Bounds(NamedTuple):
    """Closed interval that a setting must lie in.

    Attributes:
        low: Least value.
        high: Greatest value.
        unit: Of both, for messages.
    """

    low: float
    high: float
    unit: str = ""


def check_fields(config: object, section: str) -> None:
    """Check every field of a dataclass annotated with `Bounds` or a `Literal`.

    Args:
        config: The instance; call this from its `__post_init__`.
        section: Name of its section, for messages.

    Raises:
        ValueError: A value lies outside of its bounds, is NaN, or is none of its choices.
    """
    for name, bounds in _bounds(type(config)).items():
        value = getattr(config, name)
        if not bounds.low <= value <= bounds.high:  # also refuses NaN
            expected = f"{bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()
            raise ValueError(f"{section}{name}: got {value:g}, expected {expected}")
    for name, choices in _choices(type(config)).items():
        value = getattr(config, name)
        if value not in choices:
            available = ", ".join(choices)
            raise ValueError(f"{section}{name}: got {value!r}, expected one of {available}")


def _hints(kind: Hashable) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


@functools.cache
def _bounds(kind: Hashable) -> dict[str, Bounds]:
    """Bounds by field name."""
    found = {}
    for name, hint in _hints(kind).items():
        for extra in getattr(hint, "__metadata__", ()):
            if isinstance(extra, Bounds):
                found[name] = extra
    return found


@functools.cache
def _choices(kind: Hashable) -> dict[str, tuple[Any, ...]]:
    """Choices by name of a `Literal` field."""
    hints = _hints(kind).items()
    return {name: get_args(hint) for name, hint in hints if get_origin(hint) is Literal}
