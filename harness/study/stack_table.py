"""Table of the stacks of a study: their figures side by side, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.statistics.intervals import mean_interval
from wayproof.harness.statistics.support import TIME
from wayproof.harness.study.analysis import Sample, cluster_of
from wayproof.harness.study.plan import name_of
from wayproof.harness.study.rows import Row


@dataclass(frozen=True)
class StackLine:
    """Figures of one stack under the same conditions; each with its 95 % interval over worlds.

    Attributes:
        conditions: World, robot, variant and perturbation, in words.
        stack: Name of the stack.
        episodes: Number of episodes.
        success: Share of episodes that reached the goal.
        collisions: Number of collisions of an episode; None if no episode ran.
        time: Time to the goal, s; a failure counts as the time limit.
        not_admitted: Share of decisions with a command that the referee did not admit; None for
            the built-in stack.
        guard_cuts: Number of decisions of an episode at which the guard braked; None likewise.
    """

    conditions: str
    stack: str
    episodes: int
    success: Interval
    collisions: Interval | None
    time: Interval
    not_admitted: Interval | None
    guard_cuts: Interval | None


def stack_table(samples: Sequence[Sample], time_limit: float) -> list[StackLine]:
    """Return a line for each arm with a stack, grouped by conditions."""
    lines = [_line(one, time_limit) for one in samples if one.arm.stack]
    places = {line.conditions: place for place, line in reversed(list(enumerate(lines)))}
    return sorted(lines, key=lambda line: places[line.conditions])


def _line(sample: Sample, time_limit: float) -> StackLine:
    rows = sample.rows
    times = [row.duration if row.success else time_limit for row in rows]
    clusters = [cluster_of(row) for row in rows]
    return StackLine(
        conditions=name_of(replace(sample.arm, stack="")),
        stack=sample.arm.stack,
        episodes=len(rows),
        success=mean_interval(
            [float(row.success) for row in rows], clusters, METRICS["success"].support
        ),
        collisions=_interval(rows, "collisions"),
        time=mean_interval(times, clusters, TIME.within(time_limit)),
        not_admitted=_interval(rows, "not_admitted"),
        guard_cuts=_interval(rows, "guard_cuts"),
    )


def _interval(rows: Sequence[Row], metric: str) -> Interval | None:
    """Return the mean of a metric over the episodes that have it; None without any."""
    known = [(value, cluster_of(row)) for row in rows if (value := row.metrics[metric]) is not None]
    if not known:
        return None
    values, clusters = zip(*known, strict=True)
    return mean_interval(values, clusters, METRICS[metric].support)
