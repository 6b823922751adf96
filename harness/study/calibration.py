"""Calibration of the localization margin: the smallest that keeps collisions rare, and its cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import isotonic_regression

from wayproof.harness.errors import InputError
from wayproof.harness.perturbations.pose_drift import PoseDrift
from wayproof.harness.statistics.exact import Interval, clopper_pearson, restricted_mean
from wayproof.harness.statistics.intervals import difference_interval
from wayproof.harness.statistics.support import RATE, TIME
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.rows import Row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, error_in_words, read_rows, run_study

SETTING = "costmap.localization_margin"

MARGINS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
"""Margins tried by default, m: from a fifth of the default margin to three times it."""


@dataclass(frozen=True)
class Rung:
    """Results of one margin.

    Attributes:
        margin: The margin, m.
        episodes: Number of episodes.
        collided: Share of episodes with a collision or in error, with its exact interval.
        monotone: Share of these episodes, fitted so that it falls with the margin.
        success: Share of episodes that reached the goal, with its exact interval.
        time: Restricted mean time to the goal, s.
        success_price: Success rate minus that of the smallest margin, by pairs of one seed.
        time_price: Restricted time to the goal minus that of the smallest margin, by pairs, s.
    """

    margin: float
    episodes: int
    collided: Interval
    monotone: float
    success: Interval
    time: float
    success_price: Interval
    time_price: Interval


@dataclass(frozen=True)
class MarginResult:
    """The calibrated margin and its evidence.

    Attributes:
        drift: Drift of the pose estimate, m/m.
        bound: Share of episodes that may collide.
        margin: Smallest margin whose fitted collision rate keeps the bound, m; None without one.
        low: Smallest margin that is not shown to break the bound, m; None without one.
        high: Smallest margin from which on all are shown to keep it, m; None without one.
        seeds_to_show: Number of episodes without a collision that would show the bound.
        rungs: Results of each margin, from the smallest.
        errors: Number of episodes that failed to run, which count as collided.
        first_error: Error text of the first of these; empty without any.
    """

    drift: float
    bound: float
    margin: float | None
    low: float | None
    high: float | None
    seeds_to_show: int
    rungs: list[Rung]
    errors: int
    first_error: str


def margin_study(
    world: str,
    robot: str,
    seeds: int,
    drift: float,
    margins: Sequence[float],
    settings: dict[str, Any],
) -> StudyFile:
    """Return the study that runs every seed with every margin under the same drift.

    Raises:
        InputError: There are fewer than two margins or seeds, or the drift is beyond the scale.
    """
    tried = sorted(set(margins))
    if len(tried) < 2 or seeds < 2:
        raise InputError(f"got {len(tried)} margins and {seeds} seeds, expected at least 2 of each")
    document = dict(settings)
    if drift:
        try:
            severity = PoseDrift.severity_of(drift)
        except ValueError as error:
            raise InputError(f"--drift: {error} m/m") from None
        document["perturbation"] = {"kind": "pose_drift", "severity": severity}
    return StudyFile(
        name=f"margin-{Path(world).stem}-{Path(robot).stem}",
        worlds=[world],
        robots=[robot],
        seeds=seeds,
        settings=document,
        axes={SETTING: tried},
    )


def calibrate_margin(
    study: StudyFile, drift: float, bound: float, store: Store, engine: Engine, finished: Finished
) -> MarginResult:
    """Run the missing episodes of the study, and derive the margin from the collisions.

    Raises:
        InputError: The bound is not between 0 and 1, or the study cannot be run.
    """
    if not 0.0 < bound < 1.0:
        raise InputError(f"--bound {bound:g}: expected more than 0 and less than 1")
    planned = plan_episodes(study)
    run_study(study, planned, store, engine, finished)
    rows = read_rows(planned, store, allow_plugins=True)
    limit = max(one.config.episode.time_limit for one in planned)
    variants = list(dict.fromkeys(one.arm.variant for one in planned))
    by_margin = [[row for row in rows if row.arm.variant == variant] for variant in variants]
    return margin_from(study.axes[SETTING], rows=by_margin, limit=limit, drift=drift, bound=bound)


def margin_from(
    margins: Sequence[float],
    rows: Sequence[Sequence[Row]],
    limit: float,
    drift: float,
    bound: float,
) -> MarginResult:
    """Derive the margin from the episodes of each margin, smallest first, seeds in one order.

    The collision rate is assumed to fall with the margin, so that isotonic regression fits the
    rates (Barlow et al. 1972). The ends come from the interval of each margin (Clopper and Pearson
    1934): every margin below `low` is shown to break the bound, every one from `high` to keep it.
    """
    counts = [sum(_collided(row) for row in some) for some in rows]
    sizes = [len(some) for some in rows]
    collided = [clopper_pearson(*one) for one in zip(counts, sizes, strict=True)]
    rates = [one.estimate for one in collided]
    fitted = isotonic_regression(rates, weights=sizes, increasing=False).x.tolist()
    rungs = [
        _rung(margin, rows=some, first=rows[0], collided=interval, monotone=rate, limit=limit)
        for margin, some, interval, rate in zip(margins, rows, collided, fitted, strict=True)
    ]
    errors = [row for some in rows for row in some if not row.ran]
    kept = [one.collided.high <= bound for one in rungs]
    return MarginResult(
        drift=drift,
        bound=bound,
        margin=next((one.margin for one in rungs if one.monotone <= bound), None),
        low=next((one.margin for one in rungs if one.collided.low <= bound), None),
        high=next((one.margin for k, one in enumerate(rungs) if all(kept[k:])), None),
        seeds_to_show=int(np.ceil(np.log(0.025) / np.log1p(-bound))),
        rungs=rungs,
        errors=len(errors),
        first_error=error_in_words(errors[0]) if errors else "",
    )


def _collided(row: Row) -> bool:
    """Return whether an episode collided, or is in error and may have."""
    return row.outcome == "error" or bool(row.metrics["collisions"])


def _rung(
    margin: float,
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
    clusters = [row.seed for row in rows]
    return Rung(
        margin=margin,
        episodes=len(rows),
        collided=collided,
        monotone=monotone,
        success=clopper_pearson(int(sum(reached)), len(rows)),
        time=restricted_mean([row.duration for row in rows], reached, limit),
        success_price=difference_interval(reference, reached, clusters, RATE),
        time_price=difference_interval(usual, times, clusters, TIME.within(limit)),
    )
