"""Episodes killed at random moments: what was flushed must be in what is left."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayproof.harness.bench.soak.child import Kill, in_child, scratch
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config, override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.log.writer import FLUSH_PERIOD_NS
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up

EPISODES = (("empty", "drone"), ("corridor", "quadruped"))
SETTINGS = ("episode.time_limit=4",)
SILENCE_S = 60.0
CHECKED = 10
"""Every so manieth log that was recovered is also replayed and audited."""


@dataclass(frozen=True)
class Killed:
    """What killing episodes showed.

    Attributes:
        count: Episodes started.
        killed: Of these, before their log was finished.
        finished: Of these, whose log was whole before the kill came.
        before_first: Killed before a second was simulated: there may be nothing to recover.
        recovered: Logs made of partial ones.
        decisions_told: Decisions that the killed episodes had written.
        decisions_lost: Of these, not in the recovered logs: all younger than a second.
        checked: Recovered logs that were replayed and audited.
        failures: What broke a promise; empty if nothing did.
    """

    count: int
    killed: int
    finished: int
    before_first: int
    recovered: int
    decisions_told: int
    decisions_lost: int
    checked: int
    failures: tuple[str, ...]


def soak_kill(count: int, seed: int, progress: Progress, first: int = 0) -> Killed:
    """Kill episodes with SIGKILL, each a random moment after a random decision of it.

    Args:
        count: Episodes.
        seed: Of all of them.
        progress: Told how far it is.
        first: Number of the first episode.
    """
    scenarios = []
    for world, robot in EPISODES:
        config = override(Config(world, robot, seed), SETTINGS)
        warm_up(config)
        scenarios.append((build(config), *_whole(config)))
    tally = dict.fromkeys(
        ("killed", "finished", "before_first", "recovered", "told", "lost", "checked"), 0
    )
    failures: list[str] = []
    for trial in range(first, first + count):
        rng = np.random.default_rng((seed, trial))
        scenario, decisions, lasts = scenarios[trial % len(scenarios)]
        kill = Kill(int(rng.integers(decisions + 1)), float(rng.uniform(0.0, lasts / decisions)))
        with tempfile.TemporaryDirectory(dir=scratch()) as folder:
            path = Path(folder) / "killed.mcap"
            _kill_one(scenario, path, kill, trial, tally, failures)
        if (trial + 1) % 20 == 0:
            progress(f"kill: up to {trial + 1}, {len(failures)} failures")
    return Killed(
        count,
        tally["killed"],
        tally["finished"],
        tally["before_first"],
        tally["recovered"],
        tally["told"],
        tally["lost"],
        tally["checked"],
        tuple(failures),
    )


def _whole(config: Config) -> tuple[int, float]:
    """Decisions of one episode, and its wall time, s."""
    with tempfile.TemporaryDirectory(dir=scratch()) as folder:
        began = time.perf_counter()
        result = run_episode(build(config), Path(folder) / "whole.mcap")
        return result.decisions, time.perf_counter() - began


def _kill_one(
    scenario: Scenario,
    path: Path,
    kill: Kill,
    trial: int,
    tally: dict[str, int],
    failures: list[str],
) -> None:
    def work(tell: Callable[[str], None]) -> None:
        def note(decision: pb.Decision, _: pb.Truth) -> None:
            tell(f"{decision.sequence} {decision.timestamp.ToNanoseconds()} {decision.chain}")

        run_episode(scenario, path, note)

    ended = in_child(work, SILENCE_S, kill)
    told = [line.split() for line in ended.lines if len(line.split()) == 3]
    if any(line.startswith("traceback") for line in ended.lines) or ended.overdue:
        failures.append(f"trial {trial}: {ended.lines[-1]}")
        return
    tally["told"] += len(told)
    if path.exists():
        tally["finished"] += 1
        if [one.chain for one in open_log(path).decisions()] != [chain for *_, chain in told]:
            failures.append(f"trial {trial}: a finished log of other decisions")
        return
    tally["killed"] += 1
    partial = path.with_name(path.name + ".partial")
    # Whatever is older than a flush period at the last decision told has been flushed.
    due = sum(int(told[-1][1]) - int(time_ns) > FLUSH_PERIOD_NS for _, time_ns, _ in told)
    if due == 0:
        tally["before_first"] += 1
    try:
        recovery = recover(partial)
    except InputError as error:
        if due:
            failures.append(f"trial {trial}: {due} decisions due, but {error}")
        tally["lost"] += len(told)
        return
    tally["recovered"] += 1
    assert recovery.written is not None  # a partial log is always copied
    target = Path(recovery.written)
    chains = [one.chain for one in open_log(target).decisions()]
    tally["lost"] += max(len(told) - len(chains), 0)
    expected = [chain for *_, chain in told]
    # The kill may come between the last decision's bytes and the line that tells of it.
    shared = min(len(chains), len(expected))
    if len(chains) < due or chains[:shared] != expected[:shared]:
        failures.append(f"trial {trial}: {len(chains)} decisions left, {due} were flushed")
    if tally["recovered"] % CHECKED == 1:
        tally["checked"] += 1
        if not replay(target).identical or audit(target).violations:
            failures.append(f"trial {trial}: the recovered log does not replay or pass its audit")
