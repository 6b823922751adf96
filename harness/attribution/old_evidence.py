"""Old evidence before a failure: old by its stamps, or new by its stamps and old in truth.

What is old by its stamp a stack could tell; what comes again, or later than its stamp says, it
could not, until its own data contradicted it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wayproof.harness.attribution.case import Case, Moment
from wayproof.harness.attribution.commanded import commands_to
from wayproof.harness.stack.mapping import FROZEN_SHIFT, POSE_WITHIN_NS

HALF = 0.5

RECENT = 20
"""Decisions before the end that show whether evidence still came: 2 s at 10 Hz."""

LAGS = (1, 2, 3, 5, 7, 10)
"""Numbers of decisions by which poses may be older than their stamps say."""

LEAST = 3
"""Least number of poses that show by how much they are older."""

HIDDEN_S = 0.05
"""Age beyond that of its stamp from which content is no more of now, s."""

FITS = 0.5
"""Share of the margin that poses are off, at most, that are as old as is tried."""


@dataclass(frozen=True)
class OldFacts:
    """What of the evidence was old, in words; empty if nothing was.

    Attributes:
        stated: Old by its stamps.
        hidden: Stamped as new.
    """

    stated: str = ""
    hidden: str = ""


class HasOld(Protocol):
    """Facts of a contact or of a standstill."""

    @property
    def old(self) -> Callable[[], OldFacts]:
        """Measures how old the evidence was."""


def frozen_evidence(facts: HasOld) -> str | None:
    """Content came again under new stamps, or was older than they say."""
    return facts.old().hidden or None


def stale_evidence(facts: HasOld) -> str | None:
    """A stream stopped by its stamps, and the stack went on, or stood for want of it."""
    return facts.old().stated or None


OLD_TESTS: tuple[tuple[str, Callable[[Any], str | None]], ...] = (
    ("frozen_evidence", frozen_evidence),
    ("stale_evidence", stale_evidence),
)
"""Tests of contacts and standstills, by cause."""


def old_facts(case: Case, until: int) -> OldFacts:
    """Return what of the evidence was old up to a decision."""
    moments = case.moments[: until + 1]
    hidden = _repeated_pose(moments) or _late_sweeps(moments) or _late_pose(case, moments)
    return OldFacts(stated=_stated(case, moments), hidden=hidden)


def _stated(case: Case, moments: Sequence[Moment]) -> str:
    """Return what was old by its stamp at the end."""
    last, recent = moments[-1], moments[-RECENT:]
    if last.pose.age_ns > POSE_WITHIN_NS:
        return f"the pose was {last.pose.age_ns * 1e-9:.1f} s old by its stamp"
    numbers = commands_to(case, case.end_s)
    verdicts = [case.moments[number].decision.verdict.verdict for number in numbers]
    if "stale" in verdicts:
        limit, count = case.config.costmap.max_evidence_age, verdicts.count("stale")
        return (
            f"{count} commands that led to it, from decision {numbers[verdicts.index('stale')]} "
            f"on, go where nothing was seen for more than {limit:g} s"
        )
    if np.mean([one.decision.label == "map_stale" for one in recent]) >= HALF:
        age = last.decision.predicate.delay_s
        return f"the robot stood, as what lay on its way was last seen {age:.1f} s ago"
    first = next(iter(case.beams_at(0)), "")
    share = np.mean([all(sweep.sensor != first for sweep in one.sweeps) for one in recent])
    if share >= HALF:
        return f"{share:.0%} of the last {RECENT} decisions were made without a new sweep"
    return ""


def _repeated_pose(moments: Sequence[Moment]) -> str:
    """Return since when the pose at the end came again while the body moved."""
    last = moments[-1].pose
    since = len(moments) - 1
    while since and moments[since - 1].pose.position == last.position:
        since -= 1
    known = _contradicted(moments, since)
    if last.age_ns or since == len(moments) - 1 or known is None:
        return ""
    return _came_again("the pose", moments, since, known)


def _late_sweeps(moments: Sequence[Moment]) -> str:
    """Return by how much the newest sweeps are older than their stamps say."""
    before, last = [one for one in moments if one.sweeps][-2:] or moments[:2]
    earlier = {sweep.sensor: sweep.lag for sweep in before.sweeps}
    for sweep in last.sweeps:
        late_s = _seconds(moments, sweep.lag) - sweep.age_ns * 1e-9
        if not sweep.lag or late_s < HIDDEN_S:
            continue
        since = max(last.pose.sequence - sweep.lag, 0)
        known = _contradicted(moments, since)
        if sweep.lag > earlier.get(sweep.sensor, 0) and known is not None:
            return _came_again(f"the sweep of {sweep.sensor}", moments, since, known)
        return f"the sweeps of {sweep.sensor} were {late_s:.1f} s older than their stamps"
    return ""


def _contradicted(moments: Sequence[Moment], since: int) -> int | None:
    """Return the first moment at which the body had moved since one; None if it stayed."""
    here = moments[since].true_position
    for number in range(since, len(moments)):
        if np.abs(moments[number].true_position - here).max() > FROZEN_SHIFT:
            return number
    return None


def _came_again(what: str, moments: Sequence[Moment], since: int, known: int) -> str:
    begin_s, known_s = (moments[k].time_ns * 1e-9 for k in (since, known))
    return (
        f"{what} of {begin_s:.1f} s came again under new stamps; {known_s - begin_s:.1f} s later "
        "the body had moved, and the stack's own data contradicted it"
    )


def _late_pose(case: Case, moments: Sequence[Moment]) -> str:
    """Return by how much the poses are older than their stamps say, if all of them are."""
    believed = np.array([one.pose.position for one in moments])[:, : case.axes]
    true = np.array([one.true_position for one in moments])[:, : case.axes]

    def error(lag: int) -> float:
        gaps = np.linalg.norm(believed[lag:] - true[: len(true) - lag], axis=1)
        return float(np.quantile(gaps, 0.9))

    lags = [lag for lag in LAGS if len(moments) >= lag + LEAST]
    margin = case.config.costmap.localization_margin
    if not lags or error(0) <= margin:
        return ""
    best = min(lags, key=error)
    if error(best) > FITS * margin:
        return ""
    return f"each pose was {_seconds(moments, best):.1f} s older than its stamp"


def _seconds(moments: Sequence[Moment], lag: int) -> float:
    """Return the time of so many decisions, s."""
    return lag * (moments[-1].time_ns - moments[0].time_ns) * 1e-9 / max(len(moments) - 1, 1)
