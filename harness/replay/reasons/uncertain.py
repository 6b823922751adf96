"""Predicates of a robot whose pose is uncertain."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.replay.reasons.along import point_of, same
from wayproof.harness.replay.reasons.elsewhere import errand
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

SIGMAS = 2.0
"""Standard deviations within which the goal has to be to be claimed."""


def slowed(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """Check that the standard deviation is the pose's, and too great for full speed."""
    yield from same("sigma_m", reason.sigma_m, scene.decision.position_sigma)
    if not reason.sigma_m > scene.config.behaviour.uncertain_sigma:
        yield f"a standard deviation of {reason.sigma_m:.2f} m costs no speed"


def slowed_by_noise(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """Check that the deviation of the ranges is too great for full speed."""
    if not reason.range_sigma_m > scene.config.behaviour.noisy_sigma:
        yield f"a deviation of the ranges of {reason.range_sigma_m:.3f} m costs no speed"


def returning_to_held(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way leads to where the robot has been, as the pose is lost."""
    yield from _check_uncertainty(scene, reason)
    yield from errand(scene, past, reason)
    been = [scene.apart(one.position, point_of(reason.target)) for one in past.steps.values()]
    if not been or min(been) > 0.2:
        yield "it has not been where it goes back to"


def pose_lost(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the standard deviation of the pose exceeds the allowed one."""
    yield from _check_uncertainty(scene, reason)


def goal_uncertain(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot stands at the goal by a pose too uncertain to claim it."""
    yield from same("sigma_m", reason.sigma_m, scene.decision.position_sigma)
    yield from same("limit_m", reason.limit_m, 0.8 * scene.config.episode.goal_tolerance)
    away = scene.apart(np.array(scene.decision.position), scene.goal)
    yield from same("distance_m", reason.distance_m, away)
    if away > reason.limit_m + scene.config.behaviour.goal_search_radius:
        yield "that is too far, even for a place in stead of the goal"
    if SIGMAS * reason.sigma_m <= reason.limit_m:
        yield f"a standard deviation of {reason.sigma_m:.2f} m is enough to claim it"


def _check_uncertainty(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    yield from same("sigma_m", reason.sigma_m, scene.decision.position_sigma)
    yield from same("limit_m", reason.limit_m, scene.config.behaviour.lost_sigma)
    if not reason.sigma_m > reason.limit_m:
        yield f"a standard deviation of {reason.sigma_m:.2f} m is within what is allowed"
