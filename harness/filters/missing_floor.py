"""Beams that lost their echo from the floor, apart from holes: see `maps/missing_floor.py`."""

from __future__ import annotations

import msgspec
import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.filters.filter import Filter, Origin
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps import Representation
from wayproof.maps.ground_fit import TILES
from wayproof.maps.missing_floor import MissingFloor, lost_echoes_of_one
from wayproof.models.sensors.beams import NO_RETURN


class LostFloor(Filter):
    """Drops the beams of a walking robot that lost their echo from the floor.

    Attributes:
        missing: Evidence of missing floor in the sweeps before; None where each sweep is judged
            alone: where unknown floor may be entered, one sweep that misses floor must keep the
            robot from it.
    """

    def __init__(self, config: Config, mission: Mission, a_map: Representation) -> None:
        """Start before the first sweep."""
        super().__init__(config, mission, a_map)
        kept = mission.planar and config.costmap.unknown_policy == "forbid"
        self.missing = MissingFloor() if kept else None

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep without these beams.

        Where the ground slopes the floor is looked for at the height of the feet.
        """
        if not self.mission.planar:
            return placed
        if self.missing is None and not (placed.ranges_mm == NO_RETURN).any():
            return placed
        origins = placed.origins
        if self.config.costmap.max_slope > 0.0:
            if self.mission.rest_height == 0.0:
                return placed
            feet = origin.pose.position[2] - self.mission.rest_height
            origins = origins - np.array([0.0, 0.0, feet])
        find = lost_echoes_of_one if self.missing is None else self.missing.lost_echoes
        moments, directions, ranges_mm = placed.moments, placed.directions, placed.ranges_mm
        return placed.without(find(origins, moments, directions, ranges_mm, origin.beams.range))

    def content(self) -> bytes:
        """Return the silent sweeps by tile of floor, and the middle tile."""
        if self.missing is None:
            return b""
        return msgspec.msgpack.encode((self.missing.silent_sweeps.tobytes(), self.missing.tile))

    def restore(self, content: bytes) -> None:
        """Take over the silent sweeps by tile of floor, and the middle tile."""
        if self.missing is None:
            super().restore(content)
            return
        tiles, tile = msgspec.msgpack.decode(content, type=tuple[bytes, tuple[int, int]])
        silent_sweeps = np.frombuffer(tiles, np.uint8)
        if silent_sweeps.size == TILES * TILES:
            silent_sweeps = silent_sweeps.reshape(TILES, TILES)
        self.missing.restore(silent_sweeps, tile)
