"""Audit of a log: every decision against all checks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.goals import mission_towards
from wayproof.harness.judge.body import Body
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.prior.cells import PriorCells
from wayproof.harness.recompute.segments import SegmentedStack, segments_of
from wayproof.harness.replay.audit.evidence import (
    AdmittedMap,
    Rests,
    all_rests,
    check_evidence,
    prior_of,
    rests_of,
)
from wayproof.harness.replay.audit.moment import (
    Moment,
    Violation,
    resting,
    standing_at_start,
)
from wayproof.harness.replay.audit.motion import (
    check_deadline,
    check_joint,
    check_limits,
    check_rest,
    is_malformed,
)
from wayproof.harness.replay.audit.record import (
    check_figures,
    check_inputs,
    check_margin,
    check_settings,
    check_version,
)
from wayproof.harness.replay.audit.volumes import Volumes, measure, together
from wayproof.harness.replay.audit.way import judge_way
from wayproof.harness.replay.reasons import ReasonCheck
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.labels import combined_version
from wayproof.maps import Representation, UnknownPolicy
from wayproof.maps.columns import ColumnMap

CHECKS: tuple[Callable[[Moment], list[Violation]], ...] = (
    check_version,
    check_inputs,
    check_settings,
    check_margin,
    check_deadline,
    check_figures,
    check_limits,
    check_joint,
    check_rest,
    check_evidence,
)
"""Checks of every decision, except those of its path."""


@dataclass(frozen=True)
class Audit:
    """Result of the audit of one log.

    Attributes:
        log: The log's path.
        policy: Unknown policy that paths were checked against.
        decisions: Number of decisions.
        swept: Number of paths checked cell by cell.
        stops: Number of stops because the path before is no longer free: along that path, or off
            it where that keeps a greater distance.
        recoveries: Number of paths out of the inflation.
        late: Number of late decisions, which keep the trajectory before.
        violations: Violations, in order.
        rules: Number of violations by rule.
        reasons: Number of reasons that were checked; 0 for a log of a format before 5.
        volumes: Distances of the swept paths from the volumes of cells; None if not measured.
        rests: Cells of the swept paths by what they rest on; None without a prior map or
            prediction, and where the policy admits unknown cells.
    """

    log: str
    policy: UnknownPolicy
    decisions: int
    swept: int
    stops: int
    recoveries: int
    late: int
    violations: tuple[Violation, ...]
    rules: dict[str, int]
    reasons: int
    volumes: Volumes | None = None
    rests: Rests | None = None


def audit(
    path: Path,
    policy: UnknownPolicy | None = None,
    allow_plugins: bool = False,
    volumes: bool = False,
    measured_only: bool = False,
) -> Audit:
    """Check every decision of a log.

    Args:
        path: The log.
        policy: Unknown policy to check paths against; by default that of the log.
        allow_plugins: Whether code that its config names may be imported.
        volumes: Whether to measure the distances of paths from the volumes of cells, too.
        measured_only: Whether paths are checked against what was measured alone, also where the
            prior map of the log admits.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    violations: list[Violation] = []
    counts: Counter[str] = Counter()
    measured: list[Volumes] = []
    reasons = ReasonCheck()
    cells: list[Rests] = []
    for moment in moments(log, policy, measured_only):
        kind, found = judge(moment)
        found += _check_reason(moment, reasons)
        violations += found
        counts[kind] += 1
        if moment.config.has_layers and kind == "swept" and moment.body.policy == "forbid":
            cells.append(rests_of(moment))
        if volumes and kind == "swept" and not any(one.rule == "swept" for one in found):
            measured.append(measure(moment))
            if measured[-1].greatest_m > measured[-1].bound_m:
                text = f"{measured[-1].greatest_m:.3f} m nearer than radius and margin"
                violations.append(moment.broken("volume", text))
    decisions = counts.total()
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    return Audit(
        log=str(path),
        policy=policy or log.config.costmap.unknown_policy,
        decisions=decisions,
        swept=counts["swept"],
        stops=counts["stop"],
        recoveries=counts["recovery"],
        late=counts["late"],
        violations=tuple(violations),
        rules=dict(Counter(violation.rule for violation in violations)),
        reasons=reasons.checked,
        volumes=together(measured) if volumes else None,
        rests=all_rests(cells) if cells else None,
    )


def judge(moment: Moment) -> tuple[str, list[Violation]]:
    """Return the kind of the path of a decision, see `Way`, and its violations."""
    if text := is_malformed(moment):
        return "", [moment.broken("form", text)]
    way = judge_way(moment)
    found = [violation for check in CHECKS for violation in check(moment)]
    return way.kind, [*found, *way.violations]


def _check_reason(moment: Moment, reasons: ReasonCheck) -> list[Violation]:
    if is_malformed(moment):
        return []
    found = reasons.check(moment.decision, moment.map, moment.config, moment.mission)
    return [moment.broken("reason", text) for text in found]


def moments(
    log: Log, policy: UnknownPolicy | None = None, measured_only: bool = False
) -> Iterator[Moment]:
    """Yield every decision of a log with its map, without deciding again.

    Raises:
        InputError: The log is damaged.
    """
    runs = segments_of(log)
    priors = {run.begin: None if measured_only else prior_of(run.config) for run in runs}
    stack = SegmentedStack(runs)
    bodies = {
        run.begin: Body(run.config, run.mission, policy or run.config.costmap.unknown_policy)
        for run in runs
    }
    before: tuple[pb.Trajectory, ...] = (standing_at_start(runs[0].mission),)
    for record in log.records():
        navigator = stack.watch(record.inputs)
        run = stack.segment
        if run.config.recording is not None:  # nothing follows the trajectories
            before = (resting(navigator, record.inputs),)
        moment = Moment(
            record=record,
            config=run.config,
            mission=mission_towards(run.mission, record.inputs.goal),
            map=_admitted(navigator.map, priors[run.begin]),
            measured=navigator.map,
            version=combined_version(navigator.map.version(), navigator.labels),
            body=bodies[run.begin].placed(record.inputs.pose),
            before=before,
        )
        yield moment
        if not is_malformed(moment):
            before = (*before[-1:], record.decision.trajectory)


def _admitted(measured: Representation, prior: PriorCells | None) -> ColumnMap:
    return measured if prior is None else AdmittedMap(measured, prior)
