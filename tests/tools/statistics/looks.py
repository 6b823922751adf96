"""False decisions of gates that are looked at again and again, and the worlds that they need."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.tools.statistics.verdicts import ALIKE, TIME_LIMIT
from wayproof.harness.bench.table import Progress
from wayproof.harness.bench.table import Row as Document
from wayproof.harness.statistics.bounds import Array
from wayproof.harness.statistics.support import RATE, TIME, Support
from wayproof.harness.study.analysis import Values
from wayproof.harness.study.gate import Gate, SequentialGate, read_gate
from wayproof.harness.study.gates import verdict_of

WORLDS = 300

SIZES = (5, 10, 20, 35, 50, 75, 100, 200, 300)
"""Looks at a gate of a fixed size, and the sizes at which it is judged once."""

POWER = 0.8
"""Share of the samples that are decided at the number of worlds that is named."""

Sample = tuple[Array, Array | None]
"""Values of the worlds, and those of their partners."""


class Case(NamedTuple):
    """Worlds of a known mean, and a gate on it."""

    gate: str
    draw: Callable[[np.random.Generator], Sample]
    support: Support = RATE


def _rate(share: float) -> Callable[[np.random.Generator], Sample]:
    return lambda rng: ((rng.random(WORLDS) < share).astype(np.float64), None)


def _pair(first: float, second: float) -> Callable[[np.random.Generator], Sample]:
    """Draw pairs of successes, correlated by world; the reference is the first."""

    def draw(rng: np.random.Generator) -> Sample:
        luck = ALIKE * rng.normal(size=WORLDS)
        ranks = luck + math.sqrt(1.0 - ALIKE**2) * rng.normal(size=(2, WORLDS))
        limits = np.quantile(rng.normal(size=100_000), [first, second])
        before, after = (ranks < limits[:, None]).astype(np.float64)
        return before, after

    return draw


def _time(first: float, second: float) -> Callable[[np.random.Generator], Sample]:
    """Draw lognormal times, by world and by episode, cut off at the time limit."""

    def draw(rng: np.random.Generator) -> Sample:
        world, own = 0.3 * rng.normal(size=WORLDS), 0.1 * rng.normal(size=(2, WORLDS))
        before, after = np.minimum(np.array([[first], [second]]) * np.exp(world + own), TIME_LIMIT)
        return after, before

    return draw


TIMES = TIME.within(TIME_LIMIT)

AT_THE_BOUND = {
    **{f"success {p}": Case(f"success.mean >= {p}", _rate(p)) for p in (0.5, 0.7, 0.9, 0.95, 0.99)},
    "success 0.9 to 0.8": Case("success.drop <= 0.1", _pair(0.9, 0.8)),
    "success 0.95 to 0.95": Case("success.drop <= 0", _pair(0.95, 0.95)),
    "collisions 0.03": Case("collisions.mean <= 0.03", _rate(0.03)),
    "time 20 to 20 s": Case("time_to_goal.rise <= 0", _time(20.0, 20.0), TIMES),
}
"""Cases whose mean is at the bound of the gate, where any decision is counted as false."""

BEYOND = {
    "success 1": Case("success.mean >= 0.95", _rate(1.0)),
    "success 0.99": Case("success.mean >= 0.95", _rate(0.99)),
    "success 0.9": Case("success.mean >= 0.8", _rate(0.9)),
    "success 1 to 1": Case("success.drop <= 0.1", _pair(1.0, 1.0)),
    "success 0.95 to 0.95": Case("success.drop <= 0.1", _pair(0.95, 0.95)),
    "success 0.95 to 0.75": Case("success.drop <= 0", _pair(0.95, 0.75)),
    "success 1 to 0": Case("success.drop <= 0.1", _pair(1.0, 0.0)),
    "collisions 0": Case("collisions.mean <= 0.1", _rate(0.0)),
    "time 20 to 20 s": Case("time_to_goal.rise <= 5", _time(20.0, 20.0), TIMES),
    "time 20 to 30 s": Case("time_to_goal.rise <= 0", _time(20.0, 30.0), TIMES),
}
"""Cases in which the gate has an answer."""


def bench_looks(repeats: int, seed: int, progress: Progress) -> list[Document]:
    """Return, for each case, the decisions and the worlds that they took."""
    return [
        _judged(name, case, repeats, seed, cases is AT_THE_BOUND)
        for cases in (AT_THE_BOUND, BEYOND)
        for name, case in cases.items()
        if progress(f"{name}, {case.gate}") is None
    ]


def _judged(name: str, case: Case, repeats: int, seed: int, at_bound: bool) -> Document:
    rng = np.random.default_rng(seed)
    samples = [case.draw(rng) for _ in range(repeats)]
    once, always = (read_gate(case.gate, kind) for kind in (Gate, SequentialGate))
    looked = np.array([[_decided(once, case, one, size) for one in samples] for size in SIZES])
    decided = [_decided(always, case, one, WORLDS) for one in samples]
    return {
        "worlds": name,
        "gate": case.gate,
        "decided, sequential": f"{np.mean(decided):.3f}",
        "decided, fixed, by any look": f"{np.mean(looked.any(axis=0)):.3f}",
        "worlds, sequential": "" if at_bound else _needed(always, case, samples),
        "worlds, fixed": "" if at_bound else _of_size(looked.mean(axis=1)),
    }


def _decided(gate: Gate, case: Case, sample: Sample, size: int) -> bool:
    """Return whether a gate is held or failed by the first worlds of a sample."""
    interval = gate.interval(_values(case, sample, size), 0.95)
    return interval is not None and verdict_of(gate, interval) != "inconclusive"


def _values(case: Case, sample: Sample, size: int) -> Values:
    second, first = sample
    partners = None if first is None else first[:size].tolist()
    return Values(second[:size].tolist(), partners, list(range(size)), case.support)


def _needed(gate: Gate, case: Case, samples: list[Sample]) -> str:
    """Return the worlds of a sequential gate in half and in `POWER` of the samples."""
    needed = []
    for one in samples[: max(1, len(samples) // 5)]:
        low, high = 1, WORLDS + 1
        while low < high:  # once decided, it stays so
            middle = (low + high) // 2
            if _decided(gate, case, one, middle):
                high = middle
            else:
                low = middle + 1
        needed.append(low)
    half, most = np.quantile(needed, [0.5, POWER], method="inverted_cdf")
    return f"{_number(half)} / {_number(most)}"


def _number(worlds: float) -> str:
    return f"{worlds:.0f}" if worlds <= WORLDS else f"> {WORLDS}"


def _of_size(shares: Array) -> str:
    """Return the least size at which a gate judged once decides in `POWER` of the samples."""
    enough = [size for size, share in zip(SIZES, shares, strict=True) if share >= POWER]
    return f"{enough[0]}" if enough else f"> {WORLDS}"
