"""View of an episode's page: the series of one log, read in one pass."""

from __future__ import annotations

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

SHOWN_LATENCY = 99.0
"""Percentile of the latency after the first decision at which the chart of it ends."""


@dataclass(frozen=True)
class View:
    """Series of an episode; one entry for each of n decisions, NaN where nothing knows it.

    Attributes:
        log: Head of the log.
        times: (n,) s.
        actions: Names of the actions.
        labels: Failure labels.
        reasons: Reasons in words.
        late: Whether the decision was past its deadline.
        believed: (n, 3) estimated positions, m.
        true: (n, 3) true positions, m.
        speeds: (n,) true, m/s.
        clearances: (n,) true, m.
        planned: (n,) least clearance in the map along the committed path, m.
        margins: (n,) localization margin, m.
        stages: (n, 4) wall time by stage, ms.
        contact: Time of the first contact, s; None without one.
    """

    log: Log
    times: Array
    actions: list[str]
    labels: list[str]
    reasons: list[str]
    late: list[bool]
    believed: Array
    true: Array
    speeds: Array
    clearances: Array
    planned: Array
    margins: Array
    stages: Array
    contact: float | None

    @property
    def errors(self) -> Array:  # (n,)
        """Return the distance between estimated and true position, m."""
        distances: Array = np.sqrt(np.square(self.believed - self.true).sum(axis=1))
        return distances

    @property
    def chance(self) -> int | None:
        """Return the number of the last decision that could have prevented the failure."""
        number = int(self.log.result.get("cause_decision", "-1"))
        return number if 0 <= number < len(self.times) else None


def read_view(path: Path, allow_plugins: bool = False) -> View | None:
    """Read the series of a log; None if it holds no decision.

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
    return _view(log, decisions, truths) if decisions else None


def _view(log: Log, decisions: Sequence[pb.Decision], truths: dict[int, pb.Truth]) -> View:
    nothing = (np.nan, np.nan, np.nan)
    known = [truths.get(one.sequence) for one in decisions]
    touched = [one for one in known if one is not None and one.collisions]
    stages = [[getattr(one.stages, f"{name}_ms") for name in STAGES] for one in decisions]
    velocities = np.array([one.velocity if one else nothing for one in known])
    return View(
        log=log,
        times=np.array([one.timestamp.ToNanoseconds() * 1e-9 for one in decisions]),
        actions=[one.action for one in decisions],
        labels=[one.label for one in decisions],
        reasons=[one.reason for one in decisions],
        late=[one.deadline_missed for one in decisions],
        believed=np.array([one.position for one in decisions]),
        true=np.array([one.position if one else nothing for one in known]),
        speeds=np.sqrt(np.square(velocities).sum(axis=1)),
        clearances=np.array([one.clearance_m if one else np.nan for one in known]),
        planned=np.array([one.least_clearance_m for one in decisions]),
        margins=np.array([one.localization_margin_m for one in decisions]),
        stages=np.array(stages),
        contact=touched[0].timestamp.ToNanoseconds() * 1e-9 if touched else None,
    )


def actions_strip(view: View) -> str:
    """Draw the actions and failure labels of an episode."""
    return strip(view.times, view.actions, view.labels, view.late)


def map_picture(view: View) -> str:
    """Draw an episode from above."""
    known = np.isfinite(view.true[:, 0])
    chance = view.chance
    place = None if chance is None or not known[chance] else view.true[chance]
    tracks = Tracks(
        believed=view.believed[:, :2],
        true=view.true[known, :2],
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
    stages = [Line(name, STAGES[name], view.stages[:, k]) for k, name in enumerate(STAGES)]
    later = view.stages[1:] if len(view.stages) > 1 else view.stages
    top = float(np.percentile(later.sum(axis=1), SHOWN_LATENCY))
    first = float(view.stages[0].sum())
    bound = (
        "; 2 m is 2 m or more"
        if true_clearance_is_bound(float(np.nanmax(view.clearances, initial=0.0)))
        else ""
    )
    ahead = "in the map along the committed path, at least"
    charts: list[tuple[str, list[Line]]] = [
        (
            f"Clearance, m{bound}",
            [
                Line("true", TRUE, view.clearances),
                Line(ahead, BELIEVED, view.planned, True),
            ],
        ),
        ("Speed, m/s", [Line("true", TRUE, view.speeds)]),
        (
            "Error of the position, m",
            [
                Line("true error", TRUE, view.errors),
                Line("localization margin", LIMIT, view.margins, True),
            ],
        ),
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
        note=f"The first decision took {first:.0f} ms. What exceeds the 99th percentile of the "
        "others is cut off.",
    )
    return [*figures, latency]


def _legend(lines: Sequence[Line], marks: Sequence[Mark]) -> list[tuple[str, str]]:
    return [(one.colour, one.name) for one in lines] + [(one.colour, one.name) for one in marks]
