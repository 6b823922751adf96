"""Settings that keep a robot from seeing: what the device or the map leaves out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from wayproof.harness.attribution.case import Case
from wayproof.harness.inputs import Beams
from wayproof.maps import MapConfig
from wayproof.models.robots import ROBOTS
from wayproof.models.scene import device_name

UNSEEN = ("kind", "resolution", "memory_mib", "dynamic", "decay_period")
"""Settings of a map that are about its cells, not about what it takes for evidence."""

STAYS_WITHIN = 0.6
"""Distance from its start within which a robot counts as never having left it, m."""


def settings_of_sight(case: Case) -> Iterator[str]:
    """Yield the settings that leave out returns, or floor, in words; none of a usual episode."""
    default = MapConfig()
    for one in fields(MapConfig):
        value = getattr(case.config.map, one.name)
        if one.name not in UNSEEN and value != getattr(default, one.name):
            yield f"map.{one.name} = {value}"
    mounts = ROBOTS[case.config.robot].spec.mounts if case.config.robot in ROBOTS else ()
    for mount in mounts:
        own, used = device_name(mount.device), getattr(case.config.sensors, mount.name, "")
        if used not in ("", "own", own):
            yield f"sensors.{mount.name} = {used}"
    yield from _blind_start(case)


def _blind_start(case: Case) -> Iterator[str]:
    """Yield the floor about the start that no sensor sees, if the robot never left it."""
    declared, mission = case.config.episode.start_clear_radius, case.mission
    if not mission.planar or case.config.costmap.unknown_policy != "forbid":
        return
    nearest = min(
        (_nearest_floor(beams, mission.start[2]) for beams in case.beams_at(0).values()),
        default=np.inf,
    )
    away = [np.linalg.norm(one.true_position[:2] - mission.start[:2]) for one in case.moments]
    if nearest > mission.radius + declared and max(away) <= STAYS_WITHIN:
        yield (
            f"episode.start_clear_radius = {declared:g} m, which declares the floor free to "
            f"{mission.radius + declared:.2f} m, where the sensors see none nearer than "
            f"{nearest:.2f} m"
        )


def _nearest_floor(beams: Beams, height: float) -> float:
    """Return the least distance at which a beam of a level robot meets a level floor, m."""
    position, _ = beams.mounting
    directions = beams.directions_in_base()
    down = directions[directions[:, 2] < 0.0]
    reach = (height + position[2]) / -down[:, 2]
    spots = position[:2] + (reach[:, None] * down[:, :2])[reach <= beams.range]
    return float(np.hypot(spots[:, 0], spots[:, 1]).min(initial=np.inf))
