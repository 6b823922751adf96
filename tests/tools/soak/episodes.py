"""Soak of random episodes: each must replay identically in a fresh process.

Its audit must find no violation, a decision's card must be the same from a keyframe as from the
start, and a failure must have a cause. By turns an episode is simulated again or forked.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np

from tests.tools.soak.child import scratch
from tests.tools.soak.kinds import draw
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.bench.table import Progress
from wayproof.harness.explain import make_card
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.study.report.provenance import differing_settings
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool

CLOSED_LOOP_EVERY, FORK_EVERY = 10, 20
MOST_TRACEBACK = 1500  # last characters of a traceback


def soak_episodes(
    count: int, seed: int, progress: Progress, first: int = 0, jobs: int = 2
) -> SimpleNamespace:
    """Run random episodes with their checks; `progress` is called with each as a line of JSON."""
    outcomes, failures = Counter[str](), []
    done = Counter[str](replayed=0, closed_loop=0, forked=0)
    trials = [(number, seed) for number in range(first, first + count)]
    with WorkerPool(jobs) as pool:
        for trial in pool.run_in_order(run_trial, trials):
            progress(msgspec.json.encode(trial).decode())
            outcomes[trial["outcome"]] += 1
            done.update({key: int(trial[key]) for key in done})
            named = f"trial {trial['trial']}: {trial['episode']}"
            failures += [f"{named}: {text}" for text in trial["failures"]]
    return SimpleNamespace(count=count, **done, outcomes=dict(outcomes), failures=failures)


def run_trial(number: int, seed: int) -> dict[str, object]:
    """Run one random episode with its checks; what raises is a failure of the trial."""
    drawn, rng = draw(number, seed), np.random.default_rng((seed, number))
    scenario, config = drawn.scenario, drawn.scenario.config
    perturbed = config.perturbation and f"{config.perturbation.kind}:{config.perturbation.severity}"
    stack = f"{config.map.kind} {config.costmap.unknown_policy} {config.planner.name}"
    trial: dict[str, object] = {
        "trial": number,
        "episode": f"{config.world} {config.robot} {config.seed} {stack} {perturbed or 'none'}",
        "kind": drawn.kind,
        "settings": differing_settings(config),
        "outcome": "raised",
        "replayed": False,
        "closed_loop": number % CLOSED_LOOP_EVERY == 0,
        "forked": number % FORK_EVERY == 1,
    }
    failures: list[str] = []
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        path = Path(name) / f"{number}.mcap"
        try:
            warm_up(config)
            result = run_episode(scenario, path)
            trial |= {"outcome": result.outcome, "chain": result.chain, "replayed": True}
            failures += _replayed(path) + _audited(path) + _explained(path, rng)
            if trial["closed_loop"] and not simulate_again(path).identical:
                failures.append("simulated anew, it differs")
            if trial["forked"]:
                failures += _fork(path, int(rng.integers(result.decisions)), result)
        except Exception:  # whatever an episode or a check of it raises is a finding
            failures.append(traceback.format_exc()[-MOST_TRACEBACK:])
    return trial | {"failures": failures}


def _replayed(log: Path) -> list[str]:
    """Replay a log by the command line, in a process that knows nothing of the episode."""
    command = [sys.executable, "-m", "wayproof", "replay", "--json", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or done.stderr:
        return [f"replay: exit code {done.returncode}: {done.stderr[-500:]}"]
    document = json.loads(done.stdout)
    return [] if document["identical"] else [f"replay: {document['differences'][:3]}"]


def _audited(path: Path) -> list[str]:
    """Return the violations of a log, but joints where the robot holds a pose that has jumped."""
    decisions = open_log(path).decisions()
    jumped = {
        one.sequence
        for one in decisions
        if one.label == "localization_lost" and not one.predicate.HasField("sigma_m")
    }
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
