"""Bounds of settings, declared in the annotations of their fields."""

from __future__ import annotations

from functools import cache
from typing import Literal, NamedTuple, get_args, get_origin, get_type_hints


class Bounds(NamedTuple):
    """Closed interval that a setting must lie in.

    Attributes:
        low: Least value.
        high: Greatest value.
        unit: Unit of both, for messages.
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
        ValueError: A value lies outside of its bounds, is NaN, or is none of its choices. None is
            none of these: it stands for a value that something else gives.
    """
    kind: type = type(config)
    for name, choices, intervals in _checks_of(kind):
        value = getattr(config, name)
        if value is None:
            continue
        if choices and value not in choices:
            raise ValueError(
                f"{section}{name}: got {value!r}, expected one of {', '.join(choices)}"
            )
        for low, high, unit in intervals:
            if not low <= value <= high:  # nor NaN
                expected = f"{low:g} to {high:g} {unit}".rstrip()
                raise ValueError(f"{section}{name}: got {value:g}, expected {expected}")


@cache
def _checks_of(kind: type) -> tuple[tuple[str, tuple[str, ...], tuple[Bounds, ...]], ...]:
    """Return name, choices and bounds of each field to be checked, read once for each class."""
    checks = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        choices = get_args(hint) if get_origin(hint) is Literal else ()
        metadata = getattr(hint, "__metadata__", ())
        intervals = tuple(one for one in metadata if isinstance(one, Bounds))
        if choices or intervals:
            checks.append((name, choices, intervals))
    return tuple(checks)
