"""Page that compares two builds: what got better or worse, and which episodes changed sides."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.metrics import METRICS
from wayproof.harness.outputs import written_whole
from wayproof.harness.statistics.exact import CONFIDENCE, Interval
from wayproof.harness.study.analysis import Sample, paired_values
from wayproof.harness.study.compare import Compared
from wayproof.harness.study.plan import name_of
from wayproof.harness.study.report.page import Cell, Section
from wayproof.harness.study.report.report import SITE, result_page
from wayproof.harness.study.report.sections import gates_section
from wayproof.harness.study.report.words import heading, number, side_of, spread
from wayproof.harness.study.rows import Row, first_difference

SHOWN_METRICS = (
    *("success", "collisions", "least_clearance", "time_to_goal", "path_ratio", "time_stopped"),
    *("ate", "not_admitted", "latency_p50", "latency_p99", "deadline_misses"),
)


@dataclass(frozen=True)
class Change:
    """Mean of a metric in both builds, over the pairs in which both have it.

    Attributes:
        arm: Name of the arm.
        metric: Name of the metric.
        before: Mean of the first build.
        after: Mean of the second build.
        difference: Second less first, with its interval.
        side: `good` or `bad` where the whole interval lies on one side of 0; else empty.
    """

    arm: str
    metric: str
    before: float
    after: float
    difference: Interval
    side: str


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
    builds: list[list[Cell | str]] = [
        [name, Cell(str(folder), link=_site(folder, out, "index.html"))]
        for name, folder in (("before", before), ("after", after))
    ]
    sections = [
        Section("Builds", heads=("build", "folder"), rows=builds),
        gates_section(compared.result),
        Section(
            "Metrics",
            note="Means over the pairs in which both builds have the figure, and the difference of "
            "after less before. All intervals together hold at 95 % (Bonferroni). A difference is "
            "green where it is better and red where it is worse, if the whole interval lies on one "
            "side of 0; elsewhere no difference is shown.",
            heads=("arm", "metric", "before", "after", "difference"),
            rows=[
                [
                    one.arm,
                    heading(one.metric),
                    number(one.before, ".3f"),
                    number(one.after, ".3f"),
                    Cell(spread(one.difference, "+.3f"), one.side),
                ]
                for one in changes_of(compared.samples, compared.time_limit)
            ],
        ),
        Section(
            "Episodes with another outcome",
            heads=("episode", "seed", "before", "after", "cause", "first differing decision"),
            rows=flips_of(compared.samples, before, after, out) or [["none", *[""] * 5]],
        ),
    ]
    page = result_page(compared.result, sections, "Build against build")
    with written_whole(out, "page") as partial:
        partial.write_text(page.html(), encoding="utf-8")


def changes_of(samples: Sequence[Sample], time_limit: float) -> list[Change]:
    """Return the changes of each arm; all intervals together hold at 95 % (Bonferroni)."""
    every = [
        (one.arm, name, paired_values(one.pairs, name, time_limit))
        for one in samples
        for name in SHOWN_METRICS
    ]
    known = [(arm, name, values) for arm, name, values in every if values.second]
    confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(known), 1)
    changes = []
    for arm, name, values in known:
        interval = values.interval(confidence)
        assert interval is not None
        assert values.first is not None
        count = len(values.second)
        changes.append(
            Change(
                arm=name_of(arm),
                metric=name,
                before=sum(values.first) / count,
                after=sum(values.second) / count,
                difference=interval,
                side=side_of(interval, METRICS[name].higher_is_better),
            )
        )
    return changes


def flips_of(
    samples: Sequence[Sample], before: Path, after: Path, out: Path
) -> list[list[Cell | str]]:
    """Return a row for each episode of another outcome, the lost ones first, with links."""
    pairs = [pair for one in samples for pair in one.pairs if pair[0].outcome != pair[1].outcome]
    pairs.sort(key=lambda pair: ("bad", "", "good").index(_side(*pair)))
    rows: list[list[Cell | str]] = []
    for first, second in pairs:
        rows.append(
            [
                name_of(second.arm),
                str(second.seed),
                Cell(first.outcome, link=_site(before, out, f"episodes/{first.key}.html")),
                Cell(
                    second.outcome,
                    _side(first, second),
                    link=_site(after, out, f"episodes/{second.key}.html"),
                ),
                second.cause or first.cause,
                number(first_difference(second, first), "d"),
            ]
        )
    return rows


def _side(first: Row, second: Row) -> str:
    """Return `good` or `bad` where one of the two builds succeeded."""
    if first.success == second.success:
        return ""
    return "good" if second.success else "bad"


def _site(folder: Path, out: Path, name: str) -> str:
    """Return the link from a page to one of a folder's site; empty if it has none."""
    page = folder / SITE / name
    return os.path.relpath(page, out.parent) if page.is_file() else ""
