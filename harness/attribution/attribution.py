"""Attribution at the end of an episode, before its result is written."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.attribution.case import Case, moments_of
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.goals import leg_towards
from wayproof.harness.log.codec.messages import read_unfinished
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.recompute.rebuild import segment_of
from wayproof.harness.result import Contact, Result
from wayproof.harness.scenario.scenario import Scenario


def with_cause(result: Result, scenario: Scenario, log: LogWriter) -> Result:
    """Return the result of a failure, which is no error, with its cause.

    Args:
        result: Result of the episode, with at least one decision.
        scenario: Scenario of the episode.
        log: Its full log, without a result yet.

    Raises:
        OSError: The log cannot be written or read.
    """
    log.flush()
    moments = tuple(moments_of(read_unfinished(log.partial_path)))
    if len(moments) != result.decisions:
        raise OSError(
            f"log '{log.partial_path}': {len(moments)} decisions can be read, "
            f"expected the {result.decisions} that were written"
        )
    case = Case(
        config=scenario.config,
        mission=leg_towards(scenario.mission, moments[-1].goal),
        segments=(segment_of(scenario),),
        outcome=result.outcome,
        reason=result.reason,
        end_s=result.sim_time_s,
        contact=Contact.from_text(result.contact),
        moments=moments,
        space=TrueSpace(scenario.scene.mjcf),
    )
    finding = find_cause(case)
    assert finding is not None
    return replace(
        result,
        cause=finding.cause,
        cause_evidence=finding.evidence,
        cause_decision=finding.decision,
    )
