"""Auditing a log: every decision against all checks, and what there was to check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recompute.segments import SegmentedStack, segments_of
from wayproof.harness.replay.audit.body import Body
from wayproof.harness.replay.audit.moment import Moment, Violation, standing_at_start
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
from wayproof.maps import UnknownPolicy

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
)
"""What every decision is held against, apart from its way."""


@dataclass(frozen=True)
class Audit:
    """What an audit of one log found.

    Attributes:
        log: The log's path.
        policy: That paths were held against.
        decisions: Decisions looked at.
        swept: Of these, with a path that leads somewhere, checked cell by cell.
        stops: Of the others, the ones that brake because what the path before leads through is no
            longer admitted: along that path, or off it where that keeps farther away.
        recoveries: Of the others, the ones that step out of the inflation.
        late: Of the others, the ones past their deadline; the trajectory before them stands.
        violations: In order.
        rules: How many of them broke which rule.
        reasons: How many reasons were checked; none of a log of before format 5.
        volumes: How near the swept paths come to the volumes of cells; none if not measured.
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


def audit(
    path: Path,
    policy: UnknownPolicy | None = None,
    allow_plugins: bool = False,
    volumes: bool = False,
) -> Audit:
    """Check every decision of a log.

    Args:
        path: The log.
        policy: What to hold paths against in place of the log's own unknown policy.
        allow_plugins: Whether code that its config names may be imported.
        volumes: Whether to measure the swept paths' distances from the volumes of cells, too.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    violations: list[Violation] = []
    counts: Counter[str] = Counter()
    measured: list[Volumes] = []
    reasons = ReasonCheck(required=not log.not_compared)
    for moment in moments(log, policy):
        kind, found = judge(moment)
        found += _check_reason(moment, reasons)
        violations += found
        counts[kind] += 1
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
    )


def judge(moment: Moment) -> tuple[str, list[Violation]]:
    """The kind of a decision's way, as `Way` has it, and each rule that the decision breaks."""
    if text := is_malformed(moment):
        return "", [moment.broken("form", text)]
    way = judge_way(moment)
    found = [violation for check in CHECKS for violation in check(moment)]
    return way.kind, [*found, *way.violations]


def _check_reason(moment: Moment, reasons: ReasonCheck) -> list[Violation]:
    if is_malformed(moment):
        return []
    told = reasons.check(moment.decision, moment.map, moment.config, moment.mission)
    return [moment.broken("reason", text) for text in told]


def moments(log: Log, policy: UnknownPolicy | None = None) -> Iterator[Moment]:
    """Every decision of a log with the map as it was then; nothing is decided anew.

    Raises:
        InputError: The log is damaged.
    """
    runs = segments_of(log)
    stack = SegmentedStack(runs)
    bodies = {
        run.begin: Body(run.config, run.mission, policy or run.config.costmap.unknown_policy)
        for run in runs
    }
    before: tuple[pb.Trajectory, ...] = (standing_at_start(runs[0].mission),)
    for record in log.records():
        navigator = stack.watch(record.inputs)
        run = stack.segment
        moment = Moment(
            record=record,
            config=run.config,
            mission=run.mission,
            map=navigator.map,
            version=combined_version(navigator.map.version(), navigator.labels),
            body=bodies[run.begin],
            before=before,
        )
        yield moment
        if not is_malformed(moment):
            before = (*before[-1:], record.decision.trajectory)
