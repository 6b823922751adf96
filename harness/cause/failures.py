"""`python -m harness.cause.failures`: failures of which one broken assumption is the cause.

`--make` runs episodes of the registered worlds, breaks one assumption of those that succeed, and
keeps the logs of the ones that then fail. Without it, the causes of the kept logs are worked out
and compared with what was broken; `--check` runs the counterfactual checks besides. Episodes of
even seeds are the half that thresholds may be tuned on, those of odd seeds the half to go by.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from harness.cause.breaks import KINDS, Broken
from harness.cause.confusion import Matrix, right, run_with, table
from harness.config import from_document, override
from harness.episode import run_episode
from harness.errors import InputError
from harness.result import Result
from harness.scenario import Scenario, build

COMBINATIONS = tuple(
    (world, "drone")
    for world in (
        "corridor", "empty", "office", "maze", "cylinders", "crossing", "ghosts", "construction",
        "forest", "warehouse",
    )
) + tuple(
    (world, "quadruped") for world in ("corridor", "empty", "maze", "cylinders", "ghosts", "office")
)  # fmt: skip
"""Worlds and robots, in the order in which they are tried."""

SETTINGS = ("episode.time_limit=40", "episode.stuck_after=8")
FIRST_SEED = 3000
ATTEMPTS = 16
"""Of each kind; each half has one seed for all combinations, then the next."""


@dataclass(frozen=True)
class Failure:
    """One failure whose cause is known.

    Attributes:
        kind: How it was made, one of `KINDS`.
        cause: What was broken, so what the cause is.
        world: Name.
        robot: Name.
        seed: Of the episode; even ones are for tuning.
        outcome: How it ended.
        log: File in the folder.
    """

    kind: str
    cause: str
    world: str
    robot: str
    seed: int
    outcome: str
    log: str


def attempts(kind: str, most: int = ATTEMPTS) -> Iterator[tuple[str, str, int]]:
    """World, robot and seed of every attempt at a kind."""
    first = 3 * sorted(KINDS).index(kind)
    for number in range(most):
        rounds = number // (2 * len(COMBINATIONS))
        world, robot = COMBINATIONS[(number // 2 + first) % len(COMBINATIONS)]
        yield world, robot, FIRST_SEED + 2 * rounds + number % 2


class Maker:
    """Makes failures in a folder; episodes that succeed are run once for all kinds."""

    def __init__(self, folder: Path, console: Console) -> None:
        """Go on with what the folder holds."""
        self._folder, self._console = folder, console
        self._sound: dict[tuple[str, str, int], tuple[Scenario, Result | None]] = {}

    def make(self, kind: str, count: int) -> list[Failure]:
        """So many failures of a kind in each half, or as many as the attempts give."""
        failures: list[Failure] = []
        for world, robot, seed in attempts(kind):
            if sum(one.seed % 2 == seed % 2 for one in failures) >= count:
                continue
            failure = self._attempt(kind, world, robot, seed)
            if failure is not None:
                failures.append(failure)
        return failures

    def _attempt(self, kind: str, world: str, robot: str, seed: int) -> Failure | None:
        sound, result = self._run_sound(world, robot, seed)
        if result is None:
            return None
        cause, breaks = KINDS[kind]
        rng = np.random.default_rng([seed, *kind.encode(), *world.encode(), *robot.encode()])
        name = f"{kind}-{world}-{robot}-{seed}.mcap"
        try:
            broken = breaks(sound, result, rng)
            made = run_broken(broken, sound, self._folder / name)
        except (InputError, ValueError) as error:
            self._console.print(f"{name}: {error}", soft_wrap=True)
            return None
        failed = made.outcome not in ("success", "error")
        found = f"{made.cause}: {made.cause_evidence}" if failed else ""
        self._console.print(f"{name}: {made.outcome} {made.sim_time_s:.1f} s {found}")
        if not failed:
            (self._folder / name).unlink()
            return None
        return Failure(kind, cause, world, robot, seed, made.outcome, name)

    def _run_sound(self, world: str, robot: str, seed: int) -> tuple[Scenario, Result | None]:
        """The unbroken episode; no result unless it reaches its goal."""
        key = world, robot, seed
        if key not in self._sound:
            document = {"world": world, "robot": robot, "seed": seed}
            scenario = build(override(from_document(document), SETTINGS))
            path = self._folder / "sound.mcap"
            result = run_episode(scenario, path, record="decisions")
            path.unlink()
            self._sound[key] = scenario, result if result.outcome == "success" else None
        return self._sound[key]


def run_broken(broken: Broken, sound: Scenario, path: Path) -> Result:
    """Run one broken episode and keep its log in full."""
    return run_with(broken.stack, broken.scenario(sound), broken.delays, path)


def read_failures(folder: Path) -> list[Failure]:
    """What `--make` left there.

    Raises:
        InputError: Nothing.
    """
    files = sorted(folder.glob("*.json"))
    if not files:
        raise InputError(f"{folder}: no failures there, expected a folder of --make")
    return [Failure(**one) for file in files for one in json.loads(file.read_text())]


def judge(failures: list[Failure], folder: Path, console: Console) -> Matrix:
    """Count what was broken against what was found, from the logs alone."""
    from harness.cause import find_cause, read_case
    from harness.logs.reader import open_log

    counts: Matrix = Counter()
    for one in failures:
        finding = find_cause(read_case(open_log(folder / one.log)))
        found = "" if finding is None else finding.cause
        counts[one.cause, found] += 1
        mark = " " if found == one.cause else "*"
        evidence = "" if finding is None else finding.evidence
        console.print(
            f"{mark} {one.log} ({one.outcome}): {one.cause} found {found}: {evidence}",
            soft_wrap=True,
        )
    return counts


def main() -> None:
    """Make, or judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--make", action="store_true", help="run episodes and keep the failures")
    parser.add_argument("--count", type=int, default=4, help="failures of each kind and half")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="of this kind only")
    parser.add_argument("--half", choices=("tuned", "untuned"), help="this half only")
    options = parser.parse_args()
    console, began = Console(width=130, markup=False, highlight=False), time.process_time()
    kinds = options.kind or list(KINDS)
    if options.make:
        options.folder.mkdir(parents=True, exist_ok=True)
        maker = Maker(options.folder, console)
        for kind in kinds:
            made = maker.make(kind, options.count)
            text = json.dumps([asdict(one) for one in made], indent=1)
            (options.folder / f"{kind}.json").write_text(text)
            console.print(f"{kind}: {len(made)}, {time.process_time() - began:.0f} s")
        return
    parity = {"tuned": (0,), "untuned": (1,), None: (0, 1)}[options.half]
    failures = [
        one for one in read_failures(options.folder) if one.kind in kinds and one.seed % 2 in parity
    ]
    counts = judge(failures, options.folder, console)
    console.print(table(counts))
    console.print(
        f"{right(counts):.1%} of {counts.total()} right, "
        f"{time.process_time() - began:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()
