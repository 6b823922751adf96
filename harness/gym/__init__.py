"""Gymnasium environments: an agent in the place of a stack on trial, one for each world and robot.

Importing this package registers the ids, such as `Wayproof/Warehouse-Quadruped-v0`, and
`Wayproof/Warehouse-Quadruped-Flat-v0` with observations in one row.
"""

from __future__ import annotations

import itertools

try:
    import gymnasium
except ImportError:
    raise ImportError(
        "wayproof.harness.gym: expected gymnasium to be installed (the extra 'gym')"
    ) from None

from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import WORLDS

NAMESPACE = "Wayproof"

ENTRY_POINT = "wayproof.harness.gym.environment:WayproofEnv"
"""Class of the environments, loaded when one is made."""


def environment_id(world: str, robot: str, *, flat: bool = False) -> str:
    """Return the id of the environment of a world and a robot, with observations in one row."""
    return f"{NAMESPACE}/{world.title()}-{robot.title()}{'-Flat' if flat else ''}-v0"


def register_all() -> None:
    """Register two environments for each world and robot."""
    for world, robot, flat in itertools.product(WORLDS, ROBOTS, (False, True)):
        own = {"world": world, "robot": robot, **({"observation": "flat"} if flat else {})}
        gymnasium.register(environment_id(world, robot, flat=flat), ENTRY_POINT, kwargs=own)


register_all()
