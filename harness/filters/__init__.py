"""Filters of returns, by name, in the order in which a sweep passes them on its way into the map.

A new one is a file with a subclass of `Filter`, and a line of `FILTERS`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.errors import unknown_name
from wayproof.harness.filters.false_returns import FalseReturns
from wayproof.harness.filters.filter import Filter, Origin
from wayproof.harness.filters.grazing import Grazing
from wayproof.harness.filters.ground_fit import GroundFit
from wayproof.harness.filters.lost_echoes import LostEchoes
from wayproof.harness.filters.lost_patches import LostPatches
from wayproof.harness.filters.missing_floor import LostFloor
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps import Representation
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

__all__ = ["AS_THEY_COME", "FILTERS", "NAMES", "Filter", "Filters", "Origin", "names_of"]

FILTERS: tuple[tuple[str, Callable[[Config, Mission, Representation], Filter]], ...] = (
    ("false_returns", FalseReturns),
    ("lost_patches", LostPatches),
    ("ground_fit", GroundFit),
    ("missing_floor", LostFloor),
    ("lost_echoes", LostEchoes),
    ("grazing", Grazing),
)
"""False returns come first: they stand out from the beams beside them, and no filter may have
dropped or moved one of these, and each would pass for the echo of a direction. Lost patches compare
directions with those of the sweeps before, so they are found before a sweep is levelled, each by
another plane. Missing floor is looked for at z = 0, where levelling puts it. Single lost echoes are
the last to be dropped: two filters before count silent beams, and need all of them. Grazing changes
no return, only what its beam clears."""

NAMES = tuple(name for name, _ in FILTERS)

AS_THEY_COME = ("grazing",)
"""Filters of a map in which all returns count as they come."""


class Filters:
    """The filters of one mission.

    Attributes:
        changed: Number of returns that each changed so far, by name.
    """

    def __init__(
        self, names: Sequence[str], config: Config, mission: Mission, a_map: Representation
    ) -> None:
        """Build the named ones, in the order of `FILTERS` however they are named.

        Raises:
            InputError: A name is none of them.
        """
        for name in names:
            if name not in NAMES:
                raise unknown_name("map.filters", name, NAMES)
        self._filters = {
            name: make(config, mission, a_map) for name, make in FILTERS if name in names
        }
        self.changed: Counter[str] = Counter()

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return a sweep as the map takes it in.

        Args:
            placed: The sweep in the world frame.
            origin: Where it comes from.
        """
        for name, one in self._filters.items():
            before, placed = placed, one(placed, origin)
            if count := _changed(before, placed):
                self.changed[name] += count
        return placed

    def contents(self) -> dict[str, bytes]:
        """Return what each one remembers that remembers anything, by name."""
        contents = {name: one.content() for name, one in self._filters.items()}
        return {name: content for name, content in contents.items() if content}

    def restore(self, contents: Mapping[str, bytes]) -> None:
        """Take over what others remember.

        Raises:
            ValueError: They are other filters, or the bytes are not theirs.
        """
        if (own := self.contents().keys()) != contents.keys():
            raise ValueError(f"filters {[*contents]}, expected {[*own]}")
        for name, content in contents.items():
            self._filters[name].restore(content)


def names_of(config: Config) -> tuple[str, ...]:
    """Return the filters of an episode: those of the settings, else all of the built-in stack.

    For a stack on trial the referee takes the returns as they come, unless the settings name
    filters: it would else admit or refuse space by a word that the stack never heard.
    """
    if config.map.filters is not None:
        return config.map.filters
    return NAMES if config.stack.name == BUILTIN else AS_THEY_COME


def _changed(before: WorldSweep, after: WorldSweep) -> int:
    """Return how many beams of a sweep a filter dropped or moved; one that levels moves all."""
    if after.ranges_mm is before.ranges_mm:
        return 0
    if after.directions is before.directions:
        return int(np.count_nonzero(after.ranges_mm != before.ranges_mm))
    return int(np.count_nonzero((before.ranges_mm != DROPPED) & (before.ranges_mm != NO_RETURN)))
