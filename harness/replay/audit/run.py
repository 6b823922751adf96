"""Audit of a log: every decision against all checks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.judge.body import Body
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.prior.cells import PriorCells
from wayproof.harness.recompute.moments import Moment, moments
from wayproof.harness.replay.audit.committed import Committed, Violation, hold
from wayproof.harness.replay.audit.evidence import (
    AdmittedMap,
    Filtered,
    check_evidence,
    filtered_length,
    prior_of,
)
from wayproof.harness.replay.audit.facts import Past
from wayproof.harness.replay.audit.reasons import false_parts
from wayproof.harness.replay.audit.rules import (
    check_deadline,
    check_figures,
    check_inputs,
    check_joint,
    check_limits,
    check_margin,
    check_rest,
    check_settings,
    check_version,
)
from wayproof.harness.replay.audit.way import judge_way
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import UnknownPolicy

CHECKS: tuple[Callable[[Committed], list[Violation]], ...] = (
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
        reasons: Number of reasons that were checked.
        filtered: The swept paths by the word of a filter of returns; None where none was swept, or
            the map of the returns as they came was not kept.
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
    filtered: Filtered | None = None


def audit(
    path: Path,
    policy: UnknownPolicy | None = None,
    allow_plugins: bool = False,
    measured_only: bool = False,
    as_measured: bool = False,
) -> Audit:
    """Check every decision of a log.

    Args:
        path: The log.
        policy: As of `Auditor`.
        allow_plugins: Whether code that its config names may be imported.
        measured_only: As of `Auditor`.
        as_measured: As of `Auditor`.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    auditor = Auditor(policy, measured_only=measured_only, as_measured=as_measured)
    for moment in moments(log, returns=True):
        auditor(moment)
    return auditor.audit(log)


class Auditor:
    """Observer of the decisions of a log that checks each in order.

    Attributes:
        violations: Violations so far.
    """

    def __init__(
        self,
        policy: UnknownPolicy | None = None,
        *,
        measured_only: bool = False,
        as_measured: bool = False,
    ) -> None:
        """Start before the first decision.

        Args:
            policy: Unknown policy to check paths against; by default that of the log.
            measured_only: Whether paths are checked against what was measured alone, also where
                the prior map of the log admits.
            as_measured: Whether paths are checked against the map of the returns as they came,
                without the word of a filter; the moments have to keep it.
        """
        self._policy, self._measured_only = policy, measured_only
        self._as_measured = as_measured
        self._ways: list[tuple[int, float, float]] = []  # of those swept: number, length, filtered
        self._changed: Mapping[str, int] = {}
        self._config: Config | None = None
        self._prior: PriorCells | None = None
        self._before: tuple[pb.Trajectory, ...] = ()
        self._kinds: Counter[str] = Counter()
        self._past, self._reasons = Past(), 0
        self.violations: list[Violation] = []

    def __call__(self, moment: Moment) -> None:
        """Check the next decision."""
        committed = self.committed(moment)
        kind, found = judge(committed, as_measured=self._as_measured)
        if not committed.malformed:
            found += [committed.broken("reason", one) for one in false_parts(committed, self._past)]
            self._reasons += committed.decision.HasField("predicate")
        self.violations += found
        self._kinds[kind] += 1
        if kind == "swept" and committed.returns is not None:
            part = filtered_length(committed)
            self._ways.append((committed.decision.sequence, committed.length, part))
            self._changed = moment.navigator.mapper.filters.changed
        self.follow(committed)

    def committed(self, moment: Moment) -> Committed:
        """Return what the next decision committed to, with the body and the map to check it by."""
        record, config, navigator = moment.record, moment.config, moment.navigator
        inputs, mission, measured = record.inputs, moment.mission, navigator.map
        if config is not self._config:
            self._config = config
            self._prior = None if self._measured_only else prior_of(config)
        if config.recording is not None:  # nothing follows the trajectories
            here = navigator.mapper.planning_point(inputs.pose.position).tolist()
            self._before = (hold(here, inputs.pose.heading, inputs.time_ns),)
        policy = self._policy or config.costmap.unknown_policy
        return Committed(
            record=record,
            config=config,
            mission=mission,
            map=measured if self._prior is None else AdmittedMap(measured, self._prior),
            measured=measured,
            version=navigator.mapper.version(),
            body=Body(config, mission, policy).placed(inputs.pose),
            before=self._before or (hold(mission.start, mission.start_heading),),
            returns=navigator.mapper.returns,
        )

    def follow(self, committed: Committed) -> None:
        """Let the next decision begin on the trajectory of this one, if it is one."""
        if not committed.malformed:
            self._before = (*committed.before[-1:], committed.decision.trajectory)
            self._past.take(committed.decision)

    def audit(self, log: Log) -> Audit:
        """Return the result for a log whose decisions were all checked.

        Raises:
            InputError: There was none.
        """
        decisions = self._kinds.total()
        if decisions == 0:
            raise InputError(f"log '{log.path}': no decisions in it")
        return Audit(
            log=str(log.path),
            policy=self._policy or log.config.costmap.unknown_policy,
            decisions=decisions,
            swept=self._kinds["swept"],
            stops=self._kinds["stop"],
            recoveries=self._kinds["recovery"],
            late=self._kinds["late"],
            violations=tuple(self.violations),
            rules=dict(Counter(violation.rule for violation in self.violations)),
            reasons=self._reasons,
            filtered=self._filtered(),
        )

    def _filtered(self) -> Filtered | None:
        if not self._ways:
            return None
        return Filtered(
            way_m=sum(way for _, way, _ in self._ways),
            filtered_m=sum(part for _, _, part in self._ways),
            decisions=tuple((number, part) for number, _, part in self._ways if part > 0.0),
            returns=dict(self._changed),
        )


def judge(committed: Committed, *, as_measured: bool = False) -> tuple[str, list[Violation]]:
    """Return the kind of the path of a decision, see `Way`, and its violations.

    Args:
        committed: What the decision committed to.
        as_measured: Whether its path is checked against the map of the returns as they came.
    """
    if text := committed.malformed:
        return "", [committed.broken("form", text)]
    swept = committed
    if as_measured:
        assert committed.returns is not None
        swept = replace(committed, map=committed.returns)
    found = [violation for check in CHECKS for violation in check(committed)]
    way = judge_way(swept)  # within the cells that the clearance was looked for in
    return way.kind, [*found, *way.violations]
