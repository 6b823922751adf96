"""HTML report of a study: one self-contained page; the same logs give the same bytes."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jinja2

from wayproof.harness.log.reader import open_log
from wayproof.harness.metrics import METRICS, read_trace
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.analysis import ArmSummary, Sample, samples_of
from wayproof.harness.study.file import CLEAN, Arm, name_of, plan_episodes
from wayproof.harness.study.gates import gate_advice, interval_in_words
from wayproof.harness.study.report.plots import borne, dose_response, track
from wayproof.harness.study.rows import Row
from wayproof.harness.study.stack_table import stack_table
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import StudyResult, conclude, read_own_rows, verdict_in_words
from wayproof.harness.study.threshold import Thresholds, read_thresholds, thresholds_in_words

SHOWN_FAILURES = 24
"""Maximum number of pictures in the gallery; the table has every failure."""

SHOWN_METRICS = (
    "spl",
    "path_ratio",
    "collisions",
    "least_clearance",
    "time_stopped",
    "not_admitted",
    "guard_cuts",
    "jerk",
    "latency_p50",
    "latency_p99",
    "deadline_misses",
)


@dataclass(frozen=True)
class Failure:
    """One failed episode on the page."""

    row: Row
    log: str
    picture: str


@dataclass(frozen=True)
class Borne:
    """Thresholds of one arm, in words and as a picture."""

    thresholds: Thresholds
    words: str
    picture: str


@dataclass(frozen=True)
class Dose:
    """One dose-response plot."""

    title: str
    picture: str


def write_report(folder: Path, allow_plugins: bool = False) -> tuple[Path, StudyResult]:
    """Write `report.html` into the folder of a study.

    Raises:
        InputError: The folder is not one of a study or has no episode, or a log is damaged.
    """
    store = Store(folder)
    study = store.read_study(allow_plugins)
    planned = plan_episodes(study, store.read_contents())
    rows, foreign = read_own_rows(planned, store, allow_plugins)
    result = conclude(study, planned, rows, foreign)
    first = planned[0].arm
    samples = samples_of(rows, first.variant, first.stack)
    page = _template().render(
        result=result,
        verdict=verdict_in_words(result),
        interval=interval_in_words,
        advice=gate_advice,
        name_of=name_of,
        metrics={name: METRICS[name] for name in SHOWN_METRICS},
        stacks=stack_table(samples, max(one.config.episode.time_limit for one in planned)),
        doses=_doses(result.arms),
        borne=_borne(read_thresholds(study, store)),
        causes=sorted({cause for one in result.arms for cause in one.causes}),
        outcomes=sorted({outcome for one in result.arms for outcome in one.outcomes}),
        failures=_failures(samples, store, allow_plugins),
        failed=sum(not row.success for row in rows),
    )
    path = folder / "report.html"
    draft = path.with_suffix(".partial")
    draft.write_text(page, encoding="utf-8")
    draft.replace(path)
    return path, result


def _template() -> jinja2.Template:
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    environment.filters["number"] = _number
    return environment.get_template("report.html.j2")


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _doses(arms: Sequence[ArmSummary]) -> list[Dose]:
    """Return a plot for each world, robot, stack, variant and perturbation, from severity 0 on."""
    clean = {one.arm: one for one in arms if one.arm.perturbation == CLEAN}
    families: dict[Arm, list[ArmSummary]] = {}
    for one in arms:
        if one.arm.perturbation != CLEAN:
            families.setdefault(replace(one.arm, severity=0), []).append(one)
    doses = []
    for arm, members in families.items():
        twin = clean.get(replace(arm, perturbation=CLEAN))
        shown = sorted([*([twin] if twin else []), *members], key=lambda one: one.arm.severity)
        picture = dose_response(
            [one.arm.severity for one in shown], [one.success for one in shown], "success"
        )
        doses.append(Dose(name_of(arm), picture))
    return doses


def _borne(thresholds: Sequence[Thresholds]) -> list[Borne]:
    return [
        Borne(one, thresholds_in_words(one), borne(one.severities, MAX_SEVERITY, "severity"))
        for one in thresholds
        if one.severities
    ]


def _failures(samples: Sequence[Sample], store: Store, allow_plugins: bool) -> list[Failure]:
    rows = [row for sample in samples for row in sample.rows if not row.success]
    failures = []
    for row in rows[:SHOWN_FAILURES]:
        path = store.log(row.key)
        picture = ""
        if path.is_file():
            log = open_log(path, allow_plugins)
            picture = track(read_trace(log), log.scene, log.mission.goal)
        failures.append(Failure(row, shlex.quote(str(path)), picture))
    return failures
