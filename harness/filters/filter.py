"""The interface of a filter of returns: a placed sweep in, one with fewer errors out.

A filter works on what came, and may remember earlier sweeps: it is built once per mission.
"""

from __future__ import annotations

from typing import NamedTuple

from wayproof.harness.config import Config
from wayproof.harness.inputs import Beams, Pose, WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps import Representation
from wayproof.maps.sweep import Ranges


class Origin(NamedTuple):
    """Where a sweep comes from.

    Attributes:
        sensor: Name of the sensor.
        beams: Its geometry.
        pose: Estimated pose of the body.
        deviation: Standard deviation of the ranges as they came, m; 0 where it is not estimated.
    """

    sensor: str
    beams: Beams
    pose: Pose
    deviation: float


class Filter:
    """One filter of one mission.

    Attributes:
        config: Settings.
        mission: Mission of a robot that walks or flies.
        map: Map of the sweeps before.
    """

    def __init__(self, config: Config, mission: Mission, a_map: Representation) -> None:
        """Start before the first sweep."""
        self.config, self.mission, self.map = config, mission, a_map

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep with the filter's word on it; the same object where it has none.

        Args:
            placed: The sweep in the world frame.
            origin: Where it comes from.
        """
        raise NotImplementedError

    def content(self) -> bytes:
        """Return what it remembers of the sweeps so far; empty if nothing."""
        return b""

    def restore(self, content: bytes) -> None:
        """Take over what another one remembers.

        Raises:
            ValueError: The bytes are not from `content`.
        """
        if content:
            raise ValueError(f"{len(content)} bytes, expected none")


def image_of(placed: WorldSweep, beams: Beams) -> Ranges:
    """Return the ranges of a sweep whose beams are a grid, (rows, columns), mm."""
    shape = len(beams.table.rows), len(beams.table.columns)
    image: Ranges = placed.ranges_mm.reshape(shape)
    return image
