"""Settings of a study that are drawn for each seed, alike in every arm, so that pairs hold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from wayproof.harness.config_document import setting_names
from wayproof.harness.errors import InputError, unknown_name
from wayproof.models.random_streams import stream

DIGITS = 4
"""Decimals of a drawn number, so that a command has it in full."""

Range = Sequence[float]


def check_ranges(ranges: Mapping[str, Range], fixed: Sequence[str]) -> None:
    """Check the ranges of a study.

    Args:
        ranges: Name of a setting -> least and greatest value.
        fixed: Settings that the study sets or varies otherwise.

    Raises:
        InputError: A setting is unknown or set twice, or its range is none.
    """
    taken, names = set(fixed), setting_names()
    for name, ends in ranges.items():
        if name not in names:
            raise unknown_name("setting in [randomise]", name, names)
        if name in taken or name == "seed":
            raise InputError(f"[randomise] {name}: set elsewhere, expected one of the two")
        taken.add(name)
        if len(ends) != 2 or not all(map(math.isfinite, ends)) or ends[0] > ends[1]:
            raise InputError(
                f"[randomise] {name}: got {list(ends)}, expected [least, greatest] value"
            )


def drawn(ranges: Mapping[str, Range], seed: int) -> list[str]:
    """Return the settings of one seed, as `--set` takes them.

    Each has a generator of its own: a setting that is added leaves the values of others alone.

    Args:
        ranges: Name of a setting -> least and greatest value; two whole numbers draw whole ones.
        seed: Seed of the episode.
    """
    settings = []
    for name, (low, high) in ranges.items():
        rng = stream(seed, f"randomise {name}", 0)
        if isinstance(low, int) and isinstance(high, int):
            value: float = int(rng.integers(low, high + 1))
        else:
            value = min(max(round(float(rng.uniform(low, high)), DIGITS), low), high)
        settings.append(f"{name}={value}")
    return settings
