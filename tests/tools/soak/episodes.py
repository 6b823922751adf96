"""Soak of random episodes: each must replay identically in a fresh process, on any threads.

Its audit must find no violation, a decision's card must be the same from a keyframe as from the
start, and a failure must have a cause.
"""

from __future__ import annotations

import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np

from tests.tools.soak.child import scratch
from tests.tools.soak.fresh import FreshReplays, replay_by_command
from tests.tools.soak.random_settings import changed_settings, random_config
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.explain import make_card
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.robots import ROBOTS
from wayproof.planners import PLANNERS

TIME_LIMIT_S = 3.0
THREADS = (1, 2)
CLOSED_LOOP_EVERY, FORK_EVERY, COMMAND_EVERY = 10, 20, 25
MOST_DRAWS = 50
"""Maximum number of random settings for one trial; some are invalid, as a start in a shelf."""

MOST_TRACEBACK = 1500  # last characters of a traceback


@dataclass(frozen=True)
class Trial:
    """Result of one random episode.

    Attributes:
        trial: Number of the trial.
        episode: World, robot, seed, map, policy, planner and perturbation.
        settings: Settings that are not the defaults.
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
    settings: tuple[str, ...]
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
    *,
    wide: bool = False,
) -> Tally:
    """Run random episodes, their replays, repeated simulations and forks.

    Args:
        count: Number of trials.
        seed: Seed of all random choices.
        progress: Called with each trial as a line of JSON.
        first: Number of the first trial, to continue a soak.
        jobs: Number of processes.
        time_limit_s: Simulated time of an episode, s.
        wide: Whether settings of any section are varied, as `random_settings.vary`.
    """
    began = time.perf_counter()
    tally, outcomes = Tally(count, first), Counter[str]()
    for trial in _trials(range(first, first + count), seed, jobs, time_limit_s, wide):
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


def _trials(
    numbers: range, seed: int, jobs: int, time_limit_s: float, wide: bool
) -> Iterator[Trial]:
    """Run all trials in order; each worker keeps its server of fresh replays."""
    with WorkerPool(jobs, initializer=_begin) as pool:
        trials = [(n, seed, time_limit_s, wide) for n in numbers]
        yield from pool.run_in_order(run_trial, trials)


def _begin() -> None:
    """Fork the server of fresh replays before this process has run anything."""
    global _fresh
    _fresh = FreshReplays([_plain(robot, planner) for robot in ROBOTS for planner in PLANNERS])


_fresh: FreshReplays | None = None


def _plain(robot: str, planner: str) -> Config:
    return override(Config("empty", robot, 0), [f"planner.name={planner}"])


def run_trial(number: int, seed: int, time_limit_s: float, wide: bool) -> Trial:
    """Run one random episode with its replays, repeated simulation and fork.

    What raises, other than a refusal of the settings, is a failure of the trial.
    """
    began = time.perf_counter()
    rng = np.random.default_rng((seed, number))
    drawn, scenario, refused = _draw(rng, time_limit_s, wide)
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        path = Path(name) / f"{number}.mcap"
        checked = Checked(failures=[])
        try:
            warm_up(drawn)
            checked.result = run_episode(scenario, path)
            _check(checked, path, number, rng)
        except Exception:  # whatever an episode or a check of it raises is a finding
            checked.failures.append(traceback.format_exc()[-MOST_TRACEBACK:])
    result = checked.result
    return Trial(
        trial=number,
        episode=_summary(scenario.config),
        settings=changed_settings(scenario.config),
        refused=refused,
        outcome=result.outcome if result else "raised",
        decisions=result.decisions if result else 0,
        chain=result.chain if result else "",
        replays=checked.replays,
        closed_loop=checked.closed_loop,
        forked=checked.forked,
        wall_s=round(time.perf_counter() - began, 3),
        failures=tuple(checked.failures),
    )


@dataclass
class Checked:
    """Checks that were made of one episode; the fields are as of `Trial`.

    Attributes:
        failures: Differences and violations so far.
        result: Result of the episode; None if it raised.
        replays: Number of replays.
        closed_loop: Whether it was simulated again.
        forked: Decision at which it was forked; None if it was not.
    """

    failures: list[str]
    result: Result | None = None
    replays: int = 0
    closed_loop: bool = False
    forked: int | None = None


def _check(checked: Checked, path: Path, number: int, rng: np.random.Generator) -> None:
    """Replay, audit and explain a log; simulate it again or fork it by turns."""
    result = checked.result
    assert result is not None
    checked.failures += _replays(path, number)
    checked.replays = len(THREADS)
    checked.failures += _audited(path) + _explained(path, rng)
    checked.closed_loop = number % CLOSED_LOOP_EVERY == 0
    if checked.closed_loop and not simulate_again(path).identical:
        checked.failures.append("simulated anew, it differs")
    if number % FORK_EVERY == 1:
        checked.forked = int(rng.integers(result.decisions))
        checked.failures += _fork(path, checked.forked, result)


def _draw(
    rng: np.random.Generator, time_limit_s: float, wide: bool
) -> tuple[Config, Scenario, int]:
    """Return the first valid random config, its scenario, and the number of invalid ones before."""
    for refused in range(MOST_DRAWS):
        try:
            config = random_config(rng, time_limit_s, wide=wide)
            scenario = build(config)
            build_navigator(scenario.config, scenario.mission, {})
            return config, scenario, refused
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


def _explained(path: Path, rng: np.random.Generator) -> list[str]:
    """Return the differences of a card from a keyframe, and whether a failure has no cause."""
    case = read_case(open_log(path))
    at = int(rng.integers(len(case.moments)))
    near, whole = (
        make_card(case, at, case.navigator_at(at, keyframe))
        for keyframe in (case.as_of(at).keyframe_at(at), None)
    )
    failures = []
    if replace(near, keyframe=None) != replace(whole, keyframe=None):
        failures.append(f"decision {at}: another card from the keyframe than from the start")
    if case.outcome != "success":
        finding = find_cause(case)
        if finding is None or finding.cause == "unexplained":
            failures.append(f"{case.outcome} without a cause: {finding}")
    return failures


def _fork(path: Path, at: int, result: Result) -> list[str]:
    forked = fork(path, at, (), path.with_name("fork.mcap"))
    alike = forked.chain == result.chain and forked.outcome == result.outcome
    return [] if alike else [f"forked at {at} with no change, it differs"]
