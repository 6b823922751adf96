"""Failures whose cause is known because it was built in: small rooms, each with one thing wrong.

Every scenario is a robot in a room with a straight way to the goal, and exactly one thing made so
that it cannot get there: what is built in is all that differs from a room in which it does. Every
fourth one walks, unless its failure is one of flight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from wayproof.harness.attribution.reckless import Reckless
from wayproof.harness.config import Config, override
from wayproof.harness.errors import unknown_name
from wayproof.harness.scenario.scenario import Scenario, build, make_transparent
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.worlds import Box, Mover, World
from wayproof.models.worlds.layout import room_walls
from wayproof.models.worlds.solids import Solid

LENGTH, WIDTH, HEIGHT = 8.0, 3.6, 3.0
ENDS = 1.3
"""Start and goal keep this from the end walls, m."""

THICK = 0.1
GLASS = "glass"
BRIEF = ("episode.time_limit=15", "episode.stuck_after=5", "behaviour.wait_timeout=0.5")
RESIGNED = ("behaviour.max_recoveries=1",)
"""For those who stand before a closed way: one look from elsewhere is enough."""

MOST = 1000
"""No planted episode has more decisions."""

Settings = tuple[str, ...]


@dataclass(frozen=True)
class Plant:
    """One room with one thing wrong.

    Attributes:
        solids: In the room, the walls apart.
        movers: That move, or vanish.
        settings: As `section.field=value`.
        told: What the stack is told wrongly of the body, by the mission's fields.
        goal_x: Where the goal is, m.
        flies: Whether the failure is one that only a drone has.
        delay: Of every decision, s, unknown to the stack; none for what it reckons with.
        stack: That decides.
    """

    solids: tuple[Solid, ...] = ()
    movers: tuple[Mover, ...] = ()
    settings: Settings = ()
    told: dict[str, float] = field(default_factory=dict)
    goal_x: float = LENGTH - ENDS
    flies: bool = False
    delay: float | None = None
    stack: type[Navigator] = Navigator


@dataclass(frozen=True)
class Planted:
    """A scenario that fails of a cause.

    Attributes:
        scenario: To run.
        delays: By decision, s.
        stack: That decides.
    """

    scenario: Scenario
    delays: dict[int, float]
    stack: type[Navigator]


def plant(cause: str, seed: int) -> Planted:
    """A scenario that fails of a cause, another one for each seed.

    Raises:
        InputError: There is no such cause.
    """
    if cause not in PLANTS:
        raise unknown_name("cause", cause, PLANTS)
    rng = np.random.default_rng([seed, list(PLANTS).index(cause)])
    planted = PLANTS[cause](rng)
    y = WIDTH / 2 + round(float(rng.uniform(-0.2, 0.2)), 2)
    low, high = (0.0, 0.0, -0.5), (LENGTH, WIDTH, HEIGHT)
    world = World(
        name=f"planted {cause}",
        seed=seed,
        low=low,
        high=high,
        solids=(*room_walls(low, high), *planted.solids),
        start=(ENDS, y, 0.0),
        start_heading=round(float(rng.uniform(-0.3, 0.3)), 2),
        goal=(planted.goal_x, y, 0.0),
        movers=planted.movers,
    )
    robot = "drone" if planted.flies or seed % 4 != 3 else "quadruped"
    config = override(Config(world.name, robot, seed), [*BRIEF, *planted.settings])
    scenario = build(config, world)
    mission = replace(scenario.mission, **cast(dict[str, Any], planted.told))
    delays = {} if planted.delay is None else dict.fromkeys(range(MOST), planted.delay)
    return Planted(_glazed(replace(scenario, mission=mission)), delays, planted.stack)


def _glazed(scenario: Scenario) -> Scenario:
    """The scenario with its glass made invisible to every beam, as it is to a lidar."""
    if GLASS not in scenario.scene.mjcf:
        return scenario
    return make_transparent(scenario, lambda name: name.startswith(GLASS))


def _missed_obstacle(rng: np.random.Generator) -> Plant:
    """A pane of glass right across, which beams go through."""
    return Plant(solids=(_across(rng.uniform(3.2, 5.0), kind=GLASS),))


def _unseen_obstacle(rng: np.random.Generator) -> Plant:
    """A wall nearer than the nearest range that the map takes in; unknown space is allowed."""
    settings = ("costmap.unknown_policy=allow", "map.minimum_range=5")
    return Plant(solids=(_across(ENDS + rng.uniform(1.5, 2.0)),), settings=settings)


def _margin_too_small(rng: np.random.Generator) -> Plant:
    """A gap that the stack takes the body to fit through, for it is told too small a radius."""
    half, x = rng.uniform(0.24, 0.30), rng.uniform(3.5, 4.5)
    middle = WIDTH / 2 + rng.uniform(-0.1, 0.1)
    sides = _across(x, 0.2, middle - half), _across(x, middle + half, WIDTH - 0.2)
    settings = ("map.resolution=0.05", "costmap.localization_margin=0.02")
    return Plant(solids=sides, settings=settings, told={"radius": 0.1}, flies=True)


def _moved_obstacle(rng: np.random.Generator) -> Plant:
    """A truck as wide as the room comes on and does not stop for anybody."""
    body = Box((0.0, 0.0, 1.4), (0.3, 1.3, 1.2), 0.0, "vehicle")
    begin, y = LENGTH - 0.8, WIDTH / 2
    speed = rng.uniform(1.5, 3.0)
    truck = Mover(
        "truck", (body,), ((begin, y, 0.0), (0.8, y, 0.0)), speed, returns=False, stands_off=0.0
    )
    return Plant(movers=(truck,), goal_x=LENGTH - 2.6)


def _ghost_obstacle(rng: np.random.Generator) -> Plant:
    """A wall that was seen and is gone, in a map that forgets nothing and is slow to unlearn."""
    x = round(rng.uniform(4.0, 5.0), 2)
    wall = Box((0.0, 0.0, 1.5), (THICK, WIDTH / 2 - 0.2, 1.5), 0.0, "ghost")
    gone = Mover("gone", (wall,), ((x, WIDTH / 2, 0.0),), vanishes=round(rng.uniform(0.6, 1.2), 1))
    settings = ("map.log_odds_miss=0.02", "map.half_life=0", *RESIGNED)
    return Plant(movers=(gone,), settings=settings)


def _tracking(rng: np.random.Generator) -> Plant:
    """The stack takes the body to brake harder than it can, before a wall; or much harder."""
    speed, acceleration = ((6.0, 25.0), (5.0, 18.0))[int(rng.integers(2))]
    told = {
        "max_speed": speed,
        "max_acceleration": acceleration,
        "max_jerk": 10.0 * acceleration,
    }
    return Plant(told=told, goal_x=LENGTH - rng.uniform(0.85, 0.95), flies=True)


def _latency(rng: np.random.Generator) -> Plant:
    """Every decision takes longer than its deadline; or longer than the stack reckons with.

    In the second room a wall comes to be that the robot would stop before if it decided in time.
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
        return Plant(movers=new, settings=late, flies=True, delay=round(rng.uniform(0.6, 0.7), 2))
    return Plant(settings=(f"latency.plan={deadline + rng.uniform(0.0, 0.3):.3f}",))


def _planner(rng: np.random.Generator) -> Plant:
    """Two partitions with their doors at opposite ends, and a planner that may look once."""
    first, second = rng.uniform(2.9, 3.3), rng.uniform(4.9, 5.3)
    door = 1.4
    walls = _across(first, 0.2, WIDTH - 0.2 - door), _across(second, 0.2 + door, WIDTH - 0.2)
    once = ("planner.iterations=1", "planner.restarts=1", "planner.shortcuts=0", *RESIGNED)
    return Plant(solids=walls, settings=once, flies=True)


def _impossible(rng: np.random.Generator) -> Plant:
    """A wall right across, or with a gap that is too narrow for body and margin."""
    x = rng.uniform(3.5, 5.0)
    if rng.uniform() < 0.5:
        return Plant(solids=(_across(x),), settings=RESIGNED)
    middle, half = WIDTH / 2 + rng.uniform(-0.4, 0.4), rng.uniform(0.15, 0.25)
    sides = _across(x, 0.2, middle - half), _across(x, middle + half, WIDTH - 0.2)
    return Plant(solids=sides, settings=RESIGNED)


def _across(x: float, low: float = 0.2, high: float = WIDTH - 0.2, kind: str = "partition") -> Box:
    """A wall across the room, from floor to ceiling."""
    return Box.between((x - THICK, low, 0.0), (x + THICK, high, HEIGHT), kind)


def _localization(rng: np.random.Generator) -> Plant:
    """The pose jumps on the way, while the estimator believes that it does not."""
    begin = round(rng.uniform(0.8, 1.6), 1)
    severity = round(rng.uniform(4.0, 5.0), 2)
    jump = f'{{"kind": "pose_jump", "severity": {severity}, "window": [{begin}, 100]}}'
    return Plant(settings=(f"perturbation={jump}",))


def _perception(rng: np.random.Generator) -> Plant:
    """A partition with a door, and a map that takes in nothing near."""
    x, door = rng.uniform(3.5, 4.5), 1.6
    sides = (_across(x, 0.2, WIDTH - 0.2 - door),)
    return Plant(solids=sides, settings=(f"map.minimum_range={rng.uniform(3.0, 4.0):.2f}",))


def _disregarded_obstacle(rng: np.random.Generator) -> Plant:
    """A stack that goes straight for its goal, with a wall in between."""
    return Plant(solids=(_across(rng.uniform(3.5, 5.0)),), stack=Reckless, flies=True)


PLANTS: dict[str, Callable[[np.random.Generator], Plant]] = {
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
    "disregarded_obstacle": _disregarded_obstacle,
}
"""What plants each cause but `unexplained`; its number seeds it, so new ones come after."""
