"""Evidence of the floor in a sweep, before the map takes it in."""

from __future__ import annotations

from wayproof.harness.config import Config
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps.ground_fit import GroundPlane, fit_ground, level, lost_echoes
from wayproof.models.sensors.beams import NO_RETURN


def on_level_ground(
    placed: WorldSweep, range_m: float, config: Config, mission: Mission
) -> WorldSweep:
    """Return a sweep levelled by its own floor, where that is not as expected: `map.ground_fit`.

    Args:
        placed: The sweep in the world frame; the floor is expected at z = 0.
        range_m: Range up to which its beams without return clear, m.
        config: Settings.
        mission: Mission of a robot that walks or flies; only the sweeps of the first are levelled.
    """
    if not _is_fitted(config, mission):
        return placed
    plane = fitted_ground(placed, config, mission)
    if plane is not None:
        found = level(
            placed.origins,
            placed.moments,
            placed.directions,
            placed.ranges_mm,
            plane,
            two_sided=config.behaviour.floor_stands_noise,
        )
        placed = WorldSweep(found.origins, found.directions, found.ranges_mm, placed.moments)
    if not (placed.ranges_mm == NO_RETURN).any():
        return placed
    lost = lost_echoes(placed.origins, placed.moments, placed.directions, placed.ranges_mm, range_m)
    return placed.without(lost)


def fitted_ground(placed: WorldSweep, config: Config, mission: Mission) -> GroundPlane | None:
    """Fit the floor that a sweep is levelled by; None where it is as expected, or nothing is done.

    Args:
        placed: The sweep in the world frame.
        config: Settings.
        mission: Mission of a robot that walks or flies.
    """
    if not _is_fitted(config, mission):
        return None
    plane = fit_ground(
        placed.origins,
        placed.moments,
        placed.directions,
        placed.ranges_mm,
        twice=config.behaviour.floor_stands_noise,
    )
    return None if plane is None or plane.as_expected else plane


def _is_fitted(config: Config, mission: Mission) -> bool:
    return config.map.ground_fit and mission.planar and config.costmap.max_slope == 0.0
