"""Evidence of the floor in a sweep, before the map takes it in."""

from __future__ import annotations

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.inputs import Pose, WorldSweep
from wayproof.harness.mission import Mission
from wayproof.maps.ground_fit import GroundPlane, fit_ground, level
from wayproof.maps.missing_floor import MissingFloor, lost_echoes_of_one
from wayproof.models.sensors.beams import NO_RETURN


def missing_floor_of(config: Config, mission: Mission) -> MissingFloor | None:
    """Return the evidence of missing floor before the first sweep; None where none is kept.

    Where unknown floor may be entered, one sweep that misses floor must keep the robot from it.
    """
    kept = config.map.ground_fit and mission.planar
    return MissingFloor() if kept and config.costmap.unknown_policy == "forbid" else None


def floor_evidence(
    placed: WorldSweep,
    range_m: float,
    pose: Pose,
    config: Config,
    mission: Mission,
    missing: MissingFloor | None,
) -> WorldSweep:
    """Return a sweep on level ground, without the beams that lost their echo from the floor.

    With `map.ground_fit`, and of robots that walk; else it is as it was.

    Args:
        placed: The sweep in the world frame; the floor is expected at z = 0.
        range_m: Range up to which its beams without return clear, m.
        pose: Pose of the body, estimated.
        config: Settings.
        mission: Mission of a robot that walks or flies.
        missing: Evidence of missing floor in the sweeps before, which takes in this one; None where
            each sweep is judged alone.
    """
    levelled = _on_level_ground(placed, config, mission)
    return _without_lost_floor(levelled, range_m, pose, config, mission, missing)


def fitted_ground(placed: WorldSweep, config: Config, mission: Mission) -> GroundPlane | None:
    """Fit the floor that a sweep is levelled by; None where it is as expected, or nothing is done.

    Args:
        placed: The sweep in the world frame.
        config: Settings.
        mission: Mission of a robot that walks or flies.
    """
    if not _is_fitted(config, mission):
        return None
    plane = fit_ground(placed.origins, placed.moments, placed.directions, placed.ranges_mm)
    return None if plane is None or plane.as_expected else plane


def _on_level_ground(placed: WorldSweep, config: Config, mission: Mission) -> WorldSweep:
    """Return a sweep levelled by its own floor, where that is not as expected."""
    plane = fitted_ground(placed, config, mission)
    if plane is None:
        return placed
    found = level(placed.origins, placed.moments, placed.directions, placed.ranges_mm, plane)
    return WorldSweep(found.origins, found.directions, found.ranges_mm, placed.moments)


def _without_lost_floor(
    placed: WorldSweep,
    range_m: float,
    pose: Pose,
    config: Config,
    mission: Mission,
    missing: MissingFloor | None,
) -> WorldSweep:
    """Return a sweep without the beams that lost their echo from the floor.

    Where the ground slopes it is looked for at the height of the feet.
    """
    if not (config.map.ground_fit and mission.planar):
        return placed
    if missing is None and not (placed.ranges_mm == NO_RETURN).any():
        return placed
    origins = placed.origins
    if config.costmap.max_slope > 0.0:
        if mission.rest_height == 0.0:
            return placed
        origins = origins - np.array([0.0, 0.0, pose.position[2] - mission.rest_height])
    lost_echoes = lost_echoes_of_one if missing is None else missing.lost_echoes
    lost = lost_echoes(
        origins,
        placed.moments,
        placed.directions,
        placed.ranges_mm,
        range_m,
    )
    return placed.without(lost)


def _is_fitted(config: Config, mission: Mission) -> bool:
    return config.map.ground_fit and mission.planar and config.costmap.max_slope == 0.0
