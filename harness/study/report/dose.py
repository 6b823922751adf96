"""Dose and response: success, clearance and time over the amount of a perturbation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.analysis import Sample, cluster_of
from wayproof.harness.study.file import CLEAN, Arm, name_of, perturbation_at
from wayproof.harness.study.report.plots import dose_response
from wayproof.harness.study.rows import Row
from wayproof.harness.study.statistics.exact import Interval
from wayproof.harness.study.statistics.intervals import mean_interval
from wayproof.harness.study.statistics.support import TIME


@dataclass(frozen=True)
class Dose:
    """Plots of one perturbation on one world, robot, stack and variant."""

    title: str
    pictures: list[str]


def doses_of(samples: Sequence[Sample], time_limit: float) -> list[Dose]:
    """Return the plots of each perturbation, from its unperturbed twin on."""
    clean = {one.arm: one for one in samples if one.arm.perturbation == CLEAN}
    families: dict[Arm, list[Sample]] = {}
    for one in samples:
        if one.arm.perturbation != CLEAN:
            families.setdefault(replace(one.arm, severity=0), []).append(one)
    doses = []
    for arm, members in families.items():
        twin = clean.get(replace(arm, perturbation=CLEAN))
        shown = sorted([*([twin] if twin else []), *members], key=lambda one: one.arm.severity)
        doses.append(Dose(name_of(arm), _pictures(arm, shown, time_limit)))
    return doses


def _pictures(arm: Arm, shown: Sequence[Sample], time_limit: float) -> list[str]:
    doses = [(one.arm.severity, _amount(arm, one.arm.severity)) for one in shown]
    done = perturbation_at(arm.perturbation, 1.0)
    unit = f", {done.unit}" if done is not None and done.unit else ""
    label = f"{arm.perturbation}{unit}; severity below"
    success = [
        _mean([(row, row.metrics["success"]) for row in one.rows], "success") for one in shown
    ]
    clearance = [
        _mean([(row, row.metrics["least_clearance"]) for row in one.rows], "least_clearance")
        for one in shown
    ]
    time = [_time(one.rows, time_limit) for one in shown]
    panels = (
        ("success", success, 1.0),
        ("least clearance, m", clearance, None),
        ("time to the goal, s", time, None),
    )
    return [
        dose_response(doses, intervals, label=label, ylabel=name, top=top)
        for name, intervals, top in panels
    ]


def _amount(arm: Arm, severity: float) -> float:
    """Return the amount of a severity; at 0 the one that changes nothing."""
    done = perturbation_at(arm.perturbation, severity)
    if done is not None:
        return done.amount
    one = perturbation_at(arm.perturbation, 1.0)
    return one.nothing if one is not None else 0.0


def _mean(values: Sequence[tuple[Row, float | None]], metric: str) -> Interval | None:
    known = [(value, cluster_of(row)) for row, value in values if value is not None]
    if not known:
        return None
    numbers, clusters = zip(*known, strict=True)
    return mean_interval(numbers, clusters, METRICS[metric].support)


def _time(rows: Sequence[Row], time_limit: float) -> Interval | None:
    times = [row.duration if row.success else time_limit for row in rows]
    return mean_interval(times, [cluster_of(row) for row in rows], TIME.within(time_limit))
