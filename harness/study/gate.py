"""A gate: a bound on a figure of an arm, and what is bounded in its place."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, get_args

import numpy as np
from scipy import stats

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval, quantile_interval
from wayproof.harness.statistics.intervals import LEAST_CLUSTERS
from wayproof.harness.statistics.sequential import evidence, mean_sequence, median_sequence

if TYPE_CHECKING:
    from wayproof.harness.study.analysis import Values

Statistic = Literal["drop", "rise", "mean", "every"]

Figure = Literal["mean", "share with any", "median", "restricted mean", "worst"]
"""What is bounded: the mean of a rate or a share; the share of the episodes with any event; the
median; the mean of a time; a failure counts the time limit; the worst of the episodes."""


@dataclass(frozen=True)
class Gate:
    """A bound on a metric, judged once, over a number of worlds that is set beforehand.

    Attributes:
        text: Text of the gate.
        metric: Key of `METRICS`.
        statistic: `drop` and `rise` against the reference, by pairs; `mean` of each arm; `every`
            episode of each arm, which says nothing of other episodes and needs no interval.
        at_most: Whether the bound is an upper one.
        bound: Bound, in the unit of the metric.
        proven: Whether it must be held even with `--allow-inconclusive`.
    """

    text: str
    metric: str
    statistic: Statistic
    at_most: bool
    bound: float
    proven: bool

    sequential: ClassVar[bool] = False
    """Whether its interval holds at every look."""

    @property
    def figure(self) -> Figure:
        """What is bounded.

        The mean of counts and measures has no bound: an event or a jump too rare to be seen in any
        world may be of any size.
        """
        support = METRICS[self.metric].support
        if self.statistic == "every":
            return "worst"
        if support.timed:
            return "restricted mean"
        if support.kind == "count" and abs(self.bound) < 1.0:
            return "share with any"
        return "median" if support.kind in ("count", "measure") else "mean"

    def interval(self, values: Values, confidence: float) -> Interval | None:
        """Return the figure with its interval; None without a value."""
        if self.figure == "worst":
            return self._worst(values)
        if self.figure == "median" and values.second:
            return quantile_interval(values.of_worlds, confidence=confidence)
        return values.interval(confidence)

    def _worst(self, values: Values) -> Interval | None:
        if not values.second:
            return None
        worst = max(values.second) if self.at_most else min(values.second)
        return Interval(worst, worst, worst)

    def worlds_needed(self, values: Values, interval: Interval, tail: float) -> int | None:
        """Return about how many worlds would decide it at the same estimate; None at the bound.

        If all values are alike the interval ends at 1 - tail^(1/k) of the way to the support's end;
        elsewhere its width falls with the root of the number of worlds.

        Args:
            values: Values of the worlds so far.
            interval: Their interval.
            tail: Share of the samples that an end may miss.
        """
        gap = abs(self.bound - interval.estimate)
        if gap == 0.0:
            return None
        means, support = values.of_worlds, values.support
        more = max(LEAST_CLUSTERS, len(means) + 1)
        if self.figure == "median":
            return max(more, math.ceil(math.log2(1.0 / tail)))
        upper = self._upper_end_decides(interval)
        end = interval.high if upper else interval.low
        if np.ptp(means) > 0.0:
            return max(more, math.ceil(len(means) * (abs(end - interval.estimate) / gap) ** 2))
        whole = support if values.first is None else support.difference
        reach = abs((whole.high if upper else whole.low) - interval.estimate)
        if not gap < reach < math.inf:
            return more
        needed = math.log(tail) / math.log1p(-gap / reach)
        if values.first is not None and support.kind == "rate":  # by Newcombe's interval
            square = float(stats.norm.ppf(tail)) ** 2
            needed = max(needed, square * (1.0 - gap) / gap)
        return max(LEAST_CLUSTERS, math.ceil(needed))

    def keeps(self, interval: Interval) -> bool:
        """Return whether an estimate keeps the bound."""
        return interval.estimate <= self.bound if self.at_most else interval.estimate >= self.bound

    def _upper_end_decides(self, interval: Interval) -> bool:
        """Return whether more worlds decide it by bringing the upper end across the bound."""
        return interval.estimate < self.bound


class SequentialGate(Gate):
    """A gate that may be looked at after any world, and to which worlds may be added."""

    sequential = True

    def interval(self, values: Values, confidence: float) -> Interval | None:
        """Return the figure with an interval over all looks; None without a value."""
        if self.figure == "worst":
            return self._worst(values)
        if not values.second:
            return None
        if self.figure == "median":
            return median_sequence(values.of_worlds, confidence)
        return mean_sequence(values.of_worlds, *values.ends, confidence)

    def worlds_needed(self, values: Values, interval: Interval, tail: float) -> int | None:
        """Return about how many worlds would decide it if the evidence grew as it did."""
        if interval.estimate == self.bound:
            return None
        below = self._upper_end_decides(interval)
        if self.figure == "median":
            inside = self.bound - values.of_worlds if below else values.of_worlds - self.bound
            shares, middle = (inside >= 0.0).astype(np.float64), 0.5
        else:
            low, high = values.ends
            shares = (values.of_worlds - low) / (high - low)
            middle = (self.bound - low) / (high - low)
            if below:
                shares, middle = 1.0 - shares, 1.0 - middle
        grown = float(evidence(shares, middle)[-1]) if middle > 0.0 else 0.0
        gap = float(shares.mean()) - middle
        grown = max(grown, len(shares) * gap**2 / 2.0)  # at least as of values from end to end
        return math.ceil(len(shares) * math.log(1.0 / tail) / grown) if gap > 0.0 else None


def read_gate(text: str, kind: type[Gate] = Gate) -> Gate:
    """Parse `metric.statistic <= bound` or `>=`, optionally followed by `proven`.

    Raises:
        InputError: The text is not a gate.
    """
    form = r"\s*(\w+)\.(\w+)\s*(<=|>=)\s*([-+.\deE]+)\s*(proven)?\s*"
    match = re.fullmatch(form, text)
    statistics = get_args(Statistic)
    if match is None or match[2] not in statistics:
        raise InputError(
            f"gate '{text}': expected METRIC.STATISTIC <= BOUND, STATISTIC one of "
            f"{', '.join(statistics)}, as in 'success.drop <= 0.05'"
        )
    if match[1] not in METRICS:
        raise unknown_name(f"metric in gate '{text}'", match[1], METRICS)
    try:
        bound = float(match[4])
    except ValueError:
        bound = math.nan
    if not math.isfinite(bound):
        raise InputError(f"gate '{text}': got the bound '{match[4]}', expected a number")
    statistic: Statistic = match[2]  # type: ignore[assignment]  # one of them, as checked
    return kind(
        text.strip(),
        metric=match[1],
        statistic=statistic,
        at_most=match[3] == "<=",
        bound=bound,
        proven=match[5] is not None,
    )
