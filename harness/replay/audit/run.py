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
from wayproof.harness.replay.audit.committed import (
    Committed,
    Violation,
    resting,
    standing_at_start,
)
from wayproof.harness.replay.audit.evidence import (
    AdmittedMap,
    Filtered,
    Rests,
    all_rests,
    check_evidence,
    prior_of,
    rests_of,
)
from wayproof.harness.replay.audit.motion import (
    check_deadline,
    check_joint,
    check_limits,
    check_rest,
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
from wayproof.maps import Representation, UnknownPolicy
from wayproof.maps.columns import ColumnMap

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
        reasons: Number of reasons that were checked; 0 for a log of a format before 5.
        volumes: Distances of the swept paths from the volumes of cells; None if not measured.
        rests: Cells of the swept paths by what they rest on; None without a prior map or
            prediction, and where the policy admits unknown cells.
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
    volumes: Volumes | None = None
    rests: Rests | None = None
    filtered: Filtered | None = None


def audit(
    path: Path,
    policy: UnknownPolicy | None = None,
    allow_plugins: bool = False,
    volumes: bool = False,
    measured_only: bool = False,
    as_measured: bool = False,
) -> Audit:
    """Check every decision of a log.

    Args:
        path: The log.
        policy: As of `Auditor`.
        allow_plugins: Whether code that its config names may be imported.
        volumes: As of `Auditor`.
        measured_only: As of `Auditor`.
        as_measured: As of `Auditor`.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    auditor = Auditor(policy, volumes=volumes, measured_only=measured_only, as_measured=as_measured)
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
        volumes: bool = False,
        measured_only: bool = False,
        as_measured: bool = False,
    ) -> None:
        """Start before the first decision.

        Args:
            policy: Unknown policy to check paths against; by default that of the log.
            volumes: Whether to measure the distances of paths from the volumes of cells, too.
            measured_only: Whether paths are checked against what was measured alone, also where
                the prior map of the log admits.
            as_measured: Whether paths are checked against the map of the returns as they came,
                without the word of a filter; the moments have to keep it.
        """
        self._policy, self._measured_only = policy, measured_only
        self._as_measured = as_measured
        self._filtered: Filtered | None = None
        self._changed: Mapping[str, int] = {}
        self._config: Config | None = None
        self._prior: PriorCells | None = None
        self._before: tuple[pb.Trajectory, ...] = ()
        self._kinds: Counter[str] = Counter()
        self._reasons = ReasonCheck()
        self._cells: list[Rests] = []
        self._volumes: list[Volumes] | None = [] if volumes else None
        self.violations: list[Violation] = []

    def __call__(self, moment: Moment) -> None:
        """Check the next decision."""
        committed = self.committed(moment)
        kind, found = judge(committed, as_measured=self._as_measured)
        if not committed.malformed:
            found += self._check_reason(committed)
        self.follow(committed)
        self.violations += found
        self._kinds[kind] += 1
        if kind != "swept":
            return
        if committed.returns is not None:
            self._filtered = (self._filtered or Filtered()).with_one(committed)
            self._changed = moment.navigator.mapper.filters.changed
        if committed.config.has_layers and committed.body.policy == "forbid":
            self._cells.append(rests_of(committed))
        if self._volumes is not None and not any(one.rule == "swept" for one in found):
            self._volumes.append(measure(committed))
            if self._volumes[-1].greatest_m > self._volumes[-1].bound_m:
                text = f"{self._volumes[-1].greatest_m:.3f} m nearer than radius and margin"
                self.violations.append(committed.broken("volume", text))

    def committed(self, moment: Moment) -> Committed:
        """Return what the next decision committed to, with the body and the map to check it by."""
        record, config, navigator = moment.record, moment.config, moment.navigator
        if config is not self._config:
            self._config = config
            self._prior = None if self._measured_only else prior_of(config)
        if config.recording is not None:  # nothing follows the trajectories
            self._before = (resting(navigator, record.inputs),)
        policy = self._policy or config.costmap.unknown_policy
        return Committed(
            record=record,
            config=config,
            mission=moment.mission,
            map=_admitted(navigator.map, self._prior),
            measured=navigator.map,
            version=navigator.mapper.version(),
            body=Body(config, moment.mission, policy).placed(record.inputs.pose),
            before=self._before or (standing_at_start(moment.mission),),
            returns=navigator.mapper.returns,
        )

    def follow(self, committed: Committed) -> None:
        """Let the next decision begin on the trajectory of this one, if it is one."""
        if not committed.malformed:
            self._before = (*committed.before[-1:], committed.decision.trajectory)

    def audit(self, log: Log) -> Audit:
        """Return the result for a log whose decisions were all checked.

        Raises:
            InputError: There was none.
        """
        decisions = self._kinds.total()
        if decisions == 0:
            raise InputError(f"log '{log.path}': no decisions in it")
        filtered = self._filtered and replace(self._filtered, returns=dict(self._changed))
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
            reasons=self._reasons.checked,
            volumes=None if self._volumes is None else together(self._volumes),
            rests=all_rests(self._cells) if self._cells else None,
            filtered=filtered,
        )

    def _check_reason(self, committed: Committed) -> list[Violation]:
        found = self._reasons.check(
            committed.decision, committed.map, committed.config, committed.mission
        )
        return [committed.broken("reason", text) for text in found]


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
    way = judge_way(swept)
    found = [violation for check in CHECKS for violation in check(committed)]
    return way.kind, [*found, *way.violations]


def _admitted(measured: Representation, prior: PriorCells | None) -> ColumnMap:
    return measured if prior is None else AdmittedMap(measured, prior)
