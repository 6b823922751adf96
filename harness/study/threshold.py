"""Threshold of a perturbation: the smallest severity at which an episode fails, by seed.

Bisection assumes that an episode that fails at one severity fails at every higher one, which need
not be so. The result is a severity at which the seed fails and a lower one at which it does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.config_document import with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import PERTURBATIONS
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.statistics.exact import Interval, quantile_interval
from wayproof.harness.study.contents import Contents, contents_of
from wayproof.harness.study.file import MOST_EPISODES as MOST_PLANNED
from wayproof.harness.study.file import StudyFile, episodes_of, files_of
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.plan import (
    CLEAN,
    Arm,
    Planned,
    perturbation_at,
    plan_episodes,
    planned_for,
)
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, run_missing

RESOLUTION = 0.01
"""Width of a bracket below which it is not halved any more, in severities."""

MOST_EPISODES = 12
"""Default maximum number of episodes of one seed: 2 at the ends and 9 halvings are 11."""

FILE = "threshold.json"
"""File name of the query in the folder of a study, for the report."""


class Query(msgspec.Struct, frozen=True):
    """Perturbations to bisect.

    Attributes:
        perturbations: `KIND` or `KIND:MODE` of each.
        most_episodes: Maximum number of episodes of one seed.
    """

    perturbations: list[str]
    most_episodes: int = MOST_EPISODES


@dataclass(frozen=True)
class Bracket:
    """Bisection of one seed so far.

    Attributes:
        arm: World, robot and variant, and the perturbation at severity 0.
        config: Config of the unperturbed episode.
        survived: Greatest severity that reached the goal; below 0 if none did.
        failed: Least severity that did not reach the goal; infinite if all did.
        episodes: Number of episodes so far.
        error: Error of an episode that could not be run; empty without one.
    """

    arm: Arm
    config: Config
    survived: float = -1.0
    failed: float = math.inf
    episodes: int = 0
    error: str = ""

    @property
    def threshold(self) -> float:
        """Middle of `survived` and `failed`; 0 if unperturbed fails, infinite beyond the scale."""
        return 0.0 if self.survived < 0.0 else (self.survived + self.failed) / 2.0

    def next_severity(self, most_episodes: int) -> float | None:
        """Return the next severity: 0, then the greatest, then halves; None at the end."""
        if self.error or self.episodes >= most_episodes or self.failed == 0.0:
            return None
        if self.survived < 0.0:
            return 0.0
        if math.isinf(self.failed):
            return None if self.survived == MAX_SEVERITY else MAX_SEVERITY
        if self.failed - self.survived <= RESOLUTION:
            return None
        return (self.survived + self.failed) / 2.0

    def with_outcome(self, severity: float, outcome: str, reason: str) -> Bracket:
        """Return the bracket after one more episode."""
        tried = replace(self, episodes=self.episodes + 1)
        if outcome == "error":
            return replace(tried, error=reason)
        if outcome == "success":
            return replace(tried, survived=severity)
        return replace(tried, failed=severity)


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the seeds of one arm for one perturbation.

    Attributes:
        arm: The arm, with severity 0.
        unit: Unit of the amounts.
        seeds: Seeds that are bisected, in the order of the lists below.
        survived: Greatest severity that each seed survived; below 0 if it fails unperturbed.
        failed: Least severity at which each seed failed; infinite beyond the scale.
        severities: Threshold of each seed: the middle of both, 0 if it fails unperturbed, infinite
            beyond the scale.
        amounts: The thresholds as amounts in the unit.
        median: Median threshold, with its interval by order statistics.
        median_amount: Median threshold as amounts; infinite beyond the scale.
        fail_unperturbed: Number of seeds that fail without a perturbation.
        bear_all: Number of seeds that survive the greatest severity.
        errors: Seeds with an episode that could not be run.
        first_error: Error of the first of these; empty without any.
        unfinished: Number of seeds whose bisection is not finished.
        episodes: Number of episodes of all seeds.
    """

    arm: Arm
    unit: str
    seeds: list[int]
    survived: list[float]
    failed: list[float]
    severities: list[float]
    amounts: list[float]
    median: Interval | None
    median_amount: Interval | None
    fail_unperturbed: int
    bear_all: int
    errors: list[int]
    first_error: str
    unfinished: int
    episodes: int


def find_thresholds(
    study: StudyFile, query: Query, store: Store, engine: Engine, finished: Finished
) -> list[Thresholds]:
    """Bisect every seed of every arm of a study in parallel; finished episodes are not run again.

    Args:
        study: Worlds, robots, seeds, settings and axes, without perturbations.
        query: Perturbations to bisect.
        store: Folder of the logs.
        engine: Engine that runs the episodes.
        finished: Called after each episode.

    Raises:
        InputError: A perturbation is unknown, or the study cannot be planned or written.
    """
    contents = contents_of(files_of(study))
    brackets = brackets_of(study, query, contents)
    with store.open():
        store.clear_partial()
        store.keep_study(study, contents)
        store.keep(FILE, query)
        while True:
            brackets = [_advance(one, query, store, contents) for one in brackets]
            following = [_following(one, query, contents) for one in brackets]
            if all(one is None for one in following):
                break
            run_missing([one for one in following if one is not None], store, engine, finished)
    return _thresholds(brackets, query)


def read_thresholds(study: StudyFile, store: Store) -> list[Thresholds]:
    """Return the thresholds in the folder of a study so far; empty without a query in it.

    Raises:
        InputError: A log or the query is damaged.
    """
    try:
        text = (store.folder / FILE).read_bytes()
    except FileNotFoundError:
        return []
    try:
        query = msgspec.json.decode(text, type=Query)
    except msgspec.DecodeError as error:
        raise InputError(f"'{store.folder / FILE}': {error}") from None
    contents = store.read_contents()
    brackets = brackets_of(study, query, contents)
    return _thresholds([_advance(one, query, store, contents) for one in brackets], query)


def brackets_of(study: StudyFile, query: Query, contents: Contents) -> list[Bracket]:
    """Return the initial bracket of each unperturbed episode and perturbation."""
    if study.recordings:
        raise InputError(
            f"study '{study.name}': of recordings, expected simulated episodes, which can fail"
        )
    names = query.perturbations
    if len(names) != len(set(names)) or len(names) * episodes_of(study) > MOST_PLANNED:
        raise InputError(
            f"{len(names)} perturbations of {episodes_of(study)} episodes, expected each once and "
            f"at most {MOST_PLANNED} pairs"
        )
    for name in names:
        perturbation_at(name, MAX_SEVERITY)
    clean = [one for one in plan_episodes(study, contents) if one.arm.perturbation == CLEAN]
    return [
        Bracket(replace(one.arm, perturbation=name), one.config) for one in clean for name in names
    ]


def _advance(bracket: Bracket, query: Query, store: Store, contents: Contents) -> Bracket:
    """Return the bracket after all episodes that are in the folder."""
    while (severity := bracket.next_severity(query.most_episodes)) is not None:
        planned = _planned(bracket, severity, contents)
        if not store.is_done(planned.key):
            return bracket
        bracket = bracket.with_outcome(severity, *_outcome(store, planned))
    return bracket


def _outcome(store: Store, planned: Planned) -> tuple[str, str]:
    error = store.error(planned.key)
    if error is not None:
        return "error", error
    result = open_planned(store.log(planned.key), planned, allow_plugins=True).result
    return result["outcome"], result.get("reason", "")


def _following(bracket: Bracket, query: Query, contents: Contents) -> Planned | None:
    severity = bracket.next_severity(query.most_episodes)
    return None if severity is None else _planned(bracket, severity, contents)


def _planned(bracket: Bracket, severity: float, contents: Contents) -> Planned:
    perturbation = perturbation_at(bracket.arm.perturbation, severity)
    return planned_for(bracket.arm, with_perturbation(bracket.config, perturbation), contents)


def _thresholds(brackets: Sequence[Bracket], query: Query) -> list[Thresholds]:
    arms = dict.fromkeys(one.arm for one in brackets)
    return [thresholds_of([one for one in brackets if one.arm == arm], query) for arm in arms]


def thresholds_of(brackets: Sequence[Bracket], query: Query) -> Thresholds:
    """Return the thresholds of one arm from the brackets of its seeds."""
    arm = brackets[0].arm
    known = [
        one for one in brackets if not one.error and one.next_severity(query.most_episodes) is None
    ]
    severities = [one.threshold for one in known]
    median = quantile_interval(severities) if severities else None

    def amount(severity: float) -> float:
        return amount_at(arm.perturbation, severity)

    return Thresholds(
        arm=arm,
        unit=PERTURBATIONS[arm.perturbation.partition(":")[0]].measured_in,
        seeds=[one.config.seed for one in known],
        survived=[one.survived for one in known],
        failed=[one.failed for one in known],
        severities=severities,
        amounts=[amount(one) for one in severities],
        median=median,
        median_amount=None if median is None else _each(amount, median),
        fail_unperturbed=sum(one.survived < 0.0 for one in known),
        bear_all=sum(math.isinf(one.failed) for one in known),
        errors=[one.config.seed for one in brackets if one.error],
        first_error=next((one.error for one in brackets if one.error), ""),
        unfinished=len(brackets) - len(known) - sum(bool(one.error) for one in brackets),
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


def _each(function: Callable[[float], float], interval: Interval) -> Interval:
    return Interval(function(interval.estimate), function(interval.low), function(interval.high))


def thresholds_in_words(thresholds: Thresholds) -> str:
    """Return the median with its interval, and the seeds without a threshold, in words."""
    text = f"{len(thresholds.seeds)} seeds in {thresholds.episodes} episodes"
    if thresholds.median is not None and thresholds.median_amount is not None:
        half = _half_in_words(thresholds.median, thresholds.median_amount, thresholds.unit)
        text += f": half fail {half}"
    parts = [
        f"{thresholds.bear_all} bear even 5",
        f"{thresholds.fail_unperturbed} fail unperturbed",
        f"{len(thresholds.errors)} could not be run"
        + (f", first: {thresholds.first_error}" if thresholds.errors else ""),
    ]
    return "; ".join([text, *parts])


def _half_in_words(severity: Interval, amount: Interval, unit: str) -> str:
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
