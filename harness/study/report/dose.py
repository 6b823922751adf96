"""Dose and response: success, clearance and time over the amount of a perturbation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.statistics.intervals import mean_interval
from wayproof.harness.statistics.support import TIME
from wayproof.harness.study.analysis import Sample, cluster_of
from wayproof.harness.study.plan import CLEAN, Arm, name_of, perturbation_at
from wayproof.harness.study.report.plots import Curve, dose_response
from wayproof.harness.study.rows import Row


@dataclass(frozen=True)
class Dose:
    """Plots of one perturbation on one world, robot and variant, with a curve for each stack."""

    title: str
    pictures: list[str]


def doses_of(samples: Sequence[Sample], time_limit: float) -> list[Dose]:
    """Return the plots of each perturbation, from its unperturbed twin on."""
    clean = {one.arm: one for one in samples if one.arm.perturbation == CLEAN}
    families: dict[Arm, dict[str, list[Sample]]] = {}
    for one in samples:
        if one.arm.perturbation != CLEAN:
            family = families.setdefault(replace(one.arm, severity=0, stack=""), {})
            family.setdefault(one.arm.stack, []).append(one)
    doses = []
    for arm, stacks in families.items():
        shown = {}
        for stack, members in stacks.items():
            twin = clean.get(replace(arm, perturbation=CLEAN, stack=stack))
            every = [*([twin] if twin else []), *members]
            shown[stack] = sorted(every, key=lambda one: one.arm.severity)
        doses.append(Dose(name_of(arm), _pictures(arm, shown, time_limit)))
    return doses


def _pictures(arm: Arm, shown: Mapping[str, Sequence[Sample]], time_limit: float) -> list[str]:
    done = perturbation_at(arm.perturbation, 1.0)
    unit = f", {done.unit}" if done is not None and done.unit else ""
    label = f"{arm.perturbation}{unit}; severity below"
    panels: tuple[tuple[str, Callable[[Sequence[Row]], Interval | None], float | None], ...] = (
        ("success", lambda rows: _metric(rows, "success"), 1.0),
        ("least clearance, m", lambda rows: _metric(rows, "least_clearance"), None),
        ("time to the goal, s", lambda rows: _time(rows, time_limit), None),
    )
    doses = {
        stack: [(one.arm.severity, _amount(arm, one.arm.severity)) for one in some]
        for stack, some in shown.items()
    }
    return [
        dose_response(
            [
                Curve(stack, doses[stack], [mean(one.rows) for one in some])
                for stack, some in shown.items()
            ],
            label=label,
            ylabel=name,
            top=top,
        )
        for name, mean, top in panels
    ]


def _amount(arm: Arm, severity: float) -> float:
    """Return the amount of a severity; at 0 the one that changes nothing."""
    done = perturbation_at(arm.perturbation, severity)
    if done is not None:
        return done.amount
    one = perturbation_at(arm.perturbation, 1.0)
    return one.nothing if one is not None else 0.0


def _metric(rows: Sequence[Row], metric: str) -> Interval | None:
    known = [(row, value) for row in rows if (value := row.metrics[metric]) is not None]
    if not known:
        return None
    numbers, clusters = [value for _, value in known], [cluster_of(row) for row, _ in known]
    return mean_interval(numbers, clusters, METRICS[metric].support)


def _time(rows: Sequence[Row], time_limit: float) -> Interval | None:
    times = [row.duration if row.success else time_limit for row in rows]
    return mean_interval(times, [cluster_of(row) for row in rows], TIME.within(time_limit))
