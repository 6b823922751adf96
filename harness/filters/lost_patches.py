"""Echoes that are lost over a part of the view, or in whole sweeps."""

from __future__ import annotations

import msgspec
import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.filters.filter import Filter, Origin
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps import Representation
from wayproof.maps.echo_history import MOST_CONTRADICTED, EchoHistory, are_contradicted


class LostPatches(Filter):
    """Drops the beams that fell silent lately, where the map contradicts them.

    Attributes:
        histories: Echoes by direction of each sensor that had a sweep.
    """

    def __init__(self, config: Config, mission: Mission, a_map: Representation) -> None:
        """Start before the first sweep."""
        super().__init__(config, mission, a_map)
        self.histories: dict[str, EchoHistory] = {}

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Take in the next sweep, and return it without these beams."""
        beams, history = len(placed.ranges_mm), self.histories.get(origin.sensor)
        if history is None:
            history = self.histories[origin.sensor] = EchoHistory()
        count = history.take_in(placed.directions, placed.ranges_mm)
        if not history.loses_echoes or 100 * count <= MOST_CONTRADICTED * beams:
            return placed
        recent = history.recently_silent(placed.directions, placed.ranges_mm)
        contradicted = are_contradicted(
            self.map,
            placed.origins[placed.moments[recent]],
            placed.directions[recent],
            origin.beams.range,
            beams,
        )
        return placed.without(recent) if contradicted else placed

    def content(self) -> bytes:
        """Return the echoes of each sensor."""
        kept = {
            sensor: (one.silent_sweeps.tobytes(), one.steady_sweeps)
            for sensor, one in self.histories.items()
        }
        return msgspec.msgpack.encode(kept)

    def restore(self, content: bytes) -> None:
        """Take over the echoes of each sensor."""
        kept = msgspec.msgpack.decode(content, type=dict[str, tuple[bytes, int]])
        self.histories = {sensor: EchoHistory() for sensor in kept}
        for sensor, (silent_sweeps, steady_sweeps) in kept.items():
            silent = np.frombuffer(silent_sweeps, np.uint8)
            self.histories[sensor].restore(silent, steady_sweeps)
