"""Gymnasium environments: an agent in the place of a stack on trial, one for each world and robot.

Importing this package registers the ids, such as `Wayproof/Warehouse-Quadruped-v0`.
"""

from __future__ import annotations

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


def environment_id(world: str, robot: str) -> str:
    """Return the id of the environment of a world and a robot."""
    return f"{NAMESPACE}/{world.title()}-{robot.title()}-v0"


def register_all() -> None:
    """Register an environment for each world and robot."""
    for world in WORLDS:
        for robot in ROBOTS:
            gymnasium.register(
                environment_id(world, robot),
                ENTRY_POINT,
                kwargs={"world": world, "robot": robot},
            )


register_all()
