"""One change to an episode that reached its goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from wayproof.harness.config_document import override
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario, build, edit_scene
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.worlds import Box, Mover, World

MOST = 4000
"""Bound of the number of decisions of a broken episode."""

CLEAR_OF_ENDS = 1.6
"""Distance of an added wall from start and goal, m."""

HALF_THICK = 0.1
"""Half the thickness of an added wall, m."""

Rng = np.random.Generator
Edit = Callable[[mujoco.MjSpec], None]
Places = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Broken:
    """Change to a successful episode."""

    settings: tuple[str, ...] = ()
    perturbation: str = ""
    mission: dict[str, Any] = field(default_factory=dict)
    world: World | None = None
    edit: Edit | None = None
    delay: float | None = None
    stack: type[Navigator] = Navigator

    def scenario(self, sound: Scenario) -> Scenario:
        """Return the successful scenario with this change."""
        config = override(sound.config, self.settings)
        if self.perturbation:
            config = replace(config, perturbation=perturbation_from(self.perturbation))
        scenario = build(config, self.world)
        scenario = replace(scenario, mission=replace(scenario.mission, **self.mission))
        return scenario if self.edit is None else edit_scene(scenario, self.edit)

    @property
    def delays(self) -> dict[int, float]:
        """Return the delay by decision, s."""
        return {} if self.delay is None else dict.fromkeys(range(MOST), self.delay)


Break = Callable[[Scenario, Result, Rng], Broken]
"""Function of the successful scenario, its result and a random generator that returns a change."""


@dataclass(frozen=True)
class Kind:
    """One kind of change."""

    cause: str
    breaks: Break
    where: Places = ()
    base: tuple[str, ...] = ()


def crossing_axis(sound: Scenario) -> int:
    """Return the axis along which start and goal are farther apart: 0 for x, 1 for y."""
    (x0, y0, _), (x1, y1, _) = sound.mission.start, sound.mission.goal
    return 0 if abs(x1 - x0) > abs(y1 - y0) else 1


def place_between(sound: Scenario, rng: Rng) -> float:
    """Return a random coordinate between start and goal on that axis, clear of both, m."""
    axis = crossing_axis(sound)
    low, high = sorted((sound.mission.start[axis], sound.mission.goal[axis]))
    low += CLEAR_OF_ENDS
    return float(rng.uniform(low, max(high - CLEAR_OF_ENDS, low + 0.1)))


def place_ahead(sound: Scenario, distance: float) -> float:
    """Return the coordinate on that axis at a distance from the start, towards the goal, m."""
    axis = crossing_axis(sound)
    start, goal = sound.mission.start[axis], sound.mission.goal[axis]
    return start + (distance if goal > start else -distance)


def wall_across(
    sound: Scenario, at: float, kind: str, low: float | None = None, high: float | None = None
) -> Box:
    """Return a wall from floor to ceiling at a coordinate on that axis, m."""
    axis, corners = crossing_axis(sound), (list(sound.world.low), list(sound.world.high))
    for corner, side, end, z in zip(corners, (-1, 1), (low, high), (0.0, 3.0), strict=True):
        corner[axis] = at + side * HALF_THICK
        corner[1 - axis] = corner[1 - axis] if end is None else end
        corner[2] = z
    (a, b, c), (d, e, f) = corners
    return Box.between((a, b, c), (d, e, f), kind)


def with_solids(world: World, *solids: Any) -> World:
    """Return the world with more solids."""
    return replace(world, solids=(*world.solids, *solids))


def with_movers(world: World, *movers: Mover) -> World:
    """Return the world with more movers."""
    return replace(world, movers=(*world.movers, *movers))
