"""HTML report of a study: a site in a folder, and one self-contained page.

The same logs, with their dates, give the same bytes. Nothing on a page is loaded from elsewhere.
"""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from wayproof.harness.outputs import written_whole
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.analysis import Sample, samples_of
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.gates import interval_in_words
from wayproof.harness.study.plan import Planned, name_of, plan_episodes
from wayproof.harness.study.report.conditions import conditions_of
from wayproof.harness.study.report.dose import doses_of
from wayproof.harness.study.report.gallery import MAP_LEGEND, Views, episode_context, pages_first
from wayproof.harness.study.report.plots import borne
from wayproof.harness.study.report.provenance import of_study
from wayproof.harness.study.report.templates import templates
from wayproof.harness.study.report.view import map_picture
from wayproof.harness.study.report.words import gate_reason, heading, side_of_drop
from wayproof.harness.study.rows import Row, first_difference, reference_of
from wayproof.harness.study.stack_table import stack_table
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import (
    StudyResult,
    answers_of,
    conclude,
    read_own_rows,
    verdict_in_words,
)
from wayproof.harness.study.threshold import Thresholds

SITE = "report"
"""Folder of the site in the folder of the study."""

SHOWN_FAILURES = 24
"""Maximum number of pictures in the gallery; the table has every failure."""

MOST_PAGES = 2000
"""Maximum number of episodes with a page of their own, failures first; the table has all."""

SHOWN_METRICS = (
    "spl",
    "path_ratio",
    "collisions",
    "least_clearance",
    "time_stopped",
    "ate",
    "not_admitted",
    "guard_cuts",
    "jerk",
    "latency_p50",
    "latency_p99",
    "deadline_misses",
)

TABLE_METRICS = ("time_to_goal", "least_clearance", "collisions", "ate", "latency_p99")
"""Columns of the table of all episodes."""


@dataclass(frozen=True)
class Failure:
    """One failed episode on the overview."""

    row: Row
    log: str
    picture: str
    page: str


@dataclass(frozen=True)
class Listed:
    """One episode in the table of all."""

    row: Row
    page: str
    differs: int | None


@dataclass(frozen=True)
class Material:
    """Material of a report.

    Attributes:
        study: The study.
        planned: Its episodes.
        rows: Rows of the episodes that have ended.
        samples: Rows by arm.
        result: Verdict.
        store: Folder of the study.
        views: Views of its logs.
        twins: Key of an episode -> its reference.
    """

    study: StudyFile
    planned: Sequence[Planned]
    rows: Sequence[Row]
    samples: Sequence[Sample]
    result: StudyResult
    store: Store
    views: Views
    twins: Mapping[str, Row]


def write_report(folder: Path, allow_plugins: bool = False) -> tuple[Path, StudyResult]:
    """Write `report/` and `report.html` into the folder of a study; return the site's first page.

    Raises:
        InputError: The folder is not one of a study or has no episode, or a log is damaged.
    """
    material = read_material(folder, allow_plugins)
    pages_of = templates()
    runs: list[Mapping[str, str]] = []
    paged = pages_first(material.rows, MOST_PAGES)
    draft = folder / f".{SITE}"
    shutil.rmtree(draft, ignore_errors=True)  # of a run that was ended
    (draft / "episodes").mkdir(parents=True)
    _write_episodes(material, paged, site=draft, pages_of=pages_of, runs=runs)
    overview = _overview(material, paged, runs)
    pages = {
        draft / "index.html": ("report.html.j2", {**overview, "site": True, "root": ""}),
        draft / "episodes.html": ("episodes.html.j2", _table(material, paged)),
        draft / "style.css": ("style.css.j2", {}),
    }
    for path, (name, context) in pages.items():
        path.write_text(pages_of.get_template(name).render(context), encoding="utf-8")
    with written_whole(folder / "report.html", "report") as partial:
        page = pages_of.get_template("report.html.j2").render({**overview, "site": False})
        partial.write_text(page, encoding="utf-8")
    shutil.rmtree(folder / SITE, ignore_errors=True)
    draft.rename(folder / SITE)
    return folder / SITE / "index.html", material.result


def read_material(folder: Path, allow_plugins: bool = False) -> Material:
    """Read a study with all rows.

    Raises:
        InputError: As `write_report`.
    """
    store = Store(folder)
    study = store.read_study(allow_plugins)
    contents = store.read_contents()
    planned = plan_episodes(study, contents)
    rows, foreign = read_own_rows(planned, store, allow_plugins)
    first = planned[0].arm
    by_arm = {(row.arm, row.seed): row for row in rows}
    twins = {}
    for row in rows:
        reference = reference_of(row.arm, first.variant, first.stack)
        if reference is not None and (reference, row.seed) in by_arm:
            twins[row.key] = by_arm[reference, row.seed]
    answers = answers_of(study, planned, store, contents, rows)
    return Material(
        study=study,
        planned=planned,
        rows=rows,
        samples=samples_of(rows, first.variant, first.stack),
        result=conclude(study, planned, rows, foreign, answers),
        store=store,
        views=Views(store, allow_plugins),
        twins=twins,
    )


def _write_episodes(
    material: Material,
    paged: set[str],
    site: Path,
    pages_of: jinja2.Environment,
    runs: list[Mapping[str, str]],
) -> None:
    """Write the pages of episodes, and note the versions that ran them."""
    template = pages_of.get_template("episode.html.j2")
    planned = {one.key: one for one in material.planned}
    shown = [row for row in material.rows if row.key in paged]
    keys = ["", *(row.key for row in shown), ""]
    for number, row in enumerate(shown):
        context = episode_context(
            row,
            twin=material.twins.get(row.key),
            planned=planned[row.key],
            views=material.views,
            neighbours=(keys[number], keys[number + 2]),
        )
        view = material.views.of(row)
        if view is not None:
            runs.append(view.log.run)
        page = template.render(context, site=True, root="../", study=material.result.name)
        (site / "episodes" / f"{row.key}.html").write_text(page, encoding="utf-8")


def _overview(
    material: Material, paged: set[str], runs: Sequence[Mapping[str, str]]
) -> dict[str, Any]:
    """Return the content of the first page."""
    result, limit = material.result, _time_limit(material)
    return {
        "result": result,
        "verdict": verdict_in_words(result),
        "interval": interval_in_words,
        "reason": gate_reason,
        "side": side_of_drop,
        "name_of": name_of,
        "metrics": _measured(material),
        "heading": heading,
        "stacks": stack_table(material.samples, limit),
        "conditions": conditions_of(material.samples),
        "doses": doses_of(material.samples, limit),
        "answers": [(name_of(one.arm), one.in_words(), _picture(one)) for one in result.answers],
        "kind": material.study.kind,
        "causes": sorted({cause for one in result.arms for cause in one.causes}),
        "outcomes": sorted({outcome for one in result.arms for outcome in one.outcomes}),
        "failures": _failures(material, paged),
        "failed": sum(not row.success for row in material.rows),
        "map_legend": MAP_LEGEND,
        "provenance": of_study(material.study, material.planned, material.store, runs),
    }


def _measured(material: Material) -> list[str]:
    """Return the shown metrics that an arm has; `progress` of missions with several goals."""
    several = any(one.config.waypoints for one in material.planned)
    names = (*(["progress"] if several else []), *SHOWN_METRICS)
    arms = material.result.arms
    return [name for name in names if any(one.metrics[name] is not None for one in arms)]


def _time_limit(material: Material) -> float:
    return max(one.config.episode.time_limit for one in material.planned)


def _table(material: Material, paged: set[str]) -> dict[str, Any]:
    """Return the content of the table of all episodes."""
    listed = []
    for row in material.rows:
        twin = material.twins.get(row.key)
        differs = None if twin is None else first_difference(row, twin)
        page = f"episodes/{row.key}.html" if row.key in paged else ""
        listed.append(Listed(row, page, differs))
    return {
        "result": material.result,
        "rows": listed,
        "outcomes": sorted({row.outcome for row in material.rows}),
        "columns": TABLE_METRICS,
        "causes": any(row.cause for row in material.rows),
        "paired": bool(material.twins),
        "heading": heading,
        "name_of": name_of,
        "site": True,
        "root": "",
    }


def _picture(answer: object) -> str:
    """Return the picture of thresholds; none of another answer."""
    if not isinstance(answer, Thresholds) or not answer.seeds:
        return ""
    return borne([one.severity for one in answer.seeds], MAX_SEVERITY, "severity")


def _failures(material: Material, paged: set[str]) -> list[Failure]:
    rows = [row for sample in material.samples for row in sample.rows if not row.success]
    failures = []
    for row in rows[:SHOWN_FAILURES]:
        view = material.views.of(row)
        picture = "" if view is None else map_picture(view)
        page = f"episodes/{row.key}.html" if row.key in paged else ""
        log = shlex.quote(str(material.store.log(row.key)))
        failures.append(Failure(row, log, picture, page))
    return failures
