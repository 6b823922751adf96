"""Compiling every kernel before anything is timed."""

from __future__ import annotations

import maps
import planners
from models import rays, truth
from models.robots import ROBOTS


def warm_up(robot: str, kind: str = "voxel") -> None:
    """Compile what an episode of `robot` on a kind of map runs, or load it from the cache."""
    maps.warm_up(kind)
    planners.warm_up()
    rays.warm_up()
    truth.warm_up()
    ROBOTS[robot].warm_up()
