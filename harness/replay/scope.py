"""Scope of a replay: parts of a log that are recomputed, simulated, or mere claims."""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.harness.config import BUILTIN, HASH_SEPARATOR
from wayproof.harness.ending import BETWEEN_DECISIONS
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.segments import segments_of
from wayproof.harness.result import ends_in_error, is_recovered
from wayproof.harness.stack.keyframe import has_keyframes

MADE_AGAIN = {
    (False, False): ("scene, mission and config from the seed",),
    (False, True): ("world from the seed",),
    (True, False): ("model of the robot",),
    (True, True): (),
}
"""Parts that a new simulation makes, by whether the world and the robot are files."""


@dataclass(frozen=True)
class Scope:
    """Parts of a log by how they can be checked.

    Attributes:
        recomputed: Parts that follow from the rest of the log.
        simulation: Parts that only a new simulation can check.
        claims: Parts that nobody can recompute; only a signature protects them.
    """

    recomputed: tuple[str, ...]
    simulation: tuple[str, ...]
    claims: tuple[str, ...]


def scope_of(log: Log, with_cause: bool) -> Scope:
    """Sort the parts of a log by how they can be checked.

    Args:
        log: The log.
        with_cause: Whether the cause was recomputed.
    """
    if log.config.recording is not None:
        return _scope_of_recording(log)
    result = [
        "number and times of decisions",
        "least clearance",
        "path length",
        "deadline misses",
        "commands admitted",
    ]
    physics = ["truth", "contact"] if log.result.get("contact") else ["truth"]
    if not ends_in_error(log.result):
        between = log.result["outcome"] in BETWEEN_DECISIONS
        (physics if between else result).extend(["outcome", "reason", "goal distance"])
    if log.result.get("cause"):
        (result if with_cause else physics).append("cause")
    inputs = ["poses", "streams world and control"]
    files = HASH_SEPARATOR in log.config.world, HASH_SEPARATOR in log.config.robot
    inputs.extend(MADE_AGAIN[files])
    perturbed = any(run.config.perturbation for run in segments_of(log))
    if perturbed:
        result.append("perturbation's kind, amount and delay")
        inputs.append("perturbation's effect")
    if log.record == "decisions":
        return Scope(
            recomputed=("chain where global paths are kept", *result),
            simulation=("decisions", "rest of the chain", *inputs, *physics),
            claims=_claims(log),
        )
    keyframes = ("keyframes",) if has_keyframes(log.config) else ()
    return Scope(
        recomputed=(
            "decisions",
            *keyframes,
            "chain",
            "input digests",
            "streams of inputs",
            *result,
        ),
        simulation=("sweeps", "states", *inputs, *physics),
        claims=_claims(log),
    )


def _scope_of_recording(log: Log) -> Scope:
    """Sort the parts of a recording's log: its inputs are claims without a simulation."""
    inputs = ("decisions", "chain", "input digests", "streams of inputs")
    figures = ("number and times of decisions", "way driven", "deadline misses")
    perturbed = ("perturbation's kind, amount and delay",) if log.config.perturbation else ()
    recorded = ("sweeps", "poses", "goals", "recorded way", "faults of the recording")
    return Scope((*inputs, *figures, *perturbed), (), (*recorded, *_claims(log)))


def _claims(log: Log) -> tuple[str, ...]:
    claims = ["stage latencies", "versions", "machine"]
    runs = segments_of(log)
    if any(run.config.latency.mode == "measured" for run in runs):
        claims.append("measured delays")
    for name, value in (("world", log.config.world), ("robot", log.config.robot)):
        if HASH_SEPARATOR in value:
            claims.append(f"{name} file {value}")
    if is_recovered(log.result):
        claims.append("that its end is missing")
    elif ends_in_error(log.result):
        claims.append("the error that ended it")
    if log.config.stack.name != BUILTIN:
        claims.append(f"answers of a stack named '{log.config.stack.name}'")
    if log.asked and any(HASH_SEPARATOR in name for name in (log.config.world, log.config.robot)):
        claims.append("settings as they were asked for")
    if log.check:
        claims.append("verdict of its counterfactual check")
    if log.plugins:
        claims.append("files of the user's classes")
    return tuple(claims)
