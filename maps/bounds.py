"""Bounds of settings, declared in the annotations of their fields."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args, get_origin, get_type_hints


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
    for name, hint in get_type_hints(type(config), include_extras=True).items():
        value = getattr(config, name)
        if get_origin(hint) is Literal and value not in get_args(hint):
            available = ", ".join(get_args(hint))
            raise ValueError(f"{section}{name}: got {value!r}, expected one of {available}")
        for bounds in getattr(hint, "__metadata__", ()):
            if isinstance(bounds, Bounds) and not bounds.low <= value <= bounds.high:  # nor NaN
                expected = f"{bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()
                raise ValueError(f"{section}{name}: got {value:g}, expected {expected}")
