"""Faults without a path for this body, margin or time."""

from __future__ import annotations

import numpy as np

from tests.tools.faults.breaks.broken import (
    Broken,
    Kind,
    Rng,
    crossing_axis,
    place_between,
    wall_across,
    with_solids,
)
from wayproof.harness.attribution.ways import rest_to_rest
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.worlds import Box

ROUND_THE_GOAL = 0.9
"""Half the edge of the pen around the goal, m."""


def _detour(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Grant less time than the shortest path takes, but more than the straight line would."""
    straight, way = _straight(sound), _way(sound)
    limit = (straight + rng.uniform(0.3, 0.9) * (way - straight)) / sound.mission.max_speed
    return Broken(settings=(f"episode.time_limit={limit:.1f}",))


def _hurry(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Grant less time than the shortest path takes from rest to rest."""
    limit = rng.uniform(0.4, 0.8) * rest_to_rest(_way(sound), sound.mission)
    return Broken(settings=(f"episode.time_limit={limit:.1f}",))


def _straight(sound: Scenario) -> float:
    return float(np.linalg.norm(np.subtract(sound.mission.goal, sound.mission.start)[:2]))


def _way(sound: Scenario) -> float:
    return sound.route_length() or _straight(sound)


def _wide(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Set a margin too large for every passage."""
    return Broken(settings=(f"costmap.localization_margin={rng.uniform(0.3, 0.7):.2f}",))


def _closed(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Put a wall from side to side between start and goal."""
    wall = wall_across(sound, place_between(sound, rng), "partition")
    return Broken(world=with_solids(sound.world, wall))


def _gap(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Put up a wall with a gap in it that is narrower than the body."""
    at, axis = place_between(sound, rng), crossing_axis(sound)
    middle = float(rng.uniform(sound.world.low[1 - axis] + 1.0, sound.world.high[1 - axis] - 1.0))
    widest = min([sound.mission.radius, *(radius for _, radius in sound.mission.discs)])
    half = float(rng.uniform(0.5, 0.9)) * widest
    sides = (
        wall_across(sound, at, "partition", high=middle - half),
        wall_across(sound, at, "partition", low=middle + half),
    )
    return Broken(world=with_solids(sound.world, *sides))


def _pen(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Fence the goal in on all sides."""
    x, y, _ = sound.mission.goal
    r, t = ROUND_THE_GOAL, 0.08
    sides = (
        ((x - r, y - r), (x - r + t, y + r)),
        ((x + r - t, y - r), (x + r, y + r)),
        ((x - r, y - r), (x + r, y - r + t)),
        ((x - r, y + r - t), (x + r, y + r)),
    )
    fence = [Box.between((a, b, 0.0), (c, d, 3.0), "fence") for (a, b), (c, d) in sides]
    return Broken(world=with_solids(sound.world, *fence))


KINDS = {
    "detour": Kind("impossible", _detour),
    "hurry": Kind("impossible", _hurry),
    "wide": Kind("impossible", _wide),
    "closed": Kind("impossible", _closed),
    "gap": Kind("impossible", _gap),
    "pen": Kind("impossible", _pen),
}
