"""Short random episodes of every kind: planners, maps, devices, perturbations."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import PERTURBATIONS, perturbation_from
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.stack.build import build_navigator
from wayproof.maps import MAPS, UnknownPolicy
from wayproof.models.robots import ROBOTS
from wayproof.models.sensors.devices import DEVICES
from wayproof.models.worlds import WORLDS
from wayproof.planners import PLANNERS

TIME_LIMIT_S = 3.0
BENDING_LIMIT_S = 6.0
"""Time limit of episodes with movers, s: they have to get in the way first."""

CROWDED = ("crossing", "warehouse", "ghosts")
MOVERS = "motion:5"
QUICK = ("aorrtc", "rrtconnect")
"""Planners that are fast enough for curves, which OMPL computes in Python."""

FLAT = ("grid2d",)
"""Maps without heights, only for robots on the ground."""

MOUNTED = [name for name in DEVICES if not DEVICES[name].by_mujoco]
"""Devices that may be the lidar: no single-beam rangefinders."""

FURTHER = (
    "costmap.max_slope=0.4", "costmap.window=30", "estimate.kind=lidar", "latency.mode=modelled",
    "map.half_life=0", "map.resolution=0.06", "map.resolution=0.15", "motion.limits=cautious",
    "motion.speed_fraction=0.5", "pose_model.bias_sigma=0.04", "prior.source=truth",
    "sensors.lidar=velodyne-vlp16", "world.passers_by=2", "waypoints=[\"home\"]",
)  # fmt: skip
"""Settings of which a random episode has up to `MOST_FURTHER`, where they go with the others."""

MOST_FURTHER = 3

MOST_DRAWS = 50
"""Maximum number of draws of world and seed for one episode; some are invalid."""

Draw = Callable[[int, np.random.Generator], Config]


def _plain(turn: int, rng: np.random.Generator, *settings: str, world: str = "") -> Config:
    """Return a config of a random world and policy, and the robots in turn."""
    world = world or str(rng.choice(sorted(WORLDS)))
    robot = sorted(ROBOTS)[turn % len(ROBOTS)]
    policy = rng.choice(get_args(UnknownPolicy))
    shared = (f"episode.time_limit={TIME_LIMIT_S}", f"costmap.unknown_policy={policy}")
    return override(Config(world, robot, int(rng.integers(2**31))), (*shared, *settings))


def _bending(turn: int, rng: np.random.Generator) -> Config:
    world = CROWDED[turn // len(ROBOTS) % len(CROWDED)]
    config = _plain(turn, rng, f"episode.time_limit={BENDING_LIMIT_S}", world=world)
    return replace(config, perturbation=perturbation_from(MOVERS))


def _curve(turn: int, rng: np.random.Generator) -> Config:
    """Return a config with a curved state space, for the robot on the ground."""
    name, space = rng.choice(QUICK), ("dubins", "pose", "reeds_shepp")[turn % 3]
    few = "planner.iterations=100", "planner.restarts=1", "planner.shortcuts=20"
    settings = f"planner.name={name}", f"planner.state_space={space}", *few
    return _plain(sorted(ROBOTS).index("quadruped"), rng, *settings)


def _map(turn: int, rng: np.random.Generator) -> Config:
    kind = _in_turn(MAPS, turn)
    robot = sorted(ROBOTS).index("quadruped") if kind in FLAT else turn
    return _plain(robot, rng, *_of_map(kind))


def _of_map(kind: str) -> tuple[str, ...]:
    lasting = ("map.half_life=0",) if kind == "octomap" else ()  # it does not fade
    return f"map.kind={kind}", *lasting


def _disturb(config: Config, kind: str, rng: np.random.Generator) -> Config:
    """Return a config with a perturbation, which finds something to act on."""
    perturbation = perturbation_from(f"{kind}:{rng.integers(1, 6)}")
    if perturbation.changes == "motion_sensors":
        config = override(config, ("estimate.kind=lidar",))
    return replace(config, perturbation=perturbation)


def _pose_model(turn: int, rng: np.random.Generator) -> Config:
    settings = (
        f"pose_model.bias_sigma={rng.uniform(0.0, 0.05):.4f}",
        f"pose_model.yaw_bias_sigma={rng.uniform(0.0, 0.01):.5f}",
        f"pose_model.scale_sigma={rng.uniform(0.0, 0.02):.4f}",
        f"pose_model.random_walk={rng.uniform(0.0, 0.02):.4f}",
    )
    return _plain(turn, rng, *settings)


def _classes(turn: int, rng: np.random.Generator) -> Config:
    slope = f"costmap.max_slope={rng.uniform(0.1, 0.6):.3f}"
    cells = f"map.resolution={rng.choice([0.08, 0.1, 0.15])}"
    return _plain(turn, rng, "sensors.semantics=true", slope, cells)


def _random(turn: int, rng: np.random.Generator) -> Config:
    """Return a config with a map, planner, margin and further settings; three in four perturbed."""
    settings = (
        *_of_map(str(rng.choice(sorted(MAPS)))),
        f"planner.name={rng.choice(sorted(PLANNERS))}",
        f"costmap.localization_margin={rng.uniform(0.02, 0.15):.3f}",
    )
    config = _plain(turn, rng, *settings)
    if rng.integers(4) != 0:
        config = _disturb(config, str(rng.choice(sorted(PERTURBATIONS))), rng)
    count = int(rng.integers(MOST_FURTHER + 1))
    for setting in rng.choice(FURTHER, size=count, replace=False).tolist():
        with contextlib.suppress(InputError):
            config = override(config, [setting])
    return config


KINDS: dict[str, Draw] = {
    "bending": _bending,
    "planner": lambda turn, rng: _plain(turn, rng, f"planner.name={_in_turn(PLANNERS, turn)}"),
    "curve": _curve,
    "map": _map,
    "device": lambda turn, rng: _plain(turn, rng, f"sensors.lidar={_in_turn(MOUNTED, turn)}"),
    "perturbation": lambda turn, rng: _disturb(
        _plain(turn, rng), _in_turn(PERTURBATIONS, turn), rng
    ),
    "pose_model": _pose_model,
    "classes": _classes,
    "random": _random,
}
"""Name of the part that varies in turn -> function that draws an episode; the rest is random.

`bending` has fast movers, which a robot evades while it stops; `curve` plans headings, with every
OMPL planner.
"""


@dataclass(frozen=True)
class Drawn:
    """Episode and its kind, a key of `KINDS`."""

    kind: str
    scenario: Scenario


def _in_turn(names: object, turn: int) -> str:
    """Return the next name, which each robot gets once."""
    ordered = sorted(names)  # type: ignore[call-overload]
    return str(ordered[turn // len(ROBOTS) % len(ordered)])


def draw(number: int, seed: int) -> Drawn:
    """Draw the episode of a number: the kinds in turn, each with its next value."""
    rng = np.random.default_rng((seed, number))
    kind = list(KINDS)[number % len(KINDS)]
    refused = ""
    for _ in range(MOST_DRAWS):
        try:
            scenario = build(KINDS[kind](number // len(KINDS), rng))
            build_navigator(scenario.config, scenario.mission, {})
        except InputError as error:
            refused = str(error)
            continue
        return Drawn(kind, scenario)
    raise RuntimeError(f"{kind} {number}: {MOST_DRAWS} draws refused, the last: {refused}")
