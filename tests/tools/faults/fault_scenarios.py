"""Scenarios with one known fault: small rooms whose robot cannot reach its goal.

Every scenario is a robot in a room with a straight path to the goal and exactly one fault; without
it the robot arrives. Every fourth robot walks, unless the fault needs a drone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from tests.tools.faults.judged import Judged
from tests.tools.faults.reckless import Reckless
from tests.tools.faults.scene_edits import edit_scene, transparent
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.worlds import Box, Mover, World
from wayproof.models.worlds.layout import room_walls
from wayproof.models.worlds.solids import Solid

LENGTH, WIDTH, HEIGHT = 8.0, 3.6, 3.0
ENDS = 1.3
"""Distance of start and goal from the end walls, m."""

THICK = 0.1
GLASS = "glass"
BRIEF = ("episode.time_limit=15", "episode.stuck_after=5", "behaviour.wait_timeout=0.5")
RESIGNED = ("behaviour.max_recoveries=1",)
"""Settings for a robot before a closed path: a single exploration."""

MOST = 1000
"""Bound of the number of decisions of an episode."""

Settings = tuple[str, ...]


@dataclass(frozen=True)
class Fault:
    """A room with one fault."""

    solids: tuple[Solid, ...] = ()
    movers: tuple[Mover, ...] = ()
    settings: Settings = ()
    mission: dict[str, float] = field(default_factory=dict)
    goal_x: float = LENGTH - ENDS
    flies: bool = False
    delay: float | None = None
    stack: type[Navigator] = Navigator


def run_planted(cause: str, seed: int, path: Path) -> Result:
    """Run a scenario that fails by a cause; each seed gives another one."""
    rng = np.random.default_rng([seed, list(FAULTS).index(cause)])
    fault = FAULTS[cause](rng)
    y = WIDTH / 2 + round(float(rng.uniform(-0.2, 0.2)), 2)
    low, high = (0.0, 0.0, -0.5), (LENGTH, WIDTH, HEIGHT)
    world = World(
        name=f"planted {cause}",
        seed=seed,
        low=low,
        high=high,
        solids=(*room_walls(low, high), *fault.solids),
        start=(ENDS, y, 0.0),
        start_heading=round(float(rng.uniform(-0.3, 0.3)), 2),
        goal=(fault.goal_x, y, 0.0),
        movers=fault.movers,
    )
    robot = "drone" if fault.flies or seed % 4 != 3 else "quadruped"
    config = override(Config(world.name, robot, seed), [*BRIEF, *fault.settings])
    scenario = build(config, world)
    mission = replace(scenario.mission, **cast(dict[str, Any], fault.mission))
    delays = {} if fault.delay is None else dict.fromkeys(range(MOST), fault.delay)
    scenario = replace(scenario, mission=mission)
    if GLASS in scenario.scene.mjcf:
        scenario = edit_scene(scenario, transparent(lambda geom: geom.name.startswith(GLASS)))
    return run_episode(scenario, path, delays=delays, record="full", stack=fault.stack)


def judge_planted(cause: str, seed: int, path: Path) -> Judged:
    """Run a scenario, and compare the cause found."""
    result = run_planted(cause, seed, path)
    found = result.cause or result.outcome
    text = f"{result.sim_time_s:.1f} s: {result.cause_evidence}"
    return Judged(cause, (cause,), found, seed, result.outcome, text)


def _missed_obstacle(rng: np.random.Generator) -> Fault:
    """Put a pane of glass across the room, which beams pass through."""
    return Fault(solids=(_across(rng.uniform(3.2, 5.0), kind=GLASS),))


def _unseen_obstacle(rng: np.random.Generator) -> Fault:
    """Put up a wall nearer than the minimum range of the map, with unknown space allowed."""
    settings = ("costmap.unknown_policy=allow", "map.minimum_range=5")
    return Fault(solids=(_across(ENDS + rng.uniform(1.5, 2.0)),), settings=settings)


def _margin_too_small(rng: np.random.Generator) -> Fault:
    """Make a gap that is too narrow; the stack has too small a radius of the body."""
    half, x = rng.uniform(0.24, 0.30), rng.uniform(3.5, 4.5)
    middle = WIDTH / 2 + rng.uniform(-0.1, 0.1)
    sides = _across(x, 0.2, middle - half), _across(x, middle + half, WIDTH - 0.2)
    settings = ("map.resolution=0.05", "costmap.localization_margin=0.02")
    return Fault(solids=sides, settings=settings, mission={"radius": 0.1}, flies=True)


def _moved_obstacle(rng: np.random.Generator) -> Fault:
    """Let a truck as wide as the room approach and never stop."""
    body = Box((0.0, 0.0, 1.4), (0.3, 1.3, 1.2), 0.0, "vehicle")
    begin, y = LENGTH - 0.8, WIDTH / 2
    speed = rng.uniform(1.5, 3.0)
    truck = Mover(
        "truck", (body,), ((begin, y, 0.0), (0.8, y, 0.0)), speed, returns=False, stands_off=0.0
    )
    return Fault(movers=(truck,), goal_x=LENGTH - 2.6)


def _ghost_obstacle(rng: np.random.Generator) -> Fault:
    """Remove a wall that was seen, in a map that hardly forgets."""
    x = round(rng.uniform(4.0, 5.0), 2)
    wall = Box((0.0, 0.0, 1.5), (THICK, WIDTH / 2 - 0.2, 1.5), 0.0, "ghost")
    gone = Mover("gone", (wall,), ((x, WIDTH / 2, 0.0),), vanishes=round(rng.uniform(0.6, 1.2), 1))
    settings = ("map.log_odds_miss=0.02", "map.half_life=0", *RESIGNED)
    return Fault(movers=(gone,), settings=settings)


def _tracking(rng: np.random.Generator) -> Fault:
    """Let the stack plan to brake harder than the body can, in front of a wall."""
    speed, acceleration = ((6.0, 25.0), (5.0, 18.0))[int(rng.integers(2))]
    mission = {
        "max_speed": speed,
        "max_acceleration": acceleration,
        "max_jerk": 10.0 * acceleration,
    }
    return Fault(mission=mission, goal_x=LENGTH - rng.uniform(0.85, 0.95), flies=True)


def _latency(rng: np.random.Generator) -> Fault:
    """Let decisions take longer than their deadline, or longer than the stack expects.

    In the second case a wall appears before which a decision in time would stop.
    """
    deadline = 0.25
    if rng.uniform() < 0.5:
        x, half = round(rng.uniform(4.62, 4.68), 2), (WIDTH - 0.4) / 6
        panel = Box((0.0, 0.0, 1.5), (THICK, half, 1.5), 0.0, "ghost")
        places = [(x, 0.2 + (2 * k + 1) * half, 0.0) for k in range(3)]
        new = tuple(
            Mover(f"new_{k}", (panel,), (place,), stands_off=0.0, appears=1.4)
            for k, place in enumerate(places)
        )
        late = ("latency.deadline=1",)
        return Fault(movers=new, settings=late, flies=True, delay=round(rng.uniform(0.6, 0.7), 2))
    return Fault(settings=(f"latency.plan={deadline + rng.uniform(0.0, 0.3):.3f}",))


def _planner(rng: np.random.Generator) -> Fault:
    """Put up two partitions with doors at opposite ends, and plan with one iteration."""
    first, second = rng.uniform(2.9, 3.3), rng.uniform(4.9, 5.3)
    door = 1.4
    walls = _across(first, 0.2, WIDTH - 0.2 - door), _across(second, 0.2 + door, WIDTH - 0.2)
    once = ("planner.iterations=1", "planner.restarts=1", "planner.shortcuts=0", *RESIGNED)
    return Fault(solids=walls, settings=once, flies=True)


def _impossible(rng: np.random.Generator) -> Fault:
    """Put a wall across the room, or one with a gap too narrow for body and margin."""
    x = rng.uniform(3.5, 5.0)
    if rng.uniform() < 0.5:
        return Fault(solids=(_across(x),), settings=RESIGNED)
    middle, half = WIDTH / 2 + rng.uniform(-0.4, 0.4), rng.uniform(0.15, 0.25)
    sides = _across(x, 0.2, middle - half), _across(x, middle + half, WIDTH - 0.2)
    return Fault(solids=sides, settings=RESIGNED)


def _across(x: float, low: float = 0.2, high: float = WIDTH - 0.2, kind: str = "partition") -> Box:
    """Return a wall across the room, from floor to ceiling."""
    return Box.between((x - THICK, low, 0.0), (x + THICK, high, HEIGHT), kind)


def _localization(rng: np.random.Generator) -> Fault:
    """Let the pose jump under way, unknown to the estimator."""
    begin = round(rng.uniform(0.8, 1.6), 1)
    severity = round(rng.uniform(4.0, 5.0), 2)
    jump = f'{{"kind": "pose_jump", "severity": {severity}, "window": [{begin}, 100]}}'
    return Fault(settings=(f"perturbation={jump}",))


def _old_evidence(kind: str) -> Callable[[np.random.Generator], Fault]:
    """Return a fault that stops or repeats a stream under way, for the rest of the episode."""

    def fault(rng: np.random.Generator) -> Fault:
        begin = round(rng.uniform(0.3, 0.8), 1)
        stopped = f'{{"kind": "{kind}", "severity": 5, "window": [{begin}, 100]}}'
        return Fault(settings=(f"perturbation={stopped}",))

    return fault


def _perception(rng: np.random.Generator) -> Fault:
    """Put up a partition with a door, before a map with a large minimum range."""
    x, door = rng.uniform(3.5, 4.5), 1.6
    sides = (_across(x, 0.2, WIDTH - 0.2 - door),)
    return Fault(solids=sides, settings=(f"map.minimum_range={rng.uniform(3.0, 4.0):.2f}",))


def _disregarded_obstacle(rng: np.random.Generator) -> Fault:
    """Let a stack go straight to its goal, with a wall in between."""
    return Fault(solids=(_across(rng.uniform(3.5, 5.0)),), stack=Reckless, flies=True)


FAULTS: dict[str, Callable[[np.random.Generator], Fault]] = {
    "ghost_obstacle": _ghost_obstacle,
    "impossible": _impossible,
    "latency": _latency,
    "margin_too_small": _margin_too_small,
    "missed_obstacle": _missed_obstacle,
    "moved_obstacle": _moved_obstacle,
    "planner": _planner,
    "tracking": _tracking,
    "unseen_obstacle": _unseen_obstacle,
    "localization": _localization,
    "perception": _perception,
    "frozen_evidence": _old_evidence("pose_freeze"),
    "stale_evidence": _old_evidence("sensor_stop"),
    "disregarded_obstacle": _disregarded_obstacle,
}
"""Fault by cause, all but `unexplained`; the index is part of the seed, so append new ones."""
