"""Compiling every kernel before anything is timed."""

from __future__ import annotations

import maps
import planners
from harness.config import Config
from harness.robots import find_robot, warm_up_robot
from models import devices, rays, truth


def warm_up(config: Config) -> None:
    """Compile what an episode runs, or load it from the cache."""
    maps.warm_up(config.map.kind, config.map.max_slope, config.sensors.semantics)
    planners.warm_up(config.planner, oriented=bool(find_robot(config).spec.discs))
    devices.warm_up()
    rays.warm_up()
    truth.warm_up()
    warm_up_robot(config)
