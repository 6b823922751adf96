"""Faults of perception of obstacles: beams miss them, or the space is unknown."""

from __future__ import annotations

import mujoco
import numpy as np

from tests.tools.faults.breaks.broken import (
    Broken,
    Kind,
    Rng,
    crossing_axis,
    place_between,
    with_solids,
)
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import GLASS_RGBA, Scenario
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.worlds import Capsule

WIRE = 0.001
"""Half the thickness of a wire, m."""

FENCE = 1.5
"""Half the length of a fence of wires, m."""

SPACING = 0.35
"""Distance between the wires of a fence, m."""


def _glass(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Make obstacles transparent to every beam."""

    def vanish(spec: mujoco.MjSpec) -> None:
        for geom in spec.geoms:
            of_robot = geom.name.startswith(ROBOT_PREFIX) or geom.group == 3
            floor = geom.type == mujoco.mjtGeom.mjGEOM_PLANE or geom.name.startswith("floor")
            if not of_robot and not floor and not geom.name.startswith("wall"):
                geom.rgba = GLASS_RGBA

    return Broken(edit=vanish)


def _pane(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Put a pane of glass across the path."""
    axis, at = crossing_axis(sound), place_between(sound, rng)
    middle = [0.5 * (a + b) for a, b in zip(sound.world.low, sound.world.high, strict=True)]
    half = [0.5 * (b - a) for a, b in zip(sound.world.low, sound.world.high, strict=True)]
    middle[axis], half[axis], middle[2], half[2] = at, 0.02, 1.5, 1.5

    def glaze(spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_geom(
            name="pane", type=mujoco.mjtGeom.mjGEOM_BOX, pos=middle, size=half, rgba=GLASS_RGBA
        )

    return Broken(edit=glaze)


def _wires(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Put a fence of wires, thinner than the gaps between beams, on the straight line."""
    axis, at = crossing_axis(sound), place_between(sound, rng)
    start, goal = sound.mission.start, sound.mission.goal
    share = (at - start[axis]) / (goal[axis] - start[axis])
    middle = start[1 - axis] + share * (goal[1 - axis] - start[1 - axis])
    wires = []
    for z in np.arange(SPACING, 3.0, SPACING).round(3).tolist():
        low, high = [z, z, z], [z, z, z]
        low[axis] = high[axis] = at
        low[1 - axis], high[1 - axis] = middle - FENCE, middle + FENCE
        (a, b, c), (d, e, f) = low, high
        wires.append(Capsule((a, b, c), (d, e, f), WIRE, "wire"))
    return Broken(world=with_solids(sound.world, *wires))


def _groping(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Count unknown space as free, and let near space stay unknown."""
    return Broken(settings=("costmap.unknown_policy=allow", "map.minimum_range=5"))


STILL = (
    ("office", "drone"), ("maze", "drone"), ("office", "quadruped"), ("maze", "quadruped"),
    ("cylinders", "drone"), ("corridor", "drone"), ("forest", "drone"), ("warehouse", "drone"),
)  # fmt: skip
"""Worlds and robots without movers, which would enter space seen free before."""

OPEN = (
    ("empty", "drone"), ("ghosts", "drone"), ("empty", "quadruped"), ("warehouse", "drone"),
    ("crossing", "drone"), ("ghosts", "quadruped"),
)  # fmt: skip
"""Worlds and robots with a path around a fence on the straight line."""

KINDS = {
    "glass": Kind("missed_obstacle", _glass),
    "pane": Kind("missed_obstacle", _pane),
    "wires": Kind("missed_obstacle", _wires, OPEN),
    "groping": Kind("unseen_obstacle", _groping, STILL),
}
