"""Soak of the lidar's pose: each log must replay, be simulated again and be forked to its chain.

Random worlds, robots, lidars and seeds; some begin in the middle of a tunnel or a hall, where the
pose is lost. Every log is replayed; every fourth is simulated again, and every fourth is forked
without a change.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.tools.soak.child import scratch
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up
from wayproof.models.robots import ROBOTS

WORLDS = ("warehouse", "office", "forest", "corridor", "maze", "crossing", "tunnel", "hall")
LIDARS = ("own", "own", "ouster-os1-64")
SETTINGS = ("estimate.kind=lidar", "episode.time_limit=3")

LOST = ("behaviour.lost_sigma=0.05", "behaviour.uncertain_sigma=0.02")
"""Settings by which the pose is lost within an episode's 3 s in a tunnel or a hall."""

MIDDLE = "start=[15, 1.3]"
"""Start in a tunnel from which no end is in range."""

FORKED_AT = 15
"""Number of the decision at which a log is forked, of about 30."""


@dataclass
class Repeated:
    """Results of all episodes.

    Attributes:
        count: Number of episodes.
        decisions: Number of decisions in them.
        replayed: Number of logs that replayed identically.
        simulated: Number that were simulated again.
        simulated_alike: Number of these with the same chain.
        forked: Number that were forked without a change.
        forked_alike: Number of these with the same chain.
        lost: Number of episodes that gave up as the pose was lost.
        failures: Differences; empty without any.
    """

    count: int = 0
    decisions: int = 0
    replayed: int = 0
    simulated: int = 0
    simulated_alike: int = 0
    forked: int = 0
    forked_alike: int = 0
    lost: int = 0
    failures: list[str] = field(default_factory=list)


def soak_estimators(
    count: int, seed: int, progress: Callable[[str], None], first: int = 0
) -> Repeated:
    """Record `count` episodes whose pose is the lidar's, and repeat each.

    Args:
        count: Number of episodes.
        seed: Seed of all random choices.
        progress: Called with a line about the progress.
        first: Number of the first one.
    """
    tally = Repeated()
    for robot in ROBOTS:
        warm_up(override(Config("empty", robot, 0), SETTINGS))
    for number in range(first, first + count):
        with tempfile.TemporaryDirectory(dir=scratch()) as folder:
            _run_one(number, np.random.default_rng([seed, number]), Path(folder), tally)
        if (number + 1) % 10 == 0:
            progress(f"estimators: up to {number + 1}, {len(tally.failures)} failures")
    return tally


def config_of(number: int, rng: np.random.Generator) -> Config:
    """Return the settings of an episode: worlds and robots in turn, the rest drawn."""
    world = WORLDS[number % len(WORLDS)]
    robot = sorted(ROBOTS)[number // len(WORLDS) % len(ROBOTS)]
    lidar = LIDARS[int(rng.integers(len(LIDARS)))]
    config = Config(world, robot, int(rng.integers(10_000)))
    lost = LOST if world in ("tunnel", "hall") else ()
    middle = (MIDDLE,) if world == "tunnel" else ()
    return override(config, (*SETTINGS, f"sensors.lidar={lidar}", *lost, *middle))


def _run_one(number: int, rng: np.random.Generator, folder: Path, tally: Repeated) -> None:
    """Record one episode, audit and replay it, and simulate it again or fork it by turns."""
    config = config_of(number, rng)
    name = f"{number}, {config.world}, {config.robot}, seed {config.seed}"
    result = run_episode(build(config), folder / "log.mcap", record="full")
    path = Path(result.log)
    tally.count += 1
    tally.decisions += result.decisions
    again = replay(path)
    tally.replayed += again.identical
    if not again.identical:
        tally.failures.append(f"{name}: replay differs at {again.first_difference}")
    audited = audit(path)
    tally.failures += [f"{name}: {one.rule}: {one.text}" for one in audited.violations[:3]]
    tally.lost += result.reason.startswith("the pose is lost")
    if result.outcome == "error":
        tally.failures.append(f"{name}: {result.reason}")
    if number % 4 == 0:
        alike = simulate_again(path).identical
        tally.simulated, tally.simulated_alike = tally.simulated + 1, tally.simulated_alike + alike
        tally.failures += [] if alike else [f"{name}: another chain when simulated again"]
    elif number % 4 == 2 and result.decisions > FORKED_AT:
        alike = fork(path, FORKED_AT, [], folder / "fork.mcap").chain == result.chain
        tally.forked, tally.forked_alike = tally.forked + 1, tally.forked_alike + alike
        tally.failures += [] if alike else [f"{name}: another chain when forked"]
