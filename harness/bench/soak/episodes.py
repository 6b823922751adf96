"""Soak of random episodes: each must replay identically in a fresh process, on any threads.

And its audit must find no violation.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import get_args

import msgspec
import numpy as np

from wayproof.harness.bench.soak.child import scratch
from wayproof.harness.bench.soak.fresh import FreshReplays, replay_by_command
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import PERTURBATIONS, AnyPerturbation, perturbation_from
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool
from wayproof.maps import MAPS, MapConfig, UnknownPolicy
from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import WORLDS
from wayproof.planners import PLANNERS

TIME_LIMIT_S = 3.0
THREADS = (1, 2)
CLOSED_LOOP_EVERY, FORK_EVERY, COMMAND_EVERY = 10, 20, 25
FURTHER = (
    "behaviour.keep_moving=false",
    "costmap.max_slope=0.4",
    "costmap.window=8",
    "estimate.kind=lidar",
    "latency.mode=modelled",
    "map.half_life=0",
    "map.resolution=0.06",
    "map.resolution=0.15",
    "motion.limits=cautious",
    "motion.speed_fraction=0.5",
    "pose_model.bias_sigma=0.04",
    "prior.source=truth",
    "sensors.lidar=velodyne-vlp16",
)
"""Settings of which each episode has up to `MOST_FURTHER`, where they go with the others."""

MOST_FURTHER = 3

MOST_DRAWS = 50
"""Maximum number of random settings for one trial; some are invalid, as a start in a shelf."""


@dataclass(frozen=True)
class Trial:
    """Result of one random episode.

    Attributes:
        trial: Number of the trial.
        episode: World, robot, seed, map, policy, planner and perturbation.
        refused: Number of invalid random settings before it.
        outcome: Outcome of the episode.
        decisions: Number of decisions.
        chain: Hash over the decisions.
        replays: Number of replays, each in a fresh process.
        closed_loop: Whether it was simulated again as well.
        forked: Decision at which it was forked without a change; None if it was not.
        wall_s: Wall time of all of it, s.
        failures: Differences and violations; empty if all is identical and admitted.
    """

    trial: int
    episode: str
    refused: int
    outcome: str
    decisions: int
    chain: str
    replays: int
    closed_loop: bool
    forked: int | None
    wall_s: float
    failures: tuple[str, ...]


@dataclass
class Tally:
    """Results of all random episodes.

    Attributes:
        count: Number of episodes.
        first: Number of the first trial.
        replayed: Number of replays, each in a fresh process.
        closed_loop: Number of episodes simulated again.
        forked: Number of episodes forked without a change.
        refused: Number of invalid random settings.
        outcomes: Outcome -> number of episodes.
        wall_s_each: Wall time of an episode with its replays, over all jobs, s.
        failures: Differences and violations; empty if all is identical and admitted.
    """

    count: int = 0
    first: int = 0
    replayed: int = 0
    closed_loop: int = 0
    forked: int = 0
    refused: int = 0
    outcomes: dict[str, int] = field(default_factory=dict)
    wall_s_each: float = 0.0
    failures: list[str] = field(default_factory=list)


def soak_episodes(
    count: int,
    seed: int,
    progress: Progress,
    first: int = 0,
    jobs: int = 2,
    time_limit_s: float = TIME_LIMIT_S,
) -> Tally:
    """Run random episodes, their replays, repeated simulations and forks.

    Args:
        count: Number of trials.
        seed: Seed of all random choices.
        progress: Called with each trial as a line of JSON.
        first: Number of the first trial, to continue a soak.
        jobs: Number of processes.
        time_limit_s: Simulated time of an episode, s.
    """
    began = time.perf_counter()
    tally, outcomes = Tally(count, first), Counter[str]()
    for trial in _trials(range(first, first + count), seed, jobs, time_limit_s):
        progress(msgspec.json.encode(asdict(trial)).decode())
        outcomes[trial.outcome] += 1
        tally.replayed += trial.replays
        tally.closed_loop += trial.closed_loop
        tally.forked += trial.forked is not None
        tally.refused += trial.refused
        tally.failures += [f"trial {trial.trial}: {trial.episode}: {x}" for x in trial.failures]
    tally.outcomes = dict(outcomes)
    tally.wall_s_each = (time.perf_counter() - began) / max(count, 1)
    return tally


def _trials(numbers: range, seed: int, jobs: int, time_limit_s: float) -> Iterator[Trial]:
    """Run all trials in order; each worker keeps its server of fresh replays."""
    with WorkerPool(jobs, initializer=_begin) as pool:
        yield from pool.run_in_order(run_trial, [(n, seed, time_limit_s) for n in numbers])


def _begin() -> None:
    """Fork the server of fresh replays before this process has run anything."""
    global _fresh
    _fresh = FreshReplays([_plain(robot, planner) for robot in ROBOTS for planner in PLANNERS])


_fresh: FreshReplays | None = None


def _plain(robot: str, planner: str) -> Config:
    return override(Config("empty", robot, 0), [f"planner.name={planner}"])


def run_trial(number: int, seed: int, time_limit_s: float) -> Trial:
    """Run one random episode with its replays, repeated simulation and fork."""
    began = time.perf_counter()
    rng = np.random.default_rng((seed, number))
    scenario, refused = _draw(rng, time_limit_s)
    config = scenario.config
    failures: list[str] = []
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        path = Path(name) / f"{number}.mcap"
        warm_up(config)
        result = run_episode(scenario, path)
        failures += _replays(path, number) + _audited(path)
        again = number % CLOSED_LOOP_EVERY == 0
        if again and not simulate_again(path).identical:
            failures.append("simulated anew, it differs")
        at = int(rng.integers(result.decisions)) if number % FORK_EVERY == 1 else None
        if at is not None:
            failures += _fork(path, at, result)
    return Trial(
        trial=number,
        episode=_summary(config),
        refused=refused,
        outcome=result.outcome,
        decisions=result.decisions,
        chain=result.chain,
        replays=len(THREADS),
        closed_loop=again,
        forked=at,
        wall_s=round(time.perf_counter() - began, 3),
        failures=tuple(failures),
    )


def random_config(rng: np.random.Generator, time_limit_s: float = TIME_LIMIT_S) -> Config:
    """Return a random config; every fourth is unperturbed."""
    world, robot = (str(rng.choice(sorted(names))) for names in (WORLDS, ROBOTS))
    kind = str(rng.choice(sorted(MAPS))) if rng.integers(2) else MapConfig().kind
    settings = (
        f"map.kind={kind}",
        *(["map.half_life=0"] if kind == "octomap" else []),  # it does not fade
        f"costmap.unknown_policy={rng.choice(get_args(UnknownPolicy))}",
        f"planner.name={rng.choice(sorted(PLANNERS))}",
        f"costmap.localization_margin={rng.uniform(0.02, 0.15):.3f}",
        f"episode.time_limit={time_limit_s}",
    )
    config = override(Config(world, robot, int(rng.integers(2**31))), settings)
    perturbation = perturbation_from(f"{rng.choice(sorted(PERTURBATIONS))}:{rng.integers(1, 6)}")
    if rng.integers(4) != 0:
        needed = override(config, needed_by(perturbation))
        config = replace(needed, perturbation=perturbation)
    further = rng.choice(FURTHER, size=int(rng.integers(MOST_FURTHER + 1)), replace=False)
    for setting in further.tolist():
        with contextlib.suppress(InputError):  # it does not go with the others
            config = override(config, [setting])
    return config


def needed_by(perturbation: AnyPerturbation) -> tuple[str, ...]:
    """Return the settings without which a perturbation has nothing to act on."""
    return ("estimate.kind=lidar",) if perturbation.changes == "motion_sensors" else ()


def _draw(rng: np.random.Generator, time_limit_s: float) -> tuple[Scenario, int]:
    """Return the first valid random scenario, and the number of invalid ones before it."""
    for refused in range(MOST_DRAWS):
        try:
            scenario = build(random_config(rng, time_limit_s))
            build_navigator(scenario.config, scenario.mission, {})
            return scenario, refused
        except InputError:
            continue
    raise RuntimeError(f"{MOST_DRAWS} random settings refused")


def _summary(config: Config) -> str:
    perturbation = config.perturbation
    perturbed = "none"
    if perturbation is not None:
        perturbed = f"{perturbation.kind}:{perturbation.severity}"
    stack = f"{config.map.kind} {config.costmap.unknown_policy} {config.planner.name}"
    return f"{config.world} {config.robot} {config.seed} {stack} {perturbed}"


def _replays(path: Path, number: int) -> list[str]:
    """Return the differences of replays on each number of threads."""
    failures = []
    for threads in THREADS:
        if number % COMMAND_EVERY == 0 or _fresh is None:
            found = replay_by_command(path, threads)
        else:
            found = _fresh.replay(path, threads)
        if found:
            failures.append(f"replay on {threads} threads: {found}")
    return failures


def _audited(path: Path) -> list[str]:
    """Return the violations of a log, but joints where the robot holds a pose that has jumped."""
    decisions = open_log(path).decisions()
    jumped = {one.sequence for one in decisions if one.predicate.kind == "off_trajectory"}
    return [
        f"decision {one.sequence}: {one.rule}: {one.text}"
        for one in audit(path).violations
        if not (one.rule == "joined" and one.sequence in jumped)
    ]


def _fork(path: Path, at: int, result: Result) -> list[str]:
    forked = fork(path, at, (), path.with_name("fork.mcap"))
    alike = forked.chain == result.chain and forked.outcome == result.outcome
    return [] if alike else [f"forked at {at} with no change, it differs"]
