"""Verification of a log: does its content follow from its inputs, config and seed?

Everything that can be recomputed is: the consistency of the log, and the whole episode from the
seed, its inputs and the decisions on them. Where nothing can or shall be simulated, the decisions
are made again from the logged inputs. Either way the map is built once, and the audit observes it.
The first step that finds a difference ends the verification. The rest is listed as claims of the
author.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.log.machine import CODE, this_machine
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.replay.audit import Auditor
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.replay.content import read_content
from wayproof.harness.replay.replay import Scope, cause_differences, recompute_piece, scope_of
from wayproof.harness.replay.signature import fault_of_signature, fingerprint, signature_path
from wayproof.harness.result import ends_in_error, is_recovered
from wayproof.harness.user_code import plugins_of

Step = Literal["signature", "content", "replay", "simulation"]

MISSING_SWEEPS = "left out of the log"


@dataclass
class Verification:
    """Result of the verification of one log.

    Attributes:
        log: The log's path.
        verified: Whether everything recomputed agrees with the log.
        whole: Whether the log has the end of the episode; a recovered log, or one of failed code,
            has not.
        failed: Step that found a difference, or None.
        findings: Differences, as recorded and as recomputed.
        steps: Completed steps, in order.
        scope: Parts that were recomputed, that need a new simulation, and that are claims.
        elsewhere: Fields of the metadata `run` that differ here, which may affect a simulation.
        violations: Number of violations in the audit; None if it was not reached. They concern the
            robot, not the log.
        decisions: Number of decisions in the log; 0 if its content was not read, as its signature
            is not valid.
        outcome: Recorded outcome.
        chain: Recorded chain hash.
        signed_by: Fingerprint of the given key if its signature is valid.
        wall_time_s: Wall time, s.
    """

    log: str
    whole: bool
    outcome: str
    chain: str
    scope: Scope
    verified: bool = False
    failed: Step | None = None
    findings: tuple[Difference, ...] = ()
    steps: tuple[Step, ...] = ()
    elsewhere: tuple[Difference, ...] = ()
    violations: int | None = None
    decisions: int = 0
    signed_by: str | None = None
    wall_time_s: float = 0.0


def verify(
    path: Path,
    allow_plugins: bool = False,
    simulate: bool = True,
    key: Ed25519PublicKey | None = None,
) -> Verification:
    """Recompute everything in a log that can be recomputed.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        simulate: Whether to simulate the episode again; without it truth and outcome may be claims.
        key: Key that must have signed the log.

    Raises:
        InputError: The file is no finished log, is damaged, or holds no decision.
    """
    began = time.perf_counter()
    log = open_log(path, allow_plugins)
    if next(log.decisions(), None) is None:
        raise InputError(f"log '{path}': no decisions in it")
    result = log.result
    one = Verification(
        log=str(path),
        whole=not ends_in_error(result),
        outcome=result["outcome"],
        chain=result["chain"],
        scope=scope_of(log, with_cause=False),
    )
    one.failed, findings = _Trial(log, one, allow_plugins, simulate, key).run()
    one.verified, one.findings = one.failed is None, tuple(findings)
    if "simulation" in one.steps:
        one.scope = Scope((*one.scope.recomputed, *one.scope.simulation), (), one.scope.claims)
    if key is not None and one.failed != "signature":
        one.signed_by = fingerprint(key)
    one.wall_time_s = time.perf_counter() - began
    return one


class _Trial:
    """Steps of the verification of one log; what they find is written into its result."""

    def __init__(
        self,
        log: Log,
        result: Verification,
        allow_plugins: bool,
        simulate: bool,
        key: Ed25519PublicKey | None,
    ) -> None:
        self._log = log
        self._result = result
        self._plugins = allow_plugins
        self._simulate = simulate
        self._key = key

    def run(self) -> tuple[Step | None, list[Difference]]:
        """Run the steps until one finds a difference; return it and the differences."""
        for step, do in self._plan():
            if findings := self._do(step, do):
                if step == "simulation" and self._log.record == "full":
                    # A decision that its own inputs do not give says more than the simulation.
                    if replayed := self._do("replay", self._replay):
                        return "replay", replayed
                return step, findings
        return None, []

    def _do(self, step: Step, do: Callable[[], list[Difference]]) -> list[Difference]:
        if step not in self._result.steps:
            self._result.steps += (step,)
        try:
            return do()
        except InputError as error:  # readable, but it cannot be recomputed
            return [Difference(step, "recorded", str(error))]

    def _plan(self) -> Iterator[tuple[Step, Callable[[], list[Difference]]]]:
        if self._key is not None:
            yield "signature", self._check_signature
        yield "content", self._check_content
        # Code that ended a process may end this one, and nothing can simulate a recording.
        alone = self._broke_off_in_code() or self._log.config.recording is not None
        if self._log.record == "full" and (alone or not self._simulate):
            yield "replay", self._replay
        if alone:
            yield "content", self._check_recomputed
        elif self._simulate or self._log.record == "decisions":
            yield "simulation", self._simulate_again

    def _broke_off_in_code(self) -> bool:
        result = self._log.result
        named = plugins_of(self._log.config)
        return bool(named) and ends_in_error(result) and not is_recovered(result)

    def _check_recomputed(self) -> list[Difference]:
        """Check that something was: a log without its sweeps is verified by a simulation alone."""
        if "replay" in self._result.steps:
            return []
        return [
            Difference("sweeps", MISSING_SWEEPS, "in it: nothing else shows what it decided on")
        ]

    def _check_signature(self) -> list[Difference]:
        assert self._key is not None
        fault = fault_of_signature(self._log.path, self._key)
        name = signature_path(self._log.path).name
        return [] if fault is None else [Difference(name, fault, "a signature that holds")]

    def _check_content(self) -> list[Difference]:
        content = read_content(self._log)
        self._result.decisions = len(content.decisions)
        found = [*_code_and_version(self._log), *contradictions(self._log, content)]
        return [*found, *content.described]

    def _replay(self) -> list[Difference]:
        """Make every decision again from its inputs, and audit it on the same map."""
        log, auditor = self._log, Auditor()
        again = recompute_piece(log, log.keyframes(), observe=auditor)
        found = [
            replace(one, field=f"/decision[{again.first_difference}].{one.field}")
            for one in again.differences
        ]
        if not found and again.chain != log.result["chain"]:
            found = [Difference("result.chain", log.result["chain"], again.chain)]
        found += again.keyframe_differences
        if not found and not self._simulate:  # a new simulation attributes the cause again, too
            cause = cause_differences(log)
            self._result.scope = scope_of(log, with_cause=cause is not None)
            found += cause or []
        if not found:
            self._result.violations = len(auditor.violations)
        return found

    def _simulate_again(self) -> list[Difference]:
        """Make the inputs again from the seed, and the decisions on them, and audit those."""
        if not self._simulate:
            return [Difference("sweeps", MISSING_SWEEPS, "only a simulation gives them again")]
        auditor = Auditor()
        again = simulate_again(self._log.path, self._plugins, observe=auditor)
        self._result.elsewhere = again.elsewhere
        if not again.identical:
            assert again.findings, "a closed loop differs by nothing"
            return again.findings
        self._result.violations = len(auditor.violations)
        return []


def _code_and_version(log: Log) -> list[Difference]:
    """Check that a log recorded with the same code names the same version."""
    here = this_machine()
    if log.run.get(CODE) != here[CODE] or log.run.get("wayproof") == here["wayproof"]:
        return []
    return [Difference("run.wayproof", log.run.get("wayproof", "none"), here["wayproof"])]
