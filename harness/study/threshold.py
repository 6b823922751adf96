"""The smallest perturbation that makes an episode fail, seed by seed: a stack's margin.

Bisection takes it that an episode that fails at one severity fails at every higher one. It need not
be so; what is told is a severity at which the seed fails, and a lower one at which it does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import msgspec

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import PERTURBATIONS
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.contents import Contents, contents_of
from wayproof.harness.study.file import (
    CLEAN,
    Arm,
    Planned,
    StudyFile,
    episodes_of,
    files_of,
    perturbation_at,
    plan_episodes,
    planned_for,
)
from wayproof.harness.study.file import MOST_EPISODES as MOST_PLANNED
from wayproof.harness.study.matching import open_planned
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.statistics.exact import Interval, quantile_interval
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, run_missing

RESOLUTION = 0.01
"""A bracket narrower than this is not halved any more, in severities."""

MOST_EPISODES = 12
"""Of one seed: unperturbed, at the scale's end, and nine halves down to the resolution are 11."""

FILE = "critical.json"
"""In a study's folder: what was asked for, so that the report can tell the answer."""


class Question(msgspec.Struct, frozen=True):
    """What to bisect.

    Attributes:
        perturbations: `KIND` or `KIND:MODE` each.
        most_episodes: Of one seed.
    """

    perturbations: list[str]
    most_episodes: int = MOST_EPISODES


@dataclass(frozen=True)
class Bracket:
    """What is known of one seed.

    Attributes:
        arm: World, robot and variant, and the perturbation at severity 0.
        config: Of the unperturbed episode.
        survived: Greatest severity tried that reached the goal; below 0 if none did.
        failed: Least severity tried that did not; infinite if none did.
        episodes: Tried so far.
        error: Why an episode could not be run, which says nothing about the stack.
    """

    arm: Arm
    config: Config
    survived: float = -1.0
    failed: float = math.inf
    episodes: int = 0
    error: str = ""

    @property
    def critical(self) -> float:
        """Severity in the middle between survived and failed; infinite beyond the scale."""
        return 0.0 if self.survived < 0.0 else (self.survived + self.failed) / 2.0

    def next_severity(self, most_episodes: int) -> float | None:
        """Unperturbed first, then the scale's end, then halves; none when all is tried."""
        if self.error or self.episodes >= most_episodes or self.failed == 0.0:
            return None
        if self.survived < 0.0:
            return 0.0
        if math.isinf(self.failed):
            return None if self.survived == MAX_SEVERITY else MAX_SEVERITY
        if self.failed - self.survived <= RESOLUTION:
            return None
        return (self.survived + self.failed) / 2.0

    def told(self, severity: float, outcome: str, reason: str) -> Bracket:
        """What is known after one more episode."""
        tried = replace(self, episodes=self.episodes + 1)
        if outcome == "error":
            return replace(tried, error=reason)
        if outcome == "success":
            return replace(tried, survived=severity)
        return replace(tried, failed=severity)


@dataclass(frozen=True)
class Margin:
    """How much the seeds of one arm bear of one perturbation.

    Attributes:
        arm: Which, severity 0.
        unit: Of amounts.
        seeds: Those that ran, in the order of the lists below.
        survived: Severity that each bore; below 0 where it fails unperturbed.
        failed: Severity at which each failed; infinite where it bears the whole scale.
        critical: The middle of both; 0 and infinite likewise.
        amounts: The critical severities as amounts in the unit.
        median: Of the critical severities, with its interval by order statistics.
        median_amount: The same as amounts; infinite beyond the scale.
        fail_unperturbed: Seeds that fail without any perturbation.
        bear_all: Seeds that bear the scale's end.
        errors: Seeds with an episode that could not be run.
        first_error: Why the first of those could not; empty without any.
        unfinished: Seeds whose bisection is still to be run.
        episodes: Tried for all of them.
    """

    arm: Arm
    unit: str
    seeds: list[int]
    survived: list[float]
    failed: list[float]
    critical: list[float]
    amounts: list[float]
    median: Interval | None
    median_amount: Interval | None
    fail_unperturbed: int
    bear_all: int
    errors: list[int]
    first_error: str
    unfinished: int
    episodes: int


def find_margins(
    study: StudyFile, question: Question, store: Store, engine: Engine, finished: Finished
) -> list[Margin]:
    """Bisect every seed of every arm of a study, all seeds side by side; what ran is not run again.

    Args:
        study: Worlds, robots, seeds, settings and axes; without its own perturbations.
        question: What to bisect.
        store: Where the logs go.
        engine: Runs them.
        finished: Called for each episode that ends.

    Raises:
        InputError: Unknown perturbation, or the study cannot be planned or written.
    """
    contents = contents_of(files_of(study))
    brackets = brackets_of(study, question, contents)
    with store.open():
        store.clear_partial()
        store.keep_study(study, contents)
        store.keep(FILE, question)
        while True:
            brackets = [_advance(one, question, store, contents) for one in brackets]
            wanted = [_wanted(one, question, contents) for one in brackets]
            if all(one is None for one in wanted):
                break
            run_missing([one for one in wanted if one is not None], store, engine, finished)
    return _margins(brackets, question)


def read_margins(study: StudyFile, store: Store) -> list[Margin]:
    """What the folder of such a study knows by now; nothing if it is none.

    Raises:
        InputError: A log, or what was asked for, is damaged.
    """
    try:
        text = (store.folder / FILE).read_bytes()
    except FileNotFoundError:
        return []
    try:
        question = msgspec.json.decode(text, type=Question)
    except msgspec.DecodeError as error:
        raise InputError(f"'{store.folder / FILE}': {error}") from None
    contents = store.read_contents()
    brackets = brackets_of(study, question, contents)
    return _margins([_advance(one, question, store, contents) for one in brackets], question)


def brackets_of(study: StudyFile, question: Question, contents: Contents) -> list[Bracket]:
    """One for each unperturbed episode and each perturbation, before anything is known."""
    names = question.perturbations
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


def _advance(bracket: Bracket, question: Question, store: Store, contents: Contents) -> Bracket:
    """As far as the store's episodes lead."""
    while (severity := bracket.next_severity(question.most_episodes)) is not None:
        planned = _planned(bracket, severity, contents)
        if not store.is_done(planned.key):
            return bracket
        bracket = bracket.told(severity, *_outcome(store, planned))
    return bracket


def _outcome(store: Store, planned: Planned) -> tuple[str, str]:
    error = store.error(planned.key)
    if error is not None:
        return "error", error
    result = open_planned(store.log(planned.key), planned, allow_plugins=True).result
    return result["outcome"], result.get("reason", "")


def _wanted(bracket: Bracket, question: Question, contents: Contents) -> Planned | None:
    severity = bracket.next_severity(question.most_episodes)
    return None if severity is None else _planned(bracket, severity, contents)


def _planned(bracket: Bracket, severity: float, contents: Contents) -> Planned:
    perturbation = perturbation_at(bracket.arm.perturbation, severity)
    return planned_for(bracket.arm, replace(bracket.config, perturbation=perturbation), contents)


def _margins(brackets: Sequence[Bracket], question: Question) -> list[Margin]:
    arms = dict.fromkeys(one.arm for one in brackets)
    return [margin_of([one for one in brackets if one.arm == arm], question) for arm in arms]


def margin_of(brackets: Sequence[Bracket], question: Question) -> Margin:
    """The margin of one arm from what is known of its seeds."""
    arm = brackets[0].arm
    known = [
        one
        for one in brackets
        if not one.error and one.next_severity(question.most_episodes) is None
    ]
    critical = [one.critical for one in known]
    median = quantile_interval(critical) if critical else None

    def amount(severity: float) -> float:
        return amount_at(arm.perturbation, severity)

    return Margin(
        arm=arm,
        unit=PERTURBATIONS[arm.perturbation.partition(":")[0]].measured_in,
        seeds=[one.config.seed for one in known],
        survived=[one.survived for one in known],
        failed=[one.failed for one in known],
        critical=critical,
        amounts=[amount(one) for one in critical],
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
    """What a severity amounts to; of severity 0 what changes nothing, infinite beyond the scale."""
    if math.isinf(severity):
        return severity
    perturbation = perturbation_at(name, severity)
    if perturbation is None:
        return PERTURBATIONS[name.partition(":")[0]].nothing
    return perturbation.amount


def _each(function: Callable[[float], float], interval: Interval) -> Interval:
    return Interval(function(interval.estimate), function(interval.low), function(interval.high))


def margin_in_words(margin: Margin) -> str:
    """Median with its interval, and the seeds that have none."""
    text = f"{len(margin.seeds)} seeds in {margin.episodes} episodes"
    if margin.median is not None and margin.median_amount is not None:
        middle, amount = margin.median, margin.median_amount
        text += (
            f": half fail at severity {_told(middle.estimate)} ({_told(middle.low)} to "
            f"{_told(middle.high)}), {_told(amount.estimate)} ({_told(amount.low)} to "
            f"{_told(amount.high)}) {margin.unit}"
        )
    parts = [
        f"{margin.bear_all} bear even 5",
        f"{margin.fail_unperturbed} fail unperturbed",
        f"{len(margin.errors)} could not be run"
        + (f", first: {margin.first_error}" if margin.errors else ""),
    ]
    return "; ".join([text.rstrip(), *parts])


def _told(value: float) -> str:
    if value == math.inf:
        return "beyond the scale"
    return "below the scale" if value == -math.inf else f"{value:.3g}"
