"""Reasons of decisions that follow, or cut, the command of a stack on trial."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.config import BUILTIN
from wayproof.harness.log.paths import Array, arc_at, arc_lengths, length, place_at
from wayproof.harness.replay.reasons.along import ARC, ARC_SHARE
from wayproof.harness.replay.reasons.overlap import cell_on_way, free_before
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb


def commanded(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body has room all along the command, by the referee's map.

    A body that keeps its place exactly sweeps nothing, and is admitted wherever it is.
    """
    yield from _on_trial(scene, ("admitted",), cut=False)
    ahead = _ahead(scene)
    yield from _no_longer(reason, ahead)
    if not _keeps_its_place(scene, ahead):
        yield from free_before(scene, ahead, length(ahead))


def commanded_without_proof(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the command leads on after the body's room ends, where a cell ends it."""
    yield from _on_trial(scene, ("unknown", "blocked"), cut=False)
    ahead = _ahead(scene)
    yield from _no_longer(reason, ahead)
    yield from free_before(scene, ahead, reason.free_m - ARC)
    if reason.cell_state:  # else it leaves the operating area
        yield from cell_on_way(scene, reason, ahead, scene.unknown_blocks)


def _ahead(scene: Scene) -> Array:
    """Return the part of the path that is not yet driven when the decision takes effect, (n, 3)."""
    trajectory = scene.decision.trajectory
    begin, arcs = arc_at(trajectory, scene.effect_ns), arc_lengths(scene.path)
    return np.vstack((place_at(trajectory, scene.effect_ns), scene.path[arcs > begin]))


def _keeps_its_place(scene: Scene, ahead: Array) -> bool:
    """Return whether a body neither moves nor, if elongated, turns."""
    turns = bool(scene.mission.discs) and np.ptp(scene.decision.trajectory.heading) > 0.0
    return length(ahead) == 0.0 and not turns


def _no_longer(reason: pb.Reason, ahead: Array) -> Iterator[str]:
    """Check that the free length is no greater than the path's."""
    longest = length(ahead)
    if not reason.free_m <= longest + ARC + ARC_SHARE * longest:
        yield f"free_m is {reason.free_m:.3f}, the path is {longest:.3f} long"


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
