"""Paired differences of all figures, by how surely they are worse: graded harm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import holm, mcnemar
from wayproof.harness.study.analysis import Pairs, Sample, Values, paired_values
from wayproof.harness.study.plan import Arm, name_of

HARM = (
    *("success", "collisions", "least_clearance", "not_admitted", "time_to_goal"),
    *("time_stopped", "jerk"),
)
"""Figures of harm: their p-values are corrected together, so that few worlds can show them."""

FURTHER = ("path_ratio", "stops", "ate", "deadline_misses")
"""Further figures, corrected together for themselves; wall times depend on who else is busy."""

SHOWN = 0.05
"""P-value up to which a difference is shown."""


@dataclass(frozen=True)
class Change:
    """One figure in both episodes of each pair of an arm.

    Attributes:
        arm: The arm.
        metric: Name of the figure.
        before: Mean of the first episodes.
        after: Mean of the second episodes.
        difference: Median over worlds of second less first.
        worse: Number of worlds in which the second is worse.
        worlds: Number of worlds.
        p_value: Two-sided, after Holm's correction over all arms and figures of its family. Of a
            success McNemar's exact test; of any other figure Wilcoxon's signed ranks of the
            worlds (Wilcoxon 1945), which bound no size of a rare jump and need no distribution.
        side: `bad` or `good` if a difference is shown and its mean or median is of a size that
            matters; else empty.
    """

    arm: Arm
    metric: str
    before: float
    after: float
    difference: float
    worse: int
    worlds: int
    p_value: float
    side: str = ""

    def in_words(self) -> str:
        """Return the change in a line."""
        unit = METRICS[self.metric].unit
        unit = f" {unit}" if unit else ""
        name = self.metric.replace("_", " ")
        return (
            f"{name} {self.before:.3g} -> {self.after:.3g}{unit} for {name_of(self.arm)}: worse in "
            f"{self.worse} of {self.worlds} worlds, p {self.p_value:.3f}"
        )


def changes_of(samples: Sequence[Sample], time_limit: float) -> list[Change]:
    """Return the changes of each compared arm: those that are surely worse first.

    Args:
        samples: The arms.
        time_limit: Time limit of an episode, s, the greatest value of a time. A pair in which one
            failed has no time to the goal: its loss shows in success.
    """
    changes = [one for names in (HARM, FURTHER) for one in _corrected(names, samples, time_limit)]
    order = {"bad": 0, "good": 1, "": 2}
    return sorted(changes, key=lambda one: (order[one.side], one.p_value))


def _corrected(names: Sequence[str], samples: Sequence[Sample], time_limit: float) -> list[Change]:
    found = [
        change
        for sample in samples
        for name in names
        if (change := _change(sample.arm, name, sample.pairs, time_limit)) is not None
    ]
    adjusted = holm([one.p_value for one in found])
    return [_sided(replace(one, p_value=p)) for one, p in zip(found, adjusted, strict=True)]


def _change(arm: Arm, name: str, pairs: Pairs, time_limit: float) -> Change | None:
    """Return the change of a figure; None if no pair has it in both episodes."""
    ran = [(first, second) for first, second in pairs if first.ran and second.ran]
    values = paired_values(ran, name, time_limit)
    if not values.second or values.first is None:
        return None
    differences = values.of_worlds
    better = METRICS[name].higher_is_better
    return Change(
        arm=arm,
        metric=name,
        before=float(np.mean(values.first)),
        after=float(np.mean(values.second)),
        difference=float(np.median(differences)),
        worse=int(np.sum(differences < 0.0 if better else differences > 0.0)),
        worlds=len(differences),
        p_value=_p_value(values),
    )


def _p_value(values: Values) -> float:
    """Return the two-sided p that the differences of the worlds lie about 0."""
    differences = values.of_worlds
    if values.support.kind == "rate" and np.isin(differences, (-1.0, 0.0, 1.0)).all():
        return mcnemar(int(np.sum(differences < 0.0)), int(np.sum(differences > 0.0)))
    moved = differences[differences != 0.0]
    return float(stats.wilcoxon(moved).pvalue) if len(moved) else 1.0


def _sided(change: Change) -> Change:
    """Return a change with its side."""
    metric = METRICS[change.metric]
    mean = change.after - change.before
    size = max(abs(mean), abs(change.difference))
    if metric.higher_is_better is None or change.p_value > SHOWN or size < metric.matters:
        return change
    grown = mean if mean * change.difference <= 0.0 else change.difference
    return replace(change, side="good" if (grown > 0.0) == metric.higher_is_better else "bad")
