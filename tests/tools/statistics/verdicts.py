"""False alarms and power of gates, from simulated studies."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tests.harness.study.here import paired
from wayproof.harness.bench.table import Progress
from wayproof.harness.bench.table import Row as Document
from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.bounds import Array
from wayproof.harness.study.analysis import samples_between, samples_of
from wayproof.harness.study.default_gates import DEFAULT_GATES
from wayproof.harness.study.file import PACKAGED, read_study
from wayproof.harness.study.gate import Gate, read_gate
from wayproof.harness.study.gates import GateResult, judge
from wayproof.harness.study.plan import Arm, plan_episodes
from wayproof.harness.study.rows import Row

TIME_LIMIT = 60.0
"""Time limit of an episode, s."""

ALIKE = 0.7
"""Correlation of two episodes of one seed."""


@dataclass(frozen=True)
class Stack:
    """Distribution of the episodes of a stack."""

    success: float = 0.95
    collisions: float = 0.02
    time: float = 20.0


CHANGES: dict[str, tuple[Stack, Stack, str]] = {
    "success 0.95 to 0.75": (Stack(), Stack(success=0.75), "success.drop <= 0"),
    "success 0.95 to 0.75, default": (Stack(), Stack(success=0.75), DEFAULT_GATES[0]),
    "collisions 0 to 0.1": (
        Stack(collisions=0.0),
        Stack(success=0.9, collisions=0.1),
        "collisions.rise <= 0",
    ),
    "collisions 0 to 0.3, default": (
        Stack(collisions=0.0),
        Stack(success=0.7, collisions=0.3),
        DEFAULT_GATES[1],
    ),
    "time 20 to 24 s": (Stack(), Stack(time=24.0), "time_to_goal.rise <= 0"),
    "time 20 to 20 s": (Stack(), Stack(), "time_to_goal.rise <= 2"),
    "success 1.00 to 1.00, default": (Stack(1.0, 0.0), Stack(1.0, 0.0), DEFAULT_GATES[0]),
}
"""Name of a change -> stack before, stack after, and the gate that should detect the change."""


def bench_alarms(
    repeats: int, seed: int, clusters: Sequence[int], progress: Progress
) -> list[Document]:
    """Return how often a study without a change fails: A against A, with means at their bounds.

    The studies are those of `wayproof compare` and the packaged ones with gates, with all arms.
    """
    rows = []
    gated = (path for path in PACKAGED.glob("*.toml") if "\ngates" in path.read_text())
    names = sorted(path.stem for path in gated)
    for name in ["compare", *names]:
        arms, gates = study_of(name)
        progress(f"A against A, {name}")
        cells = {
            f"k={k}": share_failing(name, arms, gates, clusters=k, repeats=repeats, seed=seed)
            for k in clusters
        }
        texts = "; ".join(gate.text for gate in gates)
        rows.append({"study": name, "gates": texts, **cells, "most": max(cells.values())})
    return rows


def study_of(name: str) -> tuple[list[Arm], list[Gate]]:
    """Return the arms and gates of a study; the first arms are the references of the others."""
    if name == "compare":
        return [Arm("warehouse", robot="drone", variant="", perturbation="none", severity=0)], [
            read_gate(one) for one in DEFAULT_GATES
        ]
    study = read_study(name)
    first = study.seeds if isinstance(study.seeds, int) else study.seeds[0]
    arms = [one.arm for one in plan_episodes(study) if one.seed == min(first, 0)]
    return arms, [read_gate(text) for text in study.gates]


def share_failing(
    name: str, arms: Sequence[Arm], gates: Sequence[Gate], clusters: int, repeats: int, seed: int
) -> float:
    """Return the share of simulated studies without a change in which a gate failed."""
    generator = np.random.default_rng([seed, clusters])
    stack = _at_bound(gates)
    failing = 0
    for _ in range(repeats):
        luck = generator.normal(size=clusters)
        rows = [row for arm in arms for row in _rows(generator, arm, stack, luck)]
        if name == "compare":
            samples = samples_between(_rows(generator, arms[0], stack, luck), rows)
        else:
            samples = samples_of(paired(rows, arms[0].variant))
        results = judge(samples, gates, TIME_LIMIT)
        failing += any(result.verdict == "failed" for result in results)
    return failing / repeats


def _at_bound(gates: Sequence[Gate]) -> Stack:
    """Return a stack whose means are at the bounds of the gates, the hardest case."""
    bounds = {gate.metric: gate.bound for gate in gates if gate.statistic == "mean"}
    success = bounds.get("success", Stack.success)
    return Stack(success=success, collisions=min(bounds.get("collisions", 0.02), 1.0 - success))


def bench_power(
    repeats: int, seed: int, clusters: Sequence[int], progress: Progress
) -> list[Document]:
    """Return how often a gate on a known change is `failed / inconclusive / held`."""
    rows = []
    for change, (before, after, text) in CHANGES.items():
        progress(change)
        cells = {}
        for k in clusters:
            generator = np.random.default_rng([seed, k])
            verdicts = Counter(
                compared(generator, before, after, clusters=k, gate=read_gate(text)).verdict
                for _ in range(repeats)
            )
            shares = (verdicts[one] / repeats for one in ("failed", "inconclusive", "held"))
            cells[f"k={k}"] = " / ".join(f"{share:.2f}" for share in shares)
        rows.append({"change": change, "gate": text, **cells})
    return rows


def compared(
    generator: np.random.Generator, before: Stack, after: Stack, clusters: int, gate: Gate
) -> GateResult:
    """Simulate one comparison of two stacks over the same seeds."""
    arm = Arm("warehouse", robot="drone", variant="", perturbation="none", severity=0)
    luck = generator.normal(size=clusters)
    first, second = (_rows(generator, arm, stack, luck) for stack in (before, after))
    [result] = judge(samples_between(first, second), [gate], TIME_LIMIT)
    return result


def _rows(generator: np.random.Generator, arm: Arm, stack: Stack, luck: Array) -> list[Row]:
    """Simulate an episode of each seed: failures and collisions by rank, lognormal times."""
    own, pace = generator.normal(size=(2, len(luck)))
    rank = ndtr(ALIKE * luck + math.sqrt(1.0 - ALIKE**2) * own)
    reached, collided = rank < stack.success, rank > 1.0 - stack.collisions
    times = np.minimum(stack.time * np.exp(0.3 * luck + 0.1 * pace), TIME_LIMIT)
    rows = []
    for k, success in enumerate(reached.tolist()):
        metrics: dict[str, float | None] = dict.fromkeys(METRICS)
        metrics["success"], metrics["collisions"] = float(success), float(collided[k])
        metrics["time_to_goal"] = float(times[k]) if success else None
        outcome = "success" if success else "collision" if collided[k] else "timeout"
        rows.append(
            Row(
                str(k),
                arm,
                seed=k,
                outcome=outcome,
                reason="",
                cause="",
                chain="",
                duration=float(times[k]),
                metrics=metrics,
                acts=(),
            )
        )
    return rows
