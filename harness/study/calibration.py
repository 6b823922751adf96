"""Calibration of a setting: the smallest value that keeps collisions rare, and its cost.

The study has one axis of rising numbers, by default margins for localization.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scipy.optimize import isotonic_regression

from wayproof.harness.statistics.exact import Interval, clopper_pearson, restricted_mean
from wayproof.harness.statistics.intervals import difference_interval
from wayproof.harness.statistics.support import RATE, TIME
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.gates import interval_in_words
from wayproof.harness.study.plan import Arm, variants_of
from wayproof.harness.study.rows import Row


@dataclass(frozen=True)
class Rung:
    """Results of one value.

    Attributes:
        value: The value.
        episodes: Number of episodes.
        collided: Share of episodes with a collision or in error, with its exact interval.
        monotone: Share of these episodes, fitted so that it falls with the value.
        success: Share of episodes that reached the goal, with its exact interval.
        time: Restricted mean time to the goal, s.
        success_price: Success rate minus that of the smallest value, by pairs of one seed.
        time_price: Restricted time to the goal minus that of the smallest value, by pairs, s.
    """

    value: float
    episodes: int
    collided: Interval
    monotone: float
    success: Interval
    time: float
    success_price: Interval
    time_price: Interval

    def in_words(self) -> str:
        """Return the results in a line."""
        return (
            f"{self.value:g}: {self.episodes} episodes, collided "
            f"{interval_in_words(self.collided, '.2f')}, fitted {self.monotone:.2f}, success "
            f"{interval_in_words(self.success, '.2f')}, {self.time:.1f} s; price "
            f"{interval_in_words(self.success_price, '+.2f')} of success, "
            f"{interval_in_words(self.time_price, '+.1f')} s"
        )


@dataclass(frozen=True)
class Calibration:
    """The calibrated setting of one world, robot and stack, and its evidence.

    Attributes:
        arm: World, robot and stack.
        setting: Name of the setting.
        bound: Share of episodes that may collide.
        value: Smallest value whose fitted collision rate keeps the bound; None without one.
        low: Smallest value that is not shown to break the bound; None without one.
        high: Smallest value from which on all are shown to keep it; None without one.
        seeds_to_show: Number of episodes without a collision that would show the bound.
        rungs: Results of each value, from the smallest.
    """

    arm: Arm
    setting: str
    bound: float
    value: float | None
    low: float | None
    high: float | None
    seeds_to_show: int
    rungs: list[Rung]

    @property
    def exit_code(self) -> int:
        """1 if no value keeps the bound, else 0."""
        return int(self.value is None)

    def in_words(self) -> str:
        """Return the smallest value with its ends, then each value, in lines."""
        smallest = "none that was tried" if self.value is None else f"{self.value:g}"
        high = "none tried is shown to" if self.high is None else f"{self.high:g}"
        low = "every one tried is shown to break it" if self.low is None else f"{self.low:g}"
        answer = (
            f"smallest {self.setting} that keeps collisions at {self.bound:g}: {smallest} (not "
            f"shown to break it from: {low}; shown to keep it from: {high}; {self.seeds_to_show} "
            "seeds without a collision would show it)"
        )
        return "\n".join([answer, *(one.in_words() for one in self.rungs)])


def calibrations_of(study: StudyFile, rows: Sequence[Row], limit: float) -> list[Calibration]:
    """Derive the setting for each world, robot and stack in which every value has run.

    Args:
        study: The study, of one axis.
        rows: Its episodes.
        limit: Time limit of an episode, s.
    """
    [(setting, tried)] = study.axes.items()
    values = [value for value in tried if isinstance(value, int | float)]
    places = {" ".join(variant): place for place, variant in enumerate(variants_of(study))}
    by_arm: dict[Arm, list[list[Row]]] = {}
    for row in (one for one in rows if one.ran):
        ladder = by_arm.setdefault(replace(row.arm, variant=""), [[] for _ in values])
        ladder[places[row.arm.variant]].append(row)
    return [
        calibration_of(arm, setting, values, ladder, limit, study.calibrate.bound)
        for arm, ladder in by_arm.items()
        if all(len(some) == len(ladder[0]) for some in ladder)
    ]


def calibration_of(
    arm: Arm,
    setting: str,
    values: Sequence[float],
    rows: Sequence[Sequence[Row]],
    limit: float,
    bound: float,
) -> Calibration:
    """Derive the setting from the episodes of each value, smallest first, seeds in one order.

    The collision rate is assumed to fall with the value, so that isotonic regression fits the rates
    (Barlow et al. 1972). The ends come from the interval of each value (Clopper and Pearson 1934):
    every value below `low` is shown to break the bound, every one from `high` to keep it.
    """
    sizes = [len(some) for some in rows]
    counts = [sum(map(_collided, some)) for some in rows]
    collided = [clopper_pearson(*one) for one in zip(counts, sizes, strict=True)]
    rates = [one.estimate for one in collided]
    fitted = isotonic_regression(rates, weights=sizes, increasing=False).x.tolist()
    rungs = [
        _rung(value, rows=some, first=rows[0], collided=interval, monotone=rate, limit=limit)
        for value, some, interval, rate in zip(values, rows, collided, fitted, strict=True)
    ]
    kept = [one.collided.high <= bound for one in rungs]
    return Calibration(
        arm=arm,
        setting=setting,
        bound=bound,
        value=next((one.value for one in rungs if one.monotone <= bound), None),
        low=next((one.value for one in rungs if one.collided.low <= bound), None),
        high=next((one.value for k, one in enumerate(rungs) if all(kept[k:])), None),
        seeds_to_show=math.ceil(math.log(0.025) / math.log1p(-bound)),
        rungs=rungs,
    )


def _collided(row: Row) -> bool:
    """Return whether an episode collided, or is in error and may have."""
    return row.outcome == "error" or bool(row.metrics["collisions"])


def _rung(
    value: float,
    rows: Sequence[Row],
    first: Sequence[Row],
    collided: Interval,
    monotone: float,
    limit: float,
) -> Rung:
    reached, reference = ([float(row.success) for row in some] for some in (rows, first))
    times, usual = (
        [min(row.duration, limit) if row.success else limit for row in some]
        for some in (rows, first)
    )
    seeds = [row.seed for row in rows]
    return Rung(
        value=value,
        episodes=len(rows),
        collided=collided,
        monotone=monotone,
        success=clopper_pearson(int(sum(reached)), len(rows)),
        time=restricted_mean([row.duration for row in rows], reached, limit),
        success_price=difference_interval(reference, reached, seeds, RATE),
        time_price=difference_interval(usual, times, seeds, TIME.within(limit)),
    )
