"""The floor of a sweep, fitted: see `maps/ground_fit.py`."""

from __future__ import annotations

from wayproof.harness.config import Config
from wayproof.harness.filters.filter import Filter, Origin
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps.ground_fit import GroundPlane, fit_ground, level


class GroundFit(Filter):
    """Levels a sweep by the plane of its floor, and puts the floor's own returns on it.

    Of robots that walk on a flat one.
    """

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep on level ground, where its floor is not as expected."""
        plane = fitted_ground(placed, self.config, self.mission)
        if plane is None:
            return placed
        found = level(placed.origins, placed.moments, placed.directions, placed.ranges_mm, plane)
        return WorldSweep(found.origins, found.directions, found.ranges_mm, placed.moments)


def fitted_ground(placed: WorldSweep, config: Config, mission: Mission) -> GroundPlane | None:
    """Fit the floor that a sweep is levelled by; None where it is as expected, or not flat.

    Args:
        placed: The sweep in the world frame; the floor is expected at z = 0.
        config: Settings.
        mission: Mission of a robot that walks or flies.
    """
    if not mission.planar or config.costmap.max_slope > 0.0:
        return None
    plane = fit_ground(placed.origins, placed.moments, placed.directions, placed.ranges_mm)
    return None if plane is None or plane.as_expected else plane
