"""Failures with a known cause in the registered worlds, and the causes attributed to them.

`python -m tests.tools.faults.failures FOLDER --make` runs episodes of the
registered worlds, changes one thing in those that succeed, and keeps the logs of those that then
fail. Without `--make` it attributes the causes of the kept logs and compares them with the changes;
`--check` runs the counterfactual checks as well. Thresholds may be tuned on even seeds; odd seeds
are the test set.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from rich.console import Console

from tests.tools.faults.breaks import KINDS, Broken
from tests.tools.faults.confusion import Matrix, right, table
from wayproof.harness.attribution.case import read_case
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.config_document import from_document, override
from wayproof.harness.counterfactual.check import check
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build

COMBINATIONS = tuple(
    (world, "drone")
    for world in (
        "corridor", "empty", "office", "maze", "cylinders", "crossing", "ghosts", "construction",
        "forest", "warehouse",
    )
) + tuple(
    (world, "quadruped") for world in ("corridor", "empty", "maze", "cylinders", "ghosts", "office")
)  # fmt: skip
"""Worlds and robots, in the order of attempts."""

SETTINGS = ("episode.time_limit=40", "episode.stuck_after=8")
FIRST_SEED = 3000
MOST_SIMULATED = 120.0
"""Simulated time after which a check begins no other remedy, s."""

ATTEMPTS = 16
"""Number of attempts of each kind; each half has one seed for all combinations, then the next."""


@dataclass(frozen=True)
class Failure:
    """Failure with a known cause."""

    kind: str
    cause: str
    world: str
    robot: str
    seed: int
    outcome: str
    log: str


def attempts(kind: str, first_seed: int = FIRST_SEED) -> Iterator[tuple[str, str, int]]:
    """Yield world, robot and seed of every attempt at a kind."""
    where = KINDS[kind].where or COMBINATIONS
    first = 0 if KINDS[kind].where else crc32(kind.encode())
    for number in range(ATTEMPTS):
        rounds = number // (2 * len(where))
        world, robot = where[(number // 2 + first) % len(where)]
        yield world, robot, first_seed + 2 * rounds + number % 2


class Maker:
    """Maker of failures in a folder; successful episodes are run once for all kinds."""

    def __init__(self, folder: Path, console: Console) -> None:
        """Continue in a folder."""
        self._folder, self._console = folder, console
        self._sound: dict[tuple[str, ...], Scenario | None] = {}

    def make(self, kind: str, count: int, first_seed: int = FIRST_SEED) -> list[Failure]:
        """Return `count` failures of a kind in each half, or as many as the attempts give."""
        failures: list[Failure] = []
        for world, robot, seed in attempts(kind, first_seed):
            if sum(one.seed % 2 == seed % 2 for one in failures) >= count:
                continue
            failure = self._attempt(kind, world, robot, seed)
            if failure is not None:
                failures.append(failure)
        return failures

    def _attempt(self, kind: str, world: str, robot: str, seed: int) -> Failure | None:
        name = f"{kind}-{world}-{robot}-{seed}.mcap"
        rng = np.random.default_rng([seed, *kind.encode(), *world.encode(), *robot.encode()])
        try:
            sound = self._run_sound(world, robot, seed, KINDS[kind].base)
            if sound is None:
                return None
            broken = KINDS[kind].breaks(sound, rng)
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
        return Failure(
            kind=kind,
            cause=KINDS[kind].cause,
            world=world,
            robot=robot,
            seed=seed,
            outcome=made.outcome,
            log=name,
        )

    def _run_sound(
        self, world: str, robot: str, seed: int, base: tuple[str, ...]
    ) -> Scenario | None:
        """Run the unchanged episode; None unless it reaches its goal."""
        key = world, robot, str(seed), *base
        if key not in self._sound:
            document = {"world": world, "robot": robot, "seed": seed}
            scenario = build(override(from_document(document), (*SETTINGS, *base)))
            path = self._folder / "sound.mcap"
            result = run_episode(scenario, path, record="decisions")
            path.unlink()
            self._sound[key] = scenario if result.outcome == "success" else None
        return self._sound[key]


def run_broken(broken: Broken, sound: Scenario, path: Path) -> Result:
    """Run one broken episode and keep its log in full."""
    scenario = broken.scenario(sound)
    return run_episode(scenario, path, record="full", stack=broken.stack)


def read_failures(folder: Path) -> list[Failure]:
    """Read the failures in a folder of `--make`."""
    files = sorted(folder.glob("*.json"))
    if not files:
        raise InputError(f"{folder}: no failures there, expected a folder of --make")
    return [Failure(**one) for file in files for one in json.loads(file.read_text())]


def judge(failures: list[Failure], folder: Path, console: Console) -> Matrix:
    """Count known causes against attributed ones, from the logs alone."""
    counts: Matrix = Counter()
    for one in failures:
        finding = _found(folder / one.log)
        counts[one.cause, finding.cause] += 1
        _print(console, one, finding.cause, finding.evidence)
    return counts


@dataclass
class Checked:
    """Results of counterfactual checks."""

    matrix: Matrix
    answers: Counter[str]
    refused: int = 0
    simulated_s: float = 0.0


def judge_by_check(failures: list[Failure], folder: Path, console: Console) -> Checked:
    """Check each failure counterfactually and count, one of each kind in turn."""
    checked = Checked(Counter(), Counter())
    for one in _in_turn(failures):
        log = open_log(folder / one.log)
        finding = _found(folder / one.log)
        try:
            verdict = check(log, finding, thorough=False, most_s=MOST_SIMULATED)
        except InputError as error:
            checked.refused += 1
            console.print(f"- {error}", soft_wrap=True)
            continue
        checked.simulated_s += verdict.simulated_s
        checked.answers[verdict.answer] += 1
        if verdict.answer != "inconclusive":
            checked.matrix[one.cause, verdict.finding.cause] += 1
        saving = ", ".join(f"{c.remedy} {c.outcome}" for c in verdict.checks)
        text = f"{verdict.answer}, from {finding.cause}: {saving}"
        _print(console, one, verdict.finding.cause, text)
    return checked


def _found(path: Path) -> Finding:
    finding = find_cause(read_case(open_log(path)))
    assert finding is not None
    return finding


def _print(console: Console, one: Failure, cause: str, evidence: str) -> None:
    mark = " " if cause == one.cause else "*"
    line = f"{mark} {one.log} ({one.outcome}): {one.cause}, found {cause}: {evidence}"
    console.print(line, soft_wrap=True)


def _in_turn(failures: list[Failure]) -> list[Failure]:
    """Return the first failure of each kind, then the second of each, and so on."""
    seen: Counter[str] = Counter()
    turns = []
    for one in failures:
        turns.append((seen[one.kind], one))
        seen[one.kind] += 1
    return [one for _, one in sorted(turns, key=lambda turn: turn[0])]


def main() -> None:
    """Make failures, or judge them and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--make", action="store_true", help="run episodes and keep the failures")
    parser.add_argument("--count", type=int, default=4, help="failures of each kind and half")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed, an even one")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="of this kind only")
    parser.add_argument("--half", choices=("tuned", "untuned"), help="this half only")
    parser.add_argument("--check", action="store_true", help="check each, and let that decide")
    options = parser.parse_args()
    console, began = Console(width=130, markup=False, highlight=False), time.process_time()
    kinds = options.kind or list(KINDS)
    if options.make:
        options.folder.mkdir(parents=True, exist_ok=True)
        maker = Maker(options.folder, console)
        for kind in kinds:
            made = maker.make(kind, options.count, options.first)
            text = json.dumps([asdict(one) for one in made], indent=1)
            (options.folder / f"{kind}.json").write_text(text)
            console.print(f"{kind}: {len(made)}, {time.process_time() - began:.0f} s")
        return
    parity = {"tuned": (0,), "untuned": (1,), None: (0, 1)}[options.half]
    failures = [
        one for one in read_failures(options.folder) if one.kind in kinds and one.seed % 2 in parity
    ]
    if options.check:
        checked = judge_by_check(failures, options.folder, console)
        counts = checked.matrix
        console.print(f"{dict(checked.answers)}, {checked.refused} refused,", end=" ")
        console.print(f"{checked.simulated_s:.0f} s simulated")
    else:
        counts = judge(failures, options.folder, console)
    console.print(table(counts))
    console.print(
        f"{right(counts):.1%} of {counts.total()} right, "
        f"{time.process_time() - began:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()
