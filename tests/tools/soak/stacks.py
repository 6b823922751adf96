"""Soak of logs of stacks on trial: replay without the stack, and its answers again.

Reference stacks drive in random worlds, half of them in a process behind `exec:` whose script is
gone before the log is replayed. Every fifth stack is queried again, and must answer as recorded;
every tenth has a generator without a seed, whose first other answer must be found.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.tools.faults import faulty_stacks
from tests.tools.faults.faulty_stacks import Unseeded
from tests.tools.soak.child import scratch
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.replay.compare_answers import compare_answers
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.warm_up import warm_up
from wayproof.models.robots import ROBOTS
from wayproof.models.worlds import WORLDS

SETTINGS = ("episode.time_limit=3",)
COMPARED_EVERY, UNSEEDED_EVERY = 5, 10
MOST_DRAWS = 50
"""Maximum number of random settings for one episode; some are invalid, as a start in a shelf."""

UNSEEDED = f"{faulty_stacks.__name__}:{Unseeded.__name__}"


@dataclass
class Replayed:
    """Results of all episodes.

    Attributes:
        count: Number of episodes.
        decisions: Number of decisions in them, all replayed without the stack.
        identical: Number of logs that replayed identically.
        behind_exec: Number of stacks in a process of their own.
        stacks: Number of episodes by stack.
        outcomes: Number of episodes by outcome.
        compared: Number of answers of stacks that were queried again.
        unseeded: Number of stacks without a seed.
        found: Number of these whose first other answer was found.
        failures: Differences; empty without any.
    """

    count: int = 0
    decisions: int = 0
    identical: int = 0
    behind_exec: int = 0
    stacks: dict[str, int] = field(default_factory=dict)
    outcomes: dict[str, int] = field(default_factory=dict)
    compared: int = 0
    unseeded: int = 0
    found: int = 0
    failures: list[str] = field(default_factory=list)


def soak_stacks(count: int, seed: int, progress: Callable[[str], None], first: int = 0) -> Replayed:
    """Record `count` episodes of stacks on trial, and replay each without its stack.

    Args:
        count: Number of episodes.
        seed: Seed of all random choices.
        progress: Called with a line about the progress.
        first: Number of the first one.
    """
    tally = Replayed()
    for robot in ROBOTS:
        warm_up(override(Config("empty", robot, 0), SETTINGS))
    for number in range(first, first + count):
        with tempfile.TemporaryDirectory(dir=scratch()) as folder:
            _run_one(number, np.random.default_rng([seed, number]), Path(folder), tally)
        if (number + 1) % 10 == 0:
            progress(f"stacks: up to {number + 1}, {len(tally.failures)} failures")
    return tally


def _run_one(number: int, rng: np.random.Generator, folder: Path, tally: Replayed) -> None:
    """Record one episode, replay it, and query its stack again by turns."""
    unseeded = number % UNSEEDED_EVERY == UNSEEDED_EVERY - 1
    stack = UNSEEDED if unseeded else sorted(STACKS)[int(rng.integers(len(STACKS)))]
    name, script = stack, folder / "stack.sh"
    if number % 2:
        script.write_text(f"exec {sys.executable} -m wayproof serve {stack}\n")
        name = f"exec:sh {script}"
    result = run_episode(_scenario(rng, name), folder / "trial.mcap", record="full")
    script.unlink(missing_ok=True)
    path = Path(result.log)
    again = replay(path)
    tally.count += 1
    tally.decisions += result.decisions
    tally.identical += again.identical
    tally.behind_exec += number % 2
    _count(tally.stacks, stack)
    _count(tally.outcomes, result.outcome)
    if not again.identical:
        tally.failures.append(f"{number}, {name}: replay differs at {again.first_difference}")
    if result.outcome == "error":
        tally.failures.append(f"{number}, {name}: {result.reason}")
    if unseeded:
        tally.unseeded += 1
        _find_first(number, path, tally)
    elif number % COMPARED_EVERY == 0:
        comparison = compare_answers(path, stack)
        tally.compared += comparison.answers
        if not comparison.identical:
            tally.failures.append(f"{number}, {stack}: {comparison.differing} other answers")


def _count(numbers: dict[str, int], name: str) -> None:
    numbers[name] = numbers.get(name, 0) + 1


def _find_first(number: int, path: Path, tally: Replayed) -> None:
    """Query a stack without a seed again: its first other answer is the first that it draws for."""
    compared = compare_answers(path, UNSEEDED)
    expected = Unseeded.BEGINS if compared.answers > Unseeded.BEGINS else None
    if compared.first_difference == expected:
        tally.found += 1
    else:
        tally.failures.append(
            f"{number}: the first other answer is {compared.first_difference}, expected {expected}"
        )


def _scenario(rng: np.random.Generator, stack: str) -> Scenario:
    """Return a random scenario with a stack."""
    for _ in range(MOST_DRAWS):
        world = sorted(WORLDS)[int(rng.integers(len(WORLDS)))]
        robot = sorted(ROBOTS)[int(rng.integers(len(ROBOTS)))]
        guard = f"stack.guard={'true' if rng.uniform() < 0.3 else 'false'}"
        config = Config(world, robot, int(rng.integers(10_000)))
        try:
            return build(override(config, (*SETTINGS, guard, f"stack.name={stack}")))
        except InputError:
            continue
    raise AssertionError(f"no scenario in {MOST_DRAWS} draws")
