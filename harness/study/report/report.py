"""HTML report of a study: a site in a folder, and one self-contained page.

The same logs, with their dates, give the same bytes. Nothing on a page is loaded from elsewhere. A
study over recordings has the one page alone, with a row for each pass.
"""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole
from wayproof.harness.study.analysis import Sample, samples_of
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.passes import COLUMNS, Pass
from wayproof.harness.study.plan import Planned, name_of, plan_episodes
from wayproof.harness.study.report.episode import MAP_LEGEND, Views, episode_page, title_of
from wayproof.harness.study.report.page import Cell, Figure, Page, Section, style
from wayproof.harness.study.report.provenance import of_study
from wayproof.harness.study.report.sections import (
    TABLE,
    answers_section,
    arms_section,
    changes_section,
    conditions_section,
    doses_section,
    gates_section,
    metrics_section,
    outcomes_section,
    stacks_section,
)
from wayproof.harness.study.report.view import map_picture
from wayproof.harness.study.report.words import heading, number
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.rows import Row, first_difference, twins_of
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import answers_of, conclude, read_own_rows, verdict_in_words

SITE = "report"
"""Folder of the site in the folder of the study."""

SHOWN_FAILURES = 24
"""Maximum number of pictures in the gallery; the table has every failure."""

MOST_PAGES = 2000
"""Maximum number of episodes with a page of their own, failures first; the table has all."""

TABLE_METRICS = ("time_to_goal", "least_clearance", "collisions", "ate", "latency_p99")
"""Columns of the table of all episodes."""


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
        paged: Keys of the episodes that get a page: failures first, then the others.
    """

    study: StudyFile
    planned: Sequence[Planned]
    rows: Sequence[Row]
    samples: Sequence[Sample]
    result: StudyResult
    store: Store
    views: Views
    twins: Mapping[str, Row]
    paged: frozenset[str]

    def page_of(self, row: Row) -> str:
        """Return the address of an episode's page from the first one; empty without one."""
        return f"episodes/{row.key}.html" if row.key in self.paged else ""


def write_report(folder: Path, allow_plugins: bool = False) -> tuple[Path, StudyResult]:
    """Write `report.html` and the site `report/` into the folder of a study.

    Returns:
        The first page of the site, or the one page of a study over recordings; and the verdict.

    Raises:
        InputError: The folder is not one of a study or has no episode, or a log is damaged.
    """
    material = read_material(folder, allow_plugins)
    whole = folder / "report.html"
    if material.study.recordings:
        result = material.result
        sections = [_passes(result), gates_section(result) if result.gates else None]
        _write(whole, result_page(result, sections, result.name).html())
        return whole, material.result
    draft = folder / f".{SITE}"
    shutil.rmtree(draft, ignore_errors=True)  # of a run that was ended
    (draft / "episodes").mkdir(parents=True)
    runs = _write_episodes(material, draft / "episodes")
    overview = _overview(material, runs, linked=True)
    (draft / "index.html").write_text(overview.html(root=""), encoding="utf-8")
    (draft / TABLE).write_text(_table(material).html(root=""), encoding="utf-8")
    (draft / "style.css").write_text(style(), encoding="utf-8")
    _write(whole, _overview(material, runs, linked=False).html())
    shutil.rmtree(folder / SITE, ignore_errors=True)
    draft.rename(folder / SITE)
    return folder / SITE / "index.html", material.result


def _write(path: Path, text: str) -> None:
    with written_whole(path, "report") as partial:
        partial.write_text(text, encoding="utf-8")


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
    if study.recordings and not rows:
        raise InputError(f"study '{folder}': no pass has ended")
    answers = answers_of(study, planned, store, contents, rows)
    shown = sorted(rows, key=lambda row: row.success)[:MOST_PAGES]
    return Material(
        study=study,
        planned=planned,
        rows=rows,
        samples=samples_of(rows),
        result=conclude(study, planned, rows, foreign, answers),
        store=store,
        views=Views(store, allow_plugins),
        twins=twins_of(rows),
        paged=frozenset(row.key for row in shown),
    )


def _write_episodes(material: Material, folder: Path) -> list[Mapping[str, str]]:
    """Write the pages of episodes; return the versions that ran them."""
    planned = {one.key: one for one in material.planned}
    shown = [row for row in material.rows if row.key in material.paged]
    keys = ["", *(row.key for row in shown), ""]
    runs: list[Mapping[str, str]] = []
    for place, row in enumerate(shown):
        page = episode_page(
            material.result.name,
            row,
            twin=material.twins.get(row.key),
            planned=planned[row.key],
            views=material.views,
            neighbours=(keys[place], keys[place + 2]),
        )
        view = material.views.of(row)
        if view is not None:
            runs.append(view.log.run)
        (folder / f"{row.key}.html").write_text(page.html(root="../"), encoding="utf-8")
    return runs


def result_page(result: StudyResult, sections: Sequence[Section | None], title: str) -> Page:
    """Return a page that begins with a verdict, with the sections that there are."""
    return Page(
        title,
        verdict=result.verdict,
        outcome=result.verdict,
        lines=[verdict_in_words(result), *result.foreign],
        sections=[one for one in sections if one is not None],
    )


def _overview(material: Material, runs: Sequence[Mapping[str, str]], linked: bool) -> Page:
    """Return the first page of the site, or the one to send, which has no links."""
    result, samples = material.result, material.samples
    limit = max(one.config.episode.time_limit for one in material.planned)
    several = any(one.config.waypoints for one in material.planned)
    sections = [
        _failures(material, linked),
        gates_section(result, linked) if result.gates else None,
        changes_section(result) if result.changes else None,
        conditions_section(samples, linked),
        answers_section(result, material.study.kind),
        arms_section(result),
        stacks_section(samples, limit),
        doses_section(samples, limit),
        outcomes_section(result),
        metrics_section(result, several),
        Section(
            "Provenance", terms=of_study(material.study, material.planned, material.store, runs)
        ),
    ]
    page = result_page(result, sections, result.name)
    return replace(page, links=[(result.name, ""), ("All episodes", TABLE)] * linked)


def _failures(material: Material, linked: bool) -> Section:
    rows = [row for sample in material.samples for row in sample.rows if not row.success]
    if not rows:
        return Section("Failures", note="None.")
    more = f"; the first {SHOWN_FAILURES} are shown" if len(rows) > SHOWN_FAILURES else ""
    figures = []
    for row in rows[:SHOWN_FAILURES]:
        view = material.views.of(row)
        log = shlex.quote(str(material.store.log(row.key)))
        checked = f" ({row.check} by its check)" if row.check else ""
        cause = f"Cause: {row.cause}{checked}{f': {row.evidence}' if row.evidence else ''}"
        figures.append(
            Figure(
                f"{title_of(row)}: {row.outcome}",
                link=material.page_of(row) if linked else "",
                lines=[row.reason, *([cause] if row.cause else [])],
                pictures=[] if view is None else [map_picture(view)],
                commands=[f"wayproof {verb} {log}" for verb in ("explain", "view") if view],
                kind="map",
            )
        )
    return Section(
        "Failures", note=f"{len(rows)} episodes failed{more}.", legend=MAP_LEGEND, figures=figures
    )


def _table(material: Material) -> Page:
    """Return the page with the table of all episodes."""
    heads = ["episode", "seed", "outcome", "cause", *map(heading, TABLE_METRICS)]
    heads.append("differs from its twin at")
    rows: list[list[Cell | str]] = []
    for row in material.rows:
        twin = material.twins.get(row.key)
        differs = None if twin is None else first_difference(row, twin)
        rows.append(
            [
                Cell(name_of(row.arm), link=material.page_of(row)),
                str(row.seed),
                Cell(row.outcome, "good" if row.success else "bad"),
                f"{row.cause}, {row.check}" if row.check else row.cause,
                *(number(row.metrics[name]) for name in TABLE_METRICS),
                number(differs, "d"),
            ]
        )
    return Page(
        "All episodes",
        links=[(material.result.name, "index.html"), ("All episodes", "")],
        sections=[Section(heads=heads, rows=rows)],
        outcomes=sorted({row.outcome for row in material.rows}) or ["success"],
    )


def _passes(result: StudyResult) -> Section:
    """Return the table of the passes through recordings."""
    passes = [one for one in result.answers if isinstance(one, Pass)]
    return Section(
        "Passes",
        note="Each pass steps the stack through a recording with at most one assumption "
        "broken. Admitted: share of the way really driven that was known to be free when it "
        "was entered; change: beside the pass without perturbation, in percentage points; "
        "others: decisions of another action; inputs: streams that differ from its up to the "
        "first of them. 'wayproof report FOLDER/LOG' writes the page of one pass.",
        heads=(*COLUMNS, "log"),
        rows=[[*one.cells(), "" if one.error else f"logs/{one.key}.mcap"] for one in passes],
    )
