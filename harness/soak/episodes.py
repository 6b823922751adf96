"""Short random episodes: each replays identically in a fresh process, on any number of threads."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from harness.closed_loop import simulate_again
from harness.config import Config, override
from harness.episode import run_episode
from harness.errors import InputError
from harness.fork import fork
from harness.scenario import build
from harness.warm_up import warm_up
from models.robots import ROBOTS
from models.worlds import WORLDS
from planners import PLANNERS

TIME_LIMIT_S = 3.0
BATCH = 10
"""Logs that one fresh process replays."""

CLOSED_LOOP_EVERY, FORK_EVERY = 10, 20


@dataclass
class Tally:
    """What random episodes showed.

    Attributes:
        count: Episodes, each run on one thread and on two.
        replayed: Logs replayed in another process.
        closed_loop: Simulated anew.
        forked: Gone on from a decision in the middle, with no change.
        refused: Random settings that are no episode (a start in a shelf, for one).
        outcomes: How the episodes ended.
        failures: What was not identical; empty if all was.
    """

    count: int = 0
    replayed: int = 0
    closed_loop: int = 0
    forked: int = 0
    refused: int = 0
    outcomes: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)


def soak_episodes(count: int, seed: int, progress: Callable[[str], None]) -> Tally:
    """Run random episodes and everything that must give them again."""
    tally = Tally()
    while tally.count < count:
        with tempfile.TemporaryDirectory() as folder:
            logs: dict[str, str] = {}
            for _ in range(min(BATCH, count - tally.count)):
                _run_pair(Path(folder), tally.count + tally.refused, seed, tally, logs)
            _replay_elsewhere(logs, tally)
        progress(f"episodes: {tally.count} of {count}, {len(tally.failures)} failures")
    return tally


def random_config(rng: np.random.Generator) -> Config:
    """World, robot, planner and seed by chance."""
    world, robot = (str(rng.choice(sorted(names))) for names in (WORLDS, ROBOTS))
    settings = (
        f"planner.name={rng.choice(sorted(PLANNERS))}",
        f"map.inflation_margin={rng.uniform(0.02, 0.15):.3f}",
        f"episode.time_limit={TIME_LIMIT_S}",
    )
    return override(Config(world, robot, int(rng.integers(2**31))), settings)


def _run_pair(folder: Path, trial: int, seed: int, tally: Tally, logs: dict[str, str]) -> None:
    """One episode on one thread and on two; the second must decide as the first."""
    rng = np.random.default_rng((seed, trial))
    config = random_config(rng)
    name = f"trial {trial}: {config.world} {config.robot} {config.planner.name} {config.seed}"
    path = folder / f"{trial}.mcap"
    try:
        warm_up(config)
        result = run_episode(build(config), path)
    except InputError:
        tally.refused += 1
        return
    tally.count += 1
    tally.outcomes[result.outcome] = tally.outcomes.get(result.outcome, 0) + 1
    threaded = folder / f"{trial}-threads.mcap"
    second = run_episode(build(override(config, ["threads=2"])), threaded)
    if second.chain != result.chain:
        tally.failures.append(f"{name}: two threads decide otherwise")
    logs[str(path)] = logs[str(threaded)] = name
    if tally.count % CLOSED_LOOP_EVERY == 1:
        tally.closed_loop += 1
        if not simulate_again(path).identical:
            tally.failures.append(f"{name}: simulated anew, it differs")
    if tally.count % FORK_EVERY == 2:
        tally.forked += 1
        at = int(rng.integers(result.decisions))
        if fork(path, at, (), folder / "fork.mcap").chain != result.chain:
            tally.failures.append(f"{name}: forked at {at} with no change, it differs")


def _replay_elsewhere(logs: dict[str, str], tally: Tally) -> None:
    """Replay logs in a process that has not seen them being made."""
    if not logs:
        return
    command = [sys.executable, "-m", "harness", "replay", "--json", *logs]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or done.stderr:
        tally.failures.append(f"replay: exit code {done.returncode}: {done.stderr[-500:]}")
        return
    document = json.loads(done.stdout)
    for one in document.get("replays", [document]):
        tally.replayed += 1
        if not one["identical"]:
            tally.failures.append(f"{logs[one['log']]}: replay differs at {one['differences'][:3]}")
