"""Pages of single episodes, each beside its twin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.plan import Planned, name_of
from wayproof.harness.study.report.page import Cell, Figure, Legend, Page, Section
from wayproof.harness.study.report.palette import (
    BELIEVED,
    CHANCE,
    GOAL,
    LABEL,
    LIMIT,
    OBSTACLE,
    TRUE,
    action_colour,
)
from wayproof.harness.study.report.provenance import log_commands, of_episode
from wayproof.harness.study.report.view import (
    View,
    actions_strip,
    charts_of,
    map_picture,
    read_view,
)
from wayproof.harness.study.report.words import heading, number
from wayproof.harness.study.rows import Row, first_difference
from wayproof.harness.study.store import Store

MAP_LEGEND = (
    (BELIEVED, "believed track"),
    (TRUE, "true track (dashed) and start"),
    (GOAL, "goal"),
    (LIMIT, "end of a failure"),
    (CHANCE, "last chance"),
    (OBSTACLE, "true obstacles"),
)
"""Colours and names of what `map_picture` draws."""

WALL_TIME = ("latency_p50", "latency_p99", "latency_max")
"""Metrics whose difference in one pair is mostly the machine's, so that it is not coloured."""

KEPT = 16
"""Number of episodes whose views are kept, for twins are next to each other."""


@dataclass
class Views:
    """Views of logs by key, the last ones kept.

    Attributes:
        store: Folder of the study.
        allow_plugins: Whether code that a log's config names may be imported.
    """

    store: Store
    allow_plugins: bool
    _kept: dict[str, View | None] = field(default_factory=dict)

    def of(self, row: Row) -> View | None:
        """Return the view of an episode; None without a log.

        Raises:
            InputError: The log is damaged.
        """
        if row.key not in self._kept:
            path = self.store.log(row.key)
            view = read_view(path, self.allow_plugins) if row.chain and path.is_file() else None
            self._kept[row.key] = view
            if len(self._kept) > KEPT:
                self._kept.pop(next(iter(self._kept)))
        return self._kept[row.key]


def title_of(row: Row) -> str:
    """Return the name of an episode."""
    return f"{name_of(row.arm)}, seed {row.seed}"


def episode_page(
    study: str,
    row: Row,
    twin: Row | None,
    planned: Planned,
    views: Views,
    neighbours: tuple[str, str],
) -> Page:
    """Return an episode's page.

    Args:
        study: Name of the study.
        row: The episode.
        twin: Its reference; None without one.
        planned: Its config.
        views: Views of logs.
        neighbours: Keys of the episodes before and after it; empty without one.
    """
    links = [(study, "../index.html"), ("All episodes", "../episodes.html")]
    named = {"previous": neighbours[0], "next": neighbours[1], "its twin": twin.key if twin else ""}
    links += [(text, f"{key}.html") for text, key in named.items() if key]
    view, other = views.of(row), None if twin is None else views.of(twin)
    commands, terms = [], []
    if view is not None:
        log = views.store.log(row.key)
        commands = log_commands(log, planned, not row.success, view.chance)
        terms = of_episode(view.log)
    return Page(
        title_of(row),
        verdict="held" if row.success else "failed",
        outcome=row.outcome,
        lines=_first_lines(row, twin, view),
        links=links,
        sections=[
            *([] if view is None else _pictures(view, other)),
            metrics_section(row.metrics, None if twin is None else twin.metrics),
            Section(
                "Commands",
                note="They work in the folder in which this report was written.",
                code=commands,
            ),
            Section("Provenance", terms=terms),
        ],
    )


def _first_lines(row: Row, twin: Row | None, view: View | None) -> list[str]:
    lines = [row.reason]
    if row.cause:
        evidence = "" if view is None else view.log.result.get("cause_evidence", "")
        check = (
            f"Its check by simulation: {row.check}."
            if row.check
            else ("Not checked by simulation; 'wayproof explain --check' does.")
        )
        lines.append(f"Cause: {row.cause}{': ' if evidence else ''}{evidence}. {check}")
    if view is not None and (chance := view.chance) is not None:
        lines.append(
            f"Last chance: decision {chance} at {view.times[chance]:.1f} s, "
            f"{view.decisions[chance].action}: {view.decisions[chance].reason}"
        )
    if twin is not None and view is not None:
        differs = first_difference(row, twin)
        alike = "every decision is the same" if differs is None else f"alike up to {differs}"
        lines.append(
            f"Left or first: this episode. Right or second: its twin, {title_of(twin)}: "
            f"{twin.outcome}; decisions: {alike}."
        )
    return lines


def _pictures(view: View, other: View | None) -> list[Section]:
    both = [("", view), *([(": the twin", other)] if other is not None else [])]
    maps = [
        Figure(f"From above{of}", legend=MAP_LEGEND, pictures=[map_picture(one)], kind="map")
        for of, one in both
    ]
    strips = [Figure(pictures=[actions_strip(one)], kind="strip") for _, one in both]
    return [
        Section(figures=maps, layout="pair"),
        Section(
            "Actions and failure labels",
            legend=_action_legend(view),
            figures=strips,
            layout="pair",
        ),
        Section("Over time", figures=charts_of(view), layout="pair"),
    ]


def _action_legend(view: View) -> Legend:
    actions = [one.action for one in view.decisions]
    shown = [(action_colour(name), name) for name in dict.fromkeys(actions)]
    if any(one.label not in ("", "none") for one in view.decisions):
        shown.append((LABEL, "failure label (lower bar)"))
    if any(one.deadline_missed for one in view.decisions):
        shown.append(("#000000", "deadline missed (line)"))
    return shown


def metrics_section(
    metrics: Mapping[str, float | None], other: Mapping[str, float | None] | None
) -> Section:
    """Return every metric that an episode or its twin has, and their difference."""
    twins = dict.fromkeys(METRICS) if other is None else other
    rows: list[Sequence[Cell | str]] = []
    for name in METRICS:
        value, twin = metrics[name], twins[name]
        if value is None and twin is None:
            continue
        cells: list[Cell | str] = [heading(name), number(value, ".3f")]
        if other is not None:
            known = value is not None and twin is not None
            difference = value - twin if known else None  # type: ignore[operator]  # both known
            cells += [
                number(twin, ".3f"),
                Cell(number(difference, "+.3f"), _side(name, difference)),
            ]
        rows.append(cells)
    heads = ("metric", "value") if other is None else ("metric", "value", "twin", "difference")
    return Section("Metrics", heads=heads, rows=rows)


def _side(name: str, difference: float | None) -> str:
    better = METRICS[name].higher_is_better
    if name in WALL_TIME or better is None or not difference:
        return ""
    return "good" if (difference > 0.0) == better else "bad"
