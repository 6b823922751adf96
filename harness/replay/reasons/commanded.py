"""Reasons of decisions that follow, or cut, the command of a stack on trial."""

from __future__ import annotations

from collections.abc import Iterator

from wayproof.harness.config import BUILTIN
from wayproof.harness.log.paths import length
from wayproof.harness.replay.reasons.along import ARC, ARC_SHARE
from wayproof.harness.replay.reasons.overlap import free_before
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb


def commanded(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body has room all along the command, by the referee's map."""
    yield from _on_trial(scene, ("admitted",), cut=False)
    longest = length(scene.path)
    if reason.free_m > longest + ARC + ARC_SHARE * longest:
        yield f"free_m is {reason.free_m:.3f}, the path is {longest:.3f} long"
    yield from free_before(scene, scene.path, longest)


def commanded_without_proof(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the command leads on after the body's room ends."""
    yield from _on_trial(scene, ("unknown", "blocked"), cut=False)
    yield from free_before(scene, scene.path, reason.free_m - ARC)


def guard_braking(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the guard was on, and the command not admitted."""
    yield from _on_trial(scene, ("unknown", "blocked"), cut=True)
    if not scene.config.stack.guard:
        yield "the guard was off"


def _on_trial(scene: Scene, verdicts: tuple[str, ...], *, cut: bool) -> Iterator[str]:
    if scene.config.stack.name == BUILTIN:
        yield "no stack was on trial"
    verdict = scene.decision.verdict
    if verdict.verdict not in verdicts:
        yield f"the verdict is {verdict.verdict or 'missing'}"
    if verdict.cut != cut:
        yield "the guard cut it" if verdict.cut else "the guard did not cut it"
