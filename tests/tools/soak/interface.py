"""Soak of the stack interface: whole episodes of the built-in stack, directly and by each way in.

Each seed is driven three times by each robot: by the built-in stack in its own place, by the same
as a class on trial, and by that class in a process behind `exec:`. Both on trial must give the same
chain, and the same trajectories, actions, labels, maps and sweeps as without the interface.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path

from tests.tools.soak.child import scratch
from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.config_document import override
from wayproof.harness.interface.builtin import BuiltinStack
from wayproof.harness.log.reader import open_log
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up
from wayproof.models.robots import ROBOTS

WORLD = "cylinders"

ON_TRIAL = f"{BuiltinStack.__module__}:{BuiltinStack.__name__}"
BEHIND_EXEC = f"exec:{sys.executable} -m wayproof serve {ON_TRIAL}"

NONE = pb.Decision()
"""Stands for a decision that only the longer of two episodes has."""


@dataclass
class Compared:
    """Results of all seeds.

    Attributes:
        episodes: Number of episodes driven by all three.
        decisions: Number of decisions of the built-in stack in its own place.
        same_chains: Number of episodes with one chain in process and behind `exec:`.
        same_decisions: Number of decisions that are the same as without the interface.
        outcomes: Number of episodes by outcome of the built-in stack.
        failures: Differences; empty without any.
    """

    episodes: int = 0
    decisions: int = 0
    same_chains: int = 0
    same_decisions: int = 0
    outcomes: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)


def soak_interface(
    count: int,
    seed: int,
    progress: Callable[[str], None],
    first: int = 0,
    settings: tuple[str, ...] = (),
) -> Compared:
    """Drive `count` seeds by each robot and each way in, and compare.

    Args:
        count: Number of seeds.
        seed: The first of them.
        progress: Called with a line about the progress.
        first: Number of seeds that are left out before it.
        settings: Settings of all episodes.
    """
    compared = Compared()
    for robot in ROBOTS:
        warm_up(override(Config(WORLD, robot, 0), settings))
    for number in range(seed + first, seed + first + count):
        for robot in ROBOTS:
            with tempfile.TemporaryDirectory(dir=scratch()) as folder:
                _compare(
                    robot, seed=number, settings=settings, folder=Path(folder), compared=compared
                )
        progress(f"interface: up to seed {number}, {len(compared.failures)} failures")
    return compared


def _compare(
    robot: str, seed: int, settings: tuple[str, ...], folder: Path, compared: Compared
) -> None:
    """Drive one seed by each way in."""
    direct, here, there = (
        _drive(robot, seed, (*settings, f"stack.name={name}"), folder / f"{place}.mcap")
        for place, name in enumerate((BUILTIN, ON_TRIAL, BEHIND_EXEC))
    )
    where = f"{robot}, seed {seed}"
    compared.episodes += 1
    compared.decisions += direct.decisions
    compared.outcomes[direct.outcome] = compared.outcomes.get(direct.outcome, 0) + 1
    if here.chain == there.chain and here.outcome == there.outcome != "error":
        compared.same_chains += 1
    else:
        compared.failures.append(f"{where}: chain {here.chain} in process, {there.chain} in exec")
    different = [number for number, same in _same(direct, here) if not same]
    compared.same_decisions += direct.decisions - len(different)
    if different or direct.outcome != here.outcome:
        compared.failures.append(
            f"{where}: {direct.outcome} without the interface, {here.outcome} with it; "
            f"{len(different)} other decisions, the first at {min(different, default=None)}"
        )


def _drive(robot: str, seed: int, settings: tuple[str, ...], log: Path) -> Result:
    return run_episode(build(override(Config(WORLD, robot, seed), settings)), log)


def _same(one: Result, other: Result) -> Iterator[tuple[int, bool]]:
    """Yield whether each decision of an episode is the same in another, by its number."""
    logs = (open_log(Path(result.log)).decisions() for result in (one, other))
    for number, (left, right) in enumerate(zip_longest(*logs, fillvalue=NONE)):
        yield number, _content(left) == _content(right)


def _content(decision: pb.Decision) -> tuple[object, ...]:
    """Return a stack's decision with the hashes of its inputs and map."""
    return (
        decision.input_digest,
        decision.map_version,
        decision.action,
        decision.label,
        decision.trajectory,
    )
