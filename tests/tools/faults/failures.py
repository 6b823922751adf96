"""Failures with a known cause in the registered worlds, and the causes attributed to them.

One thing is changed in episodes that succeed; those that then fail are judged by their logs alone.
Thresholds may be tuned on even seeds; odd seeds are the test set.
"""

from __future__ import annotations

import functools
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from zlib import crc32

import numpy as np

from tests.tools.faults.breaks import KINDS
from tests.tools.faults.judged import Judged
from tests.tools.soak.child import scratch
from wayproof.harness.attribution.case import read_case
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


def attempts(kind: str, first_seed: int = FIRST_SEED) -> Iterator[tuple[str, str, int]]:
    """Yield world, robot and seed of every attempt at a kind."""
    where = KINDS[kind].where or COMBINATIONS
    first = 0 if KINDS[kind].where else crc32(kind.encode())
    for number in range(ATTEMPTS):
        rounds = number // (2 * len(where))
        world, robot = where[(number // 2 + first) % len(where)]
        yield world, robot, first_seed + 2 * rounds + number % 2


def judge_kind(
    kind: str, count: int, first_seed: int, folder: Path, checked: bool
) -> Iterator[Judged]:
    """Yield `count` failures of a kind in each half, or as many as the attempts give."""
    taken = Counter[int]()
    for world, robot, seed in attempts(kind, first_seed):
        if taken[seed % 2] >= count:
            continue
        path = folder / "broken.mcap"
        made = _break(kind, world, robot, seed, path)
        if made is not None:
            taken[seed % 2] += 1
            yield _judge(kind, seed, made, path, f"{world}, {robot}", checked)


def _break(kind: str, world: str, robot: str, seed: int, path: Path) -> Result | None:
    """Run an episode with one thing changed; None unless it fails, and succeeds without."""
    rng = np.random.default_rng([seed, *kind.encode(), *world.encode(), *robot.encode()])
    try:
        sound = _sound(world, robot, seed, KINDS[kind].base)
        if sound is None:
            return None
        broken = KINDS[kind].breaks(sound, rng)
        made = run_episode(broken.scenario(sound), path, record="full", stack=broken.stack)
    except (InputError, ValueError) as error:
        print(f"{kind}, {world}, {robot}, {seed}: {error}", flush=True)
        return None
    return None if made.outcome in ("success", "error") else made


@functools.cache
def _sound(world: str, robot: str, seed: int, base: tuple[str, ...]) -> Scenario | None:
    """Run an unchanged episode; None unless it reaches its goal."""
    document = {"world": world, "robot": robot, "seed": seed}
    scenario = build(override(from_document(document), (*SETTINGS, *base)))
    with tempfile.TemporaryDirectory(dir=scratch()) as folder:
        result = run_episode(scenario, Path(folder) / "sound.mcap", record="decisions")
    return scenario if result.outcome == "success" else None


def _judge(kind: str, seed: int, made: Result, path: Path, where: str, checked: bool) -> Judged:
    """Find the cause in the log; where it is checked, a check that contradicts it counts."""
    planted, log = KINDS[kind].cause, open_log(path)
    finding = find_cause(read_case(log))
    assert finding is not None
    found, expected = finding.cause, (planted,)
    text = f"{where}: {finding.evidence}"
    if checked:
        expected = (planted, "inconclusive", "refused")
        try:
            verdict = check(log, finding, thorough=False, most_s=MOST_SIMULATED)
        except InputError as error:
            return Judged(planted, expected, "refused", seed, made.outcome, f"{where}: {error}")
        saving = ", ".join(f"{one.remedy} {one.outcome}" for one in verdict.checks)
        text = f"{where}: {verdict.answer}, from {found}: {saving}"
        found = "inconclusive" if verdict.answer == "inconclusive" else verdict.finding.cause
    return Judged(planted, expected, found, seed, made.outcome, f"{kind}, {text}")
