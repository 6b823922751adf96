"""Soak of killed episodes: everything that was flushed must be recovered."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.tools.soak.child import Kill, in_child, scratch
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.log.writer import FLUSH_PERIOD_NS
from wayproof.harness.recompute.moments import Moment
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import Scenario, build
from wayproof.harness.warm_up import warm_up

EPISODES = (("empty", "drone"), ("corridor", "quadruped"))
SETTINGS = ("episode.time_limit=3",)
SILENCE_S = 60.0
CHECKED = 10
"""Period, in recovered logs, of a replay and an audit."""


def soak_kill(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Kill episodes with SIGKILL, each at a random time after a random decision."""
    scenarios = []
    for world, robot in EPISODES:
        config = override(Config(world, robot, seed), SETTINGS)
        warm_up(config)
        scenarios.append((build(config), *_run_whole(config)))
    tally = dict.fromkeys(
        ("killed", "finished", "before_first", "recovered", "reported", "lost", "checked"), 0
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
    return SimpleNamespace(count=count, **tally, failures=failures)


def _run_whole(config: Config) -> tuple[int, float]:
    """Return the number of decisions of an episode, and its wall time, s."""
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
    def work(report: Callable[[str], None]) -> None:
        def note(moment: Moment) -> None:
            decision = moment.decision
            report(f"{decision.sequence} {decision.timestamp.ToNanoseconds()} {decision.chain}")

        run_episode(scenario, path, note)

    ended = in_child(work, SILENCE_S, kill)
    reported = [line.split() for line in ended.lines if len(line.split()) == 3]
    if any(line.startswith("traceback") for line in ended.lines) or ended.overdue:
        failures.append(f"trial {trial}: {ended.lines[-1]}")
        return
    tally["reported"] += len(reported)
    if path.exists():
        tally["finished"] += 1
        if [one.chain for one in open_log(path).decisions()] != [chain for *_, chain in reported]:
            failures.append(f"trial {trial}: a finished log of other decisions")
        return
    tally["killed"] += 1
    partial = path.with_name(path.name + ".partial")
    # Everything older than a flush period at the last reported decision has been flushed.
    due = sum(int(reported[-1][1]) - int(time_ns) > FLUSH_PERIOD_NS for _, time_ns, _ in reported)
    if due == 0:
        tally["before_first"] += 1
    target = path.with_name("recovered.mcap")
    try:
        recover(partial, target)
    except InputError as error:
        if due:
            failures.append(f"trial {trial}: {due} decisions due, but {error}")
        tally["lost"] += len(reported)
        return
    tally["recovered"] += 1
    chains = [one.chain for one in open_log(target).decisions()]
    tally["lost"] += max(len(reported) - len(chains), 0)
    expected = [chain for *_, chain in reported]
    # The kill may come between the last decision's bytes and the line that reports it.
    shared = min(len(chains), len(expected))
    if len(chains) < due or chains[:shared] != expected[:shared]:
        failures.append(f"trial {trial}: {len(chains)} decisions left, {due} were flushed")
    if tally["recovered"] % CHECKED == 1:
        tally["checked"] += 1
        if not replay(target).identical or audit(target).violations:
            failures.append(f"trial {trial}: the recovered log does not replay or pass its audit")
