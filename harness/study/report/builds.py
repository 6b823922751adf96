"""Page that compares two builds: what got better or worse, and which episodes changed sides."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.metrics import METRICS
from wayproof.harness.outputs import written_whole
from wayproof.harness.statistics.exact import CONFIDENCE, Interval
from wayproof.harness.statistics.intervals import difference_interval
from wayproof.harness.study.analysis import Pairs, Sample, cluster_of
from wayproof.harness.study.compare import Compared
from wayproof.harness.study.gates import interval_in_words
from wayproof.harness.study.plan import Arm, name_of
from wayproof.harness.study.report.report import SITE
from wayproof.harness.study.report.templates import templates
from wayproof.harness.study.report.words import (
    gate_reason,
    heading,
    side_of_difference,
    side_of_drop,
)
from wayproof.harness.study.rows import Row, first_difference
from wayproof.harness.study.study import verdict_in_words

SHOWN_METRICS = (
    "success",
    "collisions",
    "least_clearance",
    "time_to_goal",
    "path_ratio",
    "time_stopped",
    "ate",
    "not_admitted",
    "latency_p50",
    "latency_p99",
    "deadline_misses",
)


@dataclass(frozen=True)
class Change:
    """Mean of a metric in both builds, over the pairs in which both have it.

    Attributes:
        metric: Name of the metric.
        before: Mean of the first build.
        after: Mean of the second build.
        difference: Second less first, with its interval.
        side: `good` or `bad` where the whole interval lies on one side of 0; else empty.
    """

    metric: str
    before: float
    after: float
    difference: Interval
    side: str


@dataclass(frozen=True)
class Flip:
    """An episode whose outcome differs between the builds, with links to its pages."""

    arm: Arm
    seed: int
    before: Row
    after: Row
    differs: int | None
    page_before: str
    page_after: str

    @property
    def side(self) -> str:
        """Return `good` or `bad` where one of the two succeeded."""
        if self.before.success == self.after.success:
            return ""
        return "good" if self.after.success else "bad"


def write_comparison(compared: Compared, before: Path, after: Path, out: Path) -> None:
    """Write the page.

    Args:
        compared: Comparison of two folders.
        before: Folder of the first build.
        after: Folder of the second build.
        out: HTML file.

    Raises:
        InputError: The file cannot be written.
    """
    page = (
        templates()
        .get_template("builds.html.j2")
        .render(
            site=False,
            result=compared.result,
            verdict=verdict_in_words(compared.result),
            before=_site(before, out, "index.html"),
            after=_site(after, out, "index.html"),
            folders=(str(before), str(after)),
            changes=_changes(compared.samples, compared.time_limit),
            flips=_flips(compared.samples, before, after, out),
            interval=interval_in_words,
            reason=gate_reason,
            side=side_of_drop,
            heading=heading,
            name_of=name_of,
        )
    )
    with written_whole(out, "page") as partial:
        partial.write_text(page, encoding="utf-8")


def _changes(samples: Sequence[Sample], time_limit: float) -> list[tuple[str, list[Change]]]:
    """Return the changes of each arm; all intervals together hold at 95 % (Bonferroni)."""
    known = [(one, name) for one in samples for name in SHOWN_METRICS if _both(one.pairs, name)]
    confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(known), 1)
    by_arm: dict[str, list[Change]] = {}
    for one, name in known:
        change = _change(one.pairs, name, confidence, time_limit)
        by_arm.setdefault(name_of(one.arm), []).append(change)
    return list(by_arm.items())


def _both(pairs: Pairs, metric: str) -> list[tuple[float, float, tuple[str, int]]]:
    found = [(a.metrics[metric], b.metrics[metric], cluster_of(b)) for a, b in pairs]
    return [(a, b, c) for a, b, c in found if a is not None and b is not None]


def _change(pairs: Pairs, metric: str, confidence: float, time_limit: float) -> Change:
    first, second, clusters = (list(one) for one in zip(*_both(pairs, metric), strict=True))
    support = METRICS[metric].support.within(time_limit)
    interval = difference_interval(first, second, clusters, support, confidence)
    return Change(
        metric=metric,
        before=sum(first) / len(first),
        after=sum(second) / len(second),
        difference=interval,
        side=side_of_difference(metric, interval),
    )


def _flips(samples: Sequence[Sample], before: Path, after: Path, out: Path) -> list[Flip]:
    flips = []
    for sample in samples:
        for first, second in sample.pairs:
            if first.outcome != second.outcome:
                flips.append(
                    Flip(
                        arm=sample.arm,
                        seed=second.seed,
                        before=first,
                        after=second,
                        differs=first_difference(second, first),
                        page_before=_site(before, out, f"episodes/{first.key}.html"),
                        page_after=_site(after, out, f"episodes/{second.key}.html"),
                    )
                )
    return sorted(flips, key=lambda one: ("bad", "", "good").index(one.side))


def _site(folder: Path, out: Path, name: str) -> str:
    """Return the link from a page to one of a folder's site; empty if it has none."""
    page = folder / SITE / name
    return os.path.relpath(page, out.parent) if page.is_file() else ""
