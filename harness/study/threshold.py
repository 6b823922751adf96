"""Threshold of a perturbation: the smallest severity at which an episode fails, by seed.

Bisection assumes that an episode that fails at one severity fails at every higher one, which need
not be so. The result is a severity at which the seed fails and a lower one at which it does not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from wayproof.harness.perturbations import PERTURBATIONS
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.statistics.exact import Interval, quantile_interval
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.plan import Arm, Planned, perturbation_at
from wayproof.harness.study.search import Steps, halved

RESOLUTION = 0.01
"""Width of a bracket below which it is not halved any more, in severities."""


@dataclass
class Bracket:
    """Bisection of one seed so far.

    Attributes:
        planned: The unperturbed episode.
        name: `KIND` or `KIND:MODE` of the perturbation.
        most: Maximum number of episodes.
        passed: Greatest severity that reached the goal; below 0 if none did.
        failed: Least severity that did not reach the goal; infinite if all did.
        episodes: Number of episodes so far.
        ended: Whether the bisection is finished.
        error: Error of an episode that could not be run; empty without one.
    """

    planned: Planned
    name: str
    most: int
    passed: float = -1.0
    failed: float = math.inf
    episodes: int = 0
    ended: bool = False
    error: str = ""

    def steps(self) -> Steps:
        """Try severity 0, then the greatest, then halves."""
        severity: float | None = 0.0
        while severity is not None and self.episodes < self.most:
            [tried] = yield [perturbation_at(self.name, severity)]
            self.episodes += 1
            if tried.failed:
                self.failed = severity
            else:
                self.passed = severity
            severity = self._next()
        self.ended = True

    def _next(self) -> float | None:
        if self.failed == 0.0 or self.passed == MAX_SEVERITY:
            return None
        if math.isinf(self.failed):
            return MAX_SEVERITY
        return halved(self.passed, self.failed, RESOLUTION)

    @property
    def threshold(self) -> float:
        """Middle of `passed` and `failed`; 0 if unperturbed fails, infinite beyond the scale."""
        return 0.0 if self.passed < 0.0 else (self.passed + self.failed) / 2.0


@dataclass(frozen=True)
class SeedThreshold:
    """Threshold of one seed.

    Attributes:
        seed: The seed.
        passed: Greatest severity that it passed; below 0 if it fails unperturbed.
        failed: Least severity at which it failed; infinite beyond the scale.
        severity: The middle of both; 0 if it fails unperturbed, infinite beyond the scale.
        amount: That severity as an amount in the unit.
    """

    seed: int
    passed: float
    failed: float
    severity: float
    amount: float


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the seeds of one arm for one perturbation.

    Attributes:
        arm: The arm, with severity 0.
        unit: Unit of the amounts.
        seeds: Threshold of each seed that is bisected.
        median: Median threshold, with its interval by order statistics.
        median_amount: Median threshold as amounts; infinite beyond the scale.
        errors: Seeds with an episode that could not be run.
        first_error: Error of the first of these; empty without any.
        unfinished: Number of seeds whose bisection is not finished.
        episodes: Number of episodes of all seeds.
    """

    arm: Arm
    unit: str
    seeds: list[SeedThreshold]
    median: Interval | None
    median_amount: Interval | None
    errors: list[int]
    first_error: str
    unfinished: int
    episodes: int

    @property
    def exit_code(self) -> int:
        """3 if a seed has no threshold, else 0."""
        return 3 if self.errors or self.unfinished else 0

    def in_words(self) -> str:
        """Return the median with its interval, and the seeds without a threshold, in words."""
        text = f"{len(self.seeds)} seeds in {self.episodes} episodes"
        if self.median is not None and self.median_amount is not None:
            half = half_in_words(self.median, self.median_amount, self.unit)
            text += f": half fail {half}"
        parts = [
            f"{sum(math.isinf(one.failed) for one in self.seeds)} bear even 5",
            f"{sum(one.passed < 0.0 for one in self.seeds)} fail unperturbed",
            f"{len(self.errors)} could not be run"
            + (f", first: {self.first_error}" if self.errors else ""),
        ]
        return "; ".join([text, *parts])


def brackets_of(study: StudyFile, planned: Sequence[Planned]) -> list[Bracket]:
    """Return the bisection of each episode under each perturbation, none of them begun."""
    most = study.threshold.episodes
    return [Bracket(one, name, most) for one in planned for name in study.perturbations]


def thresholds_of(brackets: Sequence[Bracket]) -> list[Thresholds]:
    """Return the thresholds of each arm and perturbation from the brackets of its seeds."""
    by_arm: dict[Arm, list[Bracket]] = {}
    for one in brackets:
        arm = replace(one.planned.arm, perturbation=one.name)
        by_arm.setdefault(arm, []).append(one)
    return [_thresholds(arm, some) for arm, some in by_arm.items()]


def _thresholds(arm: Arm, brackets: Sequence[Bracket]) -> Thresholds:
    name = arm.perturbation
    seeds = [
        SeedThreshold(
            one.planned.seed, one.passed, one.failed, one.threshold, amount_at(name, one.threshold)
        )
        for one in brackets
        if one.ended
    ]
    errors = [one for one in brackets if one.error]
    median = quantile_interval([one.severity for one in seeds]) if seeds else None
    return Thresholds(
        arm=arm,
        unit=PERTURBATIONS[name.partition(":")[0]].measured_in,
        seeds=seeds,
        median=median,
        median_amount=median
        and Interval(*(amount_at(name, end) for end in (median.estimate, median.low, median.high))),
        errors=[one.planned.seed for one in errors],
        first_error=errors[0].error if errors else "",
        unfinished=len(brackets) - len(seeds) - len(errors),
        episodes=sum(one.episodes for one in brackets),
    )


def amount_at(name: str, severity: float) -> float:
    """Return the amount of a severity in the perturbation's unit; infinite beyond the scale."""
    if math.isinf(severity):
        return severity
    perturbation = perturbation_at(name, severity)
    if perturbation is None:
        return PERTURBATIONS[name.partition(":")[0]].nothing
    return perturbation.amount


def half_in_words(severity: Interval, amount: Interval, unit: str) -> str:
    """Return where half of the seeds fail, with the interval, both as severity and as amount."""
    text = f"at severity {severity.estimate:.3g}, {_measured(amount.estimate, unit)}"
    if math.isinf(severity.estimate):
        text = "only beyond the scale"
    if severity.low == -math.inf:
        return f"{text} (too few seeds for an interval)"
    if severity.low == math.inf:
        return text
    low = f"{severity.low:.3g}, {_measured(amount.low, unit)}"
    if severity.high == math.inf:
        return f"{text} (interval from severity {low}, to beyond the scale)"
    ends, amounts = (f"({one.low:.3g} to {one.high:.3g})" for one in (severity, amount))
    return (
        f"at severity {severity.estimate:.3g} {ends}, {amount.estimate:.3g} {amounts} {unit}"
    ).rstrip()


def _measured(amount: float, unit: str) -> str:
    return f"{amount:.3g} {unit}".rstrip()
