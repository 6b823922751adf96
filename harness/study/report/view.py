"""View of an episode's page: the series of one log, read in one pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.clearance import true_clearance_is_bound
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.messages import decode
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.study.report.charts import Line, Mark, line_chart, strip
from wayproof.harness.study.report.page import Figure
from wayproof.harness.study.report.palette import BELIEVED, CHANCE, LIMIT, STAGES, TRUE
from wayproof.harness.study.report.top_view import Tracks, footprints, top_view

Array = NDArray[np.float64]

READ = {kind.DESCRIPTOR.full_name for kind in (pb.Decision, pb.Truth)}
"""Schemas of the messages that are decoded."""

SHOWN = ("action", "label")
"""Fields of decisions in the strip."""

SHOWN_LATENCY = 99.0
"""Percentile of the latency after the first decision at which the chart of it ends."""


UNKNOWN = pb.Truth(
    position=[math.nan] * 3, velocity=[math.nan] * 3, clearance_m=math.nan, collisions=0
)
"""Truth where nothing knows it."""


@dataclass(frozen=True)
class View:
    """What the page of an episode shows.

    Attributes:
        log: Head of the log.
        decisions: All of them.
        truths: One for each; `UNKNOWN` where nothing knows it.
        times: (n,) their times, s.
    """

    log: Log
    decisions: Sequence[pb.Decision]
    truths: Sequence[pb.Truth]
    times: Array

    @property
    def believed(self) -> Array:  # (n, 3)
        """Return the estimated positions, m."""
        return np.array([one.position for one in self.decisions])

    @property
    def true(self) -> Array:  # (n, 3)
        """Return the true positions, m."""
        return np.array([one.position for one in self.truths])

    @property
    def chance(self) -> int | None:
        """Return the number of the last decision that could have prevented the failure."""
        number = int(self.log.result.get("cause_decision", "-1"))
        return number if 0 <= number < len(self.times) else None

    @property
    def contact(self) -> float | None:
        """Return the time of the first contact, s; None without one."""
        touched = [number for number, one in enumerate(self.truths) if one.collisions]
        return float(self.times[touched[0]]) if touched else None


def read_view(path: Path, allow_plugins: bool = False) -> View | None:
    """Read a log for its page; None if it holds no decision.

    Raises:
        InputError: The log is damaged.
    """
    log = open_log(path, allow_plugins)
    decisions: list[pb.Decision] = []
    truths: dict[int, pb.Truth] = {}
    for item in walk(path):
        if isinstance(item, Packet) and item.schema in READ:
            message = decode(item, path)
            if isinstance(message, pb.Decision):
                decisions.append(message)
            elif isinstance(message, pb.Truth):
                truths[message.sequence] = message
    if not decisions:
        return None
    times = np.array([one.timestamp.ToNanoseconds() * 1e-9 for one in decisions])
    return View(log, decisions, [truths.get(one.sequence, UNKNOWN) for one in decisions], times)


def actions_strip(view: View) -> str:
    """Draw the actions and failure labels of an episode."""
    actions, labels = ([getattr(one, name) for one in view.decisions] for name in SHOWN)
    return strip(view.times, actions, labels, [one.deadline_missed for one in view.decisions])


def map_picture(view: View) -> str:
    """Draw an episode from above."""
    true, chance = view.true, view.chance
    known = np.isfinite(true[:, 0])
    place = None if chance is None or not known[chance] else true[chance]
    tracks = Tracks(
        believed=view.believed[:, :2],
        true=true[known, :2],
        goals=tuple((x, y) for x, y, _ in view.log.mission.goals),
        failed=view.log.result["outcome"] != "success",
        chance=None if place is None else (float(place[0]), float(place[1])),
    )
    return top_view(footprints(view.log.scene), tracks)


def charts_of(view: View) -> list[Figure]:
    """Draw clearance, speed, pose error against the margin, and latency by stage over time."""
    marks = []
    if view.chance is not None:
        marks.append(Mark("last chance", CHANCE, float(view.times[view.chance])))
    if view.contact is not None:
        marks.append(Mark("contact", LIMIT, view.contact))
    took = np.array(
        [[getattr(one.stages, f"{name}_ms") for name in STAGES] for one in view.decisions]
    )
    stages = [Line(name, STAGES[name], took[:, k]) for k, name in enumerate(STAGES)]
    later = took[1:] if len(took) > 1 else took
    top = float(np.percentile(later.sum(axis=1), SHOWN_LATENCY))
    clearances = np.array([one.clearance_m for one in view.truths])
    planned = np.array([one.least_clearance_m for one in view.decisions])
    speeds = np.array([math.hypot(*one.velocity) for one in view.truths])
    errors = np.sqrt(np.square(view.believed - view.true).sum(axis=1))
    margins = np.array([one.localization_margin_m for one in view.decisions])
    is_bound = true_clearance_is_bound(float(np.nanmax(clearances, initial=0.0)))
    bound = "; 2 m is 2 m or more" if is_bound else ""
    ahead = "in the map along the committed path, at least"
    margin = Line("localization margin", LIMIT, margins, True)
    charts: list[tuple[str, list[Line]]] = [
        (
            f"Clearance, m{bound}",
            [Line("true", TRUE, clearances), Line(ahead, BELIEVED, planned, True)],
        ),
        ("Speed, m/s", [Line("true", TRUE, speeds)]),
        ("Error of the position, m", [Line("true error", TRUE, errors), margin]),
    ]
    figures = [
        Figure(
            title,
            legend=_legend(lines, marks),
            pictures=[line_chart(view.times, lines, marks)],
        )
        for title, lines in charts
    ]
    latency = Figure(
        "Latency by stage, ms, on top of each other",
        legend=_legend(stages, marks),
        pictures=[line_chart(view.times, stages, marks, top if top > 0.0 else None, stacked=True)],
        note=f"The first decision took {took[0].sum():.0f} ms. What exceeds the 99th percentile of "
        "the others is cut off.",
    )
    return [*figures, latency]


def _legend(lines: Sequence[Line], marks: Sequence[Mark]) -> list[tuple[str, str]]:
    return [(one.colour, one.name) for one in lines] + [(one.colour, one.name) for one in marks]
