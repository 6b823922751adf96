"""Construction of a navigator, with bad settings reported as bad input."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams
from wayproof.harness.mission import Mission
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.shadowing import ShadowNavigator
from wayproof.planners import state_space_for

T = TypeVar("T", bound=Navigator)


def build_navigator(config: Config, mission: Mission, beams: Mapping[str, Beams]) -> Navigator:
    """Build a navigator.

    Raises:
        InputError: The map or the costmap cannot be made for this mission with these settings, or
            its body cannot be planned for in the state space.
    """
    planner, flat = config.planner, mission.planar
    try:
        state_space_for(planner.state_space, planner.name, flat=flat, discs=bool(mission.discs))
    except ValueError as error:
        raise InputError(f"robot '{config.robot}': {error}") from None
    kind = Navigator if config.recording is None else ShadowNavigator
    return reported(config, lambda: kind(config, mission, beams))


def reported(config: Config, make: Callable[[], T]) -> T:
    """Build a navigator, with settings that no map can have reported as bad input.

    Raises:
        InputError: The map or the costmap cannot be made.
    """
    try:
        return make()
    except ValueError as error:
        raise InputError(f"no map for this mission: {error}") from None
    except MemoryError:
        raise InputError(
            f"no memory for the map and its costmap: map.memory_mib is {config.map.memory_mib}, "
            "expected less, or a machine that has more"
        ) from None
