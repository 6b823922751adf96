"""Pages of single episodes, and their entries in the overview."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.plan import Planned, name_of
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
from wayproof.harness.study.rows import Row, first_difference
from wayproof.harness.study.store import Store

MAP_LEGEND = [
    (BELIEVED, "believed track"),
    (TRUE, "true track (dashed) and start"),
    (GOAL, "goal"),
    (LIMIT, "end of a failure"),
    (CHANCE, "last chance"),
    (OBSTACLE, "true obstacles"),
]
"""Colours and names of what `map_picture` draws."""

WALL_TIME = ("latency_p50", "latency_p99", "latency_max")
"""Metrics whose difference in one pair is mostly the machine's, so that it is not coloured."""

KEPT = 16
"""Number of episodes whose views are kept, for twins are next to each other."""


@dataclass(frozen=True)
class Fact:
    """A metric of an episode beside that of its twin.

    Attributes:
        name: Name of the metric.
        unit: Its unit.
        value: Value; None if the episode has none.
        other: Value of the twin.
        side: `good` or `bad` where the difference has a better side; else empty.
    """

    name: str
    unit: str
    value: float | None
    other: float | None
    side: str

    @property
    def difference(self) -> float | None:
        """Return the value less the twin's."""
        return None if self.value is None or self.other is None else self.value - self.other


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


def episode_context(
    row: Row, twin: Row | None, planned: Planned, views: Views, neighbours: tuple[str, str]
) -> dict[str, Any]:
    """Return the content of an episode's page.

    Args:
        row: The episode.
        twin: Its reference; None without one.
        planned: Its config.
        views: Views of logs.
        neighbours: Keys of the episodes before and after it; empty without one.
    """
    view = views.of(row)
    chance = None if view is None else view.chance
    log = views.store.log(row.key)
    return {
        "title": f"{name_of(row.arm)}, seed {row.seed}",
        "row": row,
        "before": neighbours[0],
        "after": neighbours[1],
        "differs": None if twin is None else first_difference(row, twin),
        "twin": None if twin is None else _twin(twin, views),
        "view": view is not None,
        "evidence": "" if view is None else view.log.result.get("cause_evidence", ""),
        "chance": None if view is None or chance is None else _chance(view, chance),
        "picture": "" if view is None else map_picture(view),
        "actions": "" if view is None else actions_strip(view),
        "charts": [] if view is None else charts_of(view),
        "map_legend": MAP_LEGEND,
        "action_legend": [] if view is None else _action_legend(view),
        "facts": facts_of(row.metrics, None if twin is None else twin.metrics),
        "commands": log_commands(log, planned, not row.success, chance) if view else [],
        "provenance": [] if view is None else of_episode(view.log),
    }


def _twin(row: Row, views: Views) -> dict[str, Any]:
    view = views.of(row)
    return {
        "row": row,
        "name": f"{name_of(row.arm)}, seed {row.seed}",
        "picture": "" if view is None else map_picture(view),
        "actions": "" if view is None else actions_strip(view),
    }


def _chance(view: View, number: int) -> dict[str, Any]:
    return {
        "number": number,
        "time": view.times[number],
        "action": view.actions[number],
        "reason": view.reasons[number],
    }


def _action_legend(view: View) -> list[tuple[str, str]]:
    shown = [(action_colour(name), name) for name in dict.fromkeys(view.actions)]
    if any(label not in ("", "none") for label in view.labels):
        shown.append((LABEL, "failure label (lower bar)"))
    if any(view.late):
        shown.append(("#000000", "deadline missed (line)"))
    return shown


def facts_of(
    metrics: Mapping[str, float | None], other: Mapping[str, float | None] | None
) -> list[Fact]:
    """Return every metric that an episode or its twin has."""
    facts = []
    for name, metric in METRICS.items():
        value, twin = metrics[name], None if other is None else other[name]
        if value is None and twin is None:
            continue
        facts.append(Fact(name, metric.unit, value, other=twin, side=_side(name, value, twin)))
    return facts


def _side(name: str, value: float | None, other: float | None) -> str:
    better = METRICS[name].higher_is_better
    if name in WALL_TIME or better is None or value is None or other is None or value == other:
        return ""
    return "good" if (value > other) == better else "bad"


def pages_first(rows: Sequence[Row], most: int) -> set[str]:
    """Return the keys of the episodes that get a page: failures first, then the others."""
    ordered = sorted(rows, key=lambda row: row.success)
    return {row.key for row in ordered[:most]}
