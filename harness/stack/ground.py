"""Evidence of the floor in a sweep, before the map takes it in."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.config import Config
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps.ground_fit import EXPECTED, fit_ground, level
from wayproof.models.sensors.beams import DROPPED, NO_RETURN


def on_level_ground(
    placed: WorldSweep, range_m: float, config: Config, mission: Mission
) -> WorldSweep:
    """A sweep levelled by its own floor, where that is not as expected: `map.ground_fit`.

    Args:
        placed: The sweep in the world frame; the floor is expected at z = 0.
        range_m: Range up to which its beams without return clear, m.
        config: Settings.
        mission: Of a robot that walks or flies; only for the first is anything done.
    """
    flat = mission.planar and config.costmap.max_slope == 0.0
    if not (config.map.ground_fit and flat):
        return placed
    plane = fit_ground(placed.origins, placed.moments, placed.directions, placed.ranges_mm)
    plane = plane or EXPECTED  # echoes get lost where too few come back for a plane, too
    if plane.as_expected and not (placed.ranges_mm == NO_RETURN).any():
        return placed
    found = level(
        placed.origins, placed.moments, placed.directions, placed.ranges_mm, range_m, plane
    )
    ranges_mm = (placed.ranges_mm if plane.as_expected else found.ranges_mm).copy()
    ranges_mm[found.lost] = DROPPED
    if plane.as_expected:
        return replace(placed, ranges_mm=ranges_mm)
    return WorldSweep(found.origins, found.directions, ranges_mm, placed.moments)
