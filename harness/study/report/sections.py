"""Sections of the pages of a study and of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from urllib.parse import quote

from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.analysis import ArmSummary, Sample, time_to_goal, values_of
from wayproof.harness.study.gates import estimate_in_words
from wayproof.harness.study.lost import MOST_SHOWN
from wayproof.harness.study.plan import CLEAN, Arm, name_of, perturbation_at
from wayproof.harness.study.report.charts import Curve, bars_chart, stairs
from wayproof.harness.study.report.page import Cell, Figure, Section
from wayproof.harness.study.report.words import gate_reason, heading, number, side_of, spread
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.threshold import Thresholds, amount_at

SHOWN_METRICS = (
    *("progress", "spl", "path_ratio", "collisions", "least_clearance", "time_stopped", "ate"),
    *("not_admitted", "guard_cuts", "jerk", "latency_p50", "latency_p99", "deadline_misses"),
)


TABLE = "episodes.html"
"""Page of a site with the table of all episodes, which shows those of the words behind its `#`."""


def _episodes_of(arm: Arm, linked: bool) -> str:
    """Return the address of an arm's episodes; empty on a page without a site."""
    return f"{TABLE}#{quote(name_of(arm))}" if linked else ""


def gates_section(result: StudyResult, linked: bool = False) -> Section:
    """Return the table of the gates; of a site with links to the episodes."""
    together = (
        f"The intervals of all {len(result.gates)} gates hold together at 95 % (Bonferroni), so "
        "they are wider than those of the arms below."
        if len(result.gates) > 1
        else "Intervals at 95 %."
    )
    if any(one.sequential for one in result.gates):
        together += " They hold at every look: seeds may be added until they decide."
    return Section(
        "Gates",
        note=f"{together} A gate is held where its whole interval keeps the bound, fails where the "
        "whole interval breaks it, else it is inconclusive. Worlds are the independent units.",
        heads=("verdict", "gate", "arm", "estimate and interval", "worlds", "reason"),
        rows=[
            (
                Cell(one.verdict, one.verdict),
                one.gate,
                Cell(name_of(one.arm), link=_episodes_of(one.arm, linked)),
                estimate_in_words(one),
                str(one.worlds),
                gate_reason(one),
            )
            for one in result.gates
        ],
    )


def changes_section(result: StudyResult) -> Section:
    """Return the table of the paired differences, those that are surely worse first."""
    return Section(
        "Differences",
        note="Means over the pairs, and the median over worlds of the second less the first. p: "
        "McNemar's exact test of success, Wilcoxon's signed ranks of any other figure, after "
        "Holm's correction over all figures of harm, and over all further ones. Red is worse and "
        "green better, where a difference is shown (p up to 0.05) and of a size that matters.",
        heads=("arm", "figure", "before", "after", "difference", "worse in", "p"),
        rows=[
            [
                name_of(one.arm),
                heading(one.metric),
                number(one.before, ".3f"),
                number(one.after, ".3f"),
                Cell(number(one.difference, "+.3f"), one.side),
                f"{one.worse} of {one.worlds}",
                number(one.p_value, ".3f"),
            ]
            for one in result.changes
        ],
    )


def lost_section(result: StudyResult) -> Section | None:
    """Return the episodes that failed, with cause and command; None without any."""
    if not result.lost:
        return None
    return Section(
        "What failed",
        heads=("arm", "seed", "outcome", "cause", "command"),
        rows=[
            [name_of(one.arm), str(one.seed), one.outcome, one.cause, one.command]
            for one in result.lost[:MOST_SHOWN]
        ],
        note="" if len(result.lost) <= MOST_SHOWN else f"The first of {len(result.lost)}.",
    )


def conditions_section(samples: Sequence[Sample], linked: bool = False) -> Section | None:
    """Return successes by world and robot against stack and variant; None without an arm.

    The unperturbed arms alone are in it.
    """
    clean = {
        (f"{one.arm.world}, {one.arm.robot}", _column(one.arm)): one
        for one in samples
        if one.arm.perturbation == CLEAN
    }
    columns = list(dict.fromkeys(column for _, column in clean))
    lines = list(dict.fromkeys(line for line, _ in clean))
    if not clean:
        return None
    return Section(
        "Success by world",
        note="Unperturbed episodes: reached the goal, of all.",
        heads=("world and robot", *columns),
        rows=[
            (line, *(_share(clean.get((line, column)), linked) for column in columns))
            for line in lines
        ],
    )


def _column(arm: Arm) -> str:
    return " ".join(part for part in (arm.stack, arm.variant) if part) or "reached the goal"


def _share(sample: Sample | None, linked: bool) -> Cell:
    if sample is None:
        return Cell("")
    ran = [row.success for row in sample.rows if row.ran]
    if not ran:
        return Cell("none ran")
    hue = 120.0 * sum(ran) / len(ran)
    link = _episodes_of(sample.arm, linked)
    return Cell(f"{sum(ran)} of {len(ran)}", link=link, colour=f"hsl({hue:.0f} 55% 85%)")


ARM_HEADS = ("arm", "episodes", "success (95 %)", "mean time, s", "drop (95 %)", "lost", "won")


def arm_cells(one: ArmSummary) -> list[Cell]:
    """Return the cells of `ARM_HEADS`."""
    against = one.against
    cells = [
        Cell(name_of(one.arm)),
        Cell(str(one.episodes)),
        Cell(spread(one.success)),
        Cell(number(one.mean_time, ".1f")),
    ]
    if against is None:
        return [*cells, Cell(""), Cell(""), Cell("")]
    drop = Cell(spread(against.drop, "+.2f"), side_of(against.drop, higher_is_better=False))
    return [*cells, drop, Cell(str(len(against.lost))), Cell(str(len(against.won)))]


def arms_section(result: StudyResult) -> Section:
    """Return the table of the arms, with their comparisons."""
    note = (
        "Success with its exact 95 % interval over worlds; each interval holds alone, not all of "
        "them together. Mean time is restricted: a failure "
        "counts the time limit."
    )
    heads, rows = list(ARM_HEADS[:4]), [arm_cells(one)[:4] for one in result.arms]
    if any(one.against for one in result.arms):
        note += (
            " Drop is the twin's success less the arm's, by pairs of equal seeds; p is McNemar's "
            "exact test after Holm's correction. Inputs as declared: pairs whose hashed input "
            "streams are the same, but for those that the perturbation declares, up to the first "
            "differing command. A drop is coloured where its whole interval lies on one side of 0."
        )
        heads = [*ARM_HEADS, "p", "acted otherwise", "first at decision", "share of decisions"]
        heads += ["inputs as declared", "inputs that differ"]
        rows = [[*arm_cells(one), *_pairing(one)] for one in result.arms]
    return Section("Arms", note=note, heads=heads, rows=rows)


def _pairing(one: ArmSummary) -> list[Cell]:
    against = one.against
    if against is None:
        return [Cell("")] * 6
    return [
        Cell(number(against.p_adjusted, ".3f")),
        Cell(f"{against.changed} of {against.pairs}"),
        Cell(number(against.first_difference, ".0f")),
        Cell(number(against.share_differing)),
        Cell(f"{against.proven} of {against.pairs}", "bad" if against.undeclared else ""),
        Cell(", ".join(against.streams)),
    ]


def stacks_section(samples: Sequence[Sample], time_limit: float) -> Section | None:
    """Return the figures of the stacks side by side; None without an axis of stacks."""
    rows: dict[str, list[list[str]]] = {}
    for one in samples:
        if one.arm.stack:
            conditions = name_of(replace(one.arm, stack=""))
            cells = [conditions, one.arm.stack, str(len(one.rows))]
            cells += [spread(values_of(one.rows, "success").interval())]
            cells += [spread(values_of(one.rows, "collisions").interval())]
            cells += [spread(time_to_goal(one.rows, time_limit), ".1f")]
            cells += [spread(values_of(one.rows, "not_admitted").interval(), ".3f")]
            cells += [spread(values_of(one.rows, "guard_cuts").interval(), ".1f")]
            rows.setdefault(conditions, []).append(cells)
    if not rows:
        return None
    return Section(
        "Stacks",
        note="Each with its 95 % interval over worlds, which holds alone, not all together. Time "
        "is restricted: a failure counts the time limit. Not admitted: share of decisions whose "
        "command the referee did not admit; the built-in stack has no referee. Guard: decisions "
        "at which the referee braked in the stack's place.",
        heads=(
            *("conditions", "stack", "episodes", "success", "collisions", "time, s"),
            *("not admitted", "guard"),
        ),
        rows=[cells for some in rows.values() for cells in some],
    )


def doses_section(samples: Sequence[Sample], time_limit: float) -> Section | None:
    """Return plots of each perturbation, from its unperturbed twin on; None without one."""
    clean = {one.arm: one for one in samples if one.arm.perturbation == CLEAN}
    families: dict[Arm, dict[str, list[Sample]]] = {}
    for one in samples:
        if one.arm.perturbation != CLEAN:
            family = families.setdefault(replace(one.arm, severity=0, stack=""), {})
            twin = clean.get(replace(one.arm, severity=0, perturbation=CLEAN))
            family.setdefault(one.arm.stack, [twin] if twin else []).append(one)
    if not families:
        return None
    return Section(
        "Dose and response",
        note="By the amount of the perturbation; 0 is the unperturbed twin. Bars are 95 % "
        "intervals over worlds, each alone, with an arrow where one continues beyond the plot. "
        "Time is restricted: a failure counts the time limit.",
        figures=[_dose(arm, stacks, time_limit) for arm, stacks in families.items()],
    )


def _dose(arm: Arm, stacks: Mapping[str, Sequence[Sample]], time_limit: float) -> Figure:
    done = perturbation_at(arm.perturbation, 1.0)
    unit = f", {done.unit}" if done is not None and done.unit else ""
    label = f"{arm.perturbation}{unit}; severity below"

    def curves(metric: str) -> list[Curve]:
        found = []
        for stack, some in stacks.items():
            ordered = sorted(some, key=lambda one: one.arm.severity)
            severities = [one.arm.severity for one in ordered]
            doses = [(one, amount_at(arm.perturbation, one)) for one in severities]
            means = [_mean(one, metric, time_limit) for one in ordered]
            found.append(Curve(stack, doses, means))
        return found

    return Figure(
        name_of(arm),
        pictures=[
            bars_chart(curves("success"), label, "success", top=1.0),
            bars_chart(curves("least_clearance"), label, "least clearance, m"),
            bars_chart(curves("time"), label, "time to the goal, s"),
        ],
    )


def _mean(sample: Sample, metric: str, time_limit: float) -> Interval | None:
    if metric == "time":
        return time_to_goal(sample.rows, time_limit)
    return values_of(sample.rows, metric).interval()


ANSWERS = {
    "threshold": (
        "Failure threshold",
        "The smallest severity at which each seed fails, by bisection: the middle between the "
        "greatest that it bore and the least that it did not. It is taken that who fails at one "
        "severity fails at every higher one. The median's interval is by order statistics.",
    ),
    "calibrate": ("Calibration", "Collisions are taken to fall with the value."),
    "falsify": ("Falsification", "These episodes were chosen to fail: no rate follows."),
}
"""Title and note of the answers of each kind of study."""


def answers_section(result: StudyResult, kind: str) -> Section | None:
    """Return the answers of a study that is no grid; None of a grid."""
    if not result.answers:
        return None
    title, note = ANSWERS[kind]
    figures = []
    for one in result.answers:
        known = [seed.severity for seed in one.seeds] if isinstance(one, Thresholds) else []
        picture = [stairs(known, MAX_SEVERITY, "severity")] if known else []
        figures.append(Figure(name_of(one.arm), lines=one.in_words().split("\n"), pictures=picture))
    return Section(title, note=note, figures=figures)


def outcomes_section(result: StudyResult) -> Section:
    """Return the numbers of outcomes and causes of each arm."""
    outcomes = sorted({outcome for one in result.arms for outcome in one.outcomes})
    causes = sorted({cause for one in result.arms for cause in one.causes})
    return Section(
        "Outcomes",
        heads=("arm", *outcomes, *(f"cause {cause}" for cause in causes)),
        rows=[
            [
                name_of(one.arm),
                *(str(one.outcomes.get(outcome, 0)) for outcome in outcomes),
                *(str(one.causes.get(cause, 0)) for cause in causes),
            ]
            for one in result.arms
        ],
    )


def metrics_section(result: StudyResult, several_goals: bool) -> Section:
    """Return the means of the metrics that an arm has; `progress` of missions of several goals."""
    names = SHOWN_METRICS if several_goals else SHOWN_METRICS[1:]
    shown = [name for name in names if any(one.metrics[name] is not None for one in result.arms)]
    return Section(
        "Metrics",
        note="Means over the episodes that have the figure.",
        heads=("arm", *map(heading, shown)),
        rows=[
            [name_of(one.arm), *(number(one.metrics[name]) for name in shown)]
            for one in result.arms
        ],
    )
