"""Faults of the pose."""

from __future__ import annotations

from tests.tools.faults.breaks.broken import Broken, Kind, Rng
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario


def _jump(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the pose jump by a decimetre or a metre."""
    return Broken(perturbation=f"pose_jump:{rng.uniform(3.0, 5.0):.2f}")


def _drift(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let the pose drift away with the distance travelled."""
    return Broken(perturbation=f"pose_drift:{rng.uniform(3.5, 5.0):.2f}")


def _heading_drift(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Estimate by dead reckoning with a scale error of its turns."""
    return Broken(settings=(f"pose_model.yaw_scale_sigma={rng.uniform(0.1, 0.4):.3f}",))


def _dead_reckoning(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Estimate by dead reckoning with a scale error of its distances, stated as such."""
    return Broken(settings=(f"pose_model.scale_sigma={rng.uniform(0.05, 0.2):.3f}",))


KINDS = {
    "pose_jump": Kind("localization", _jump),
    "pose_drift": Kind("localization", _drift),
    "heading_drift": Kind("localization", _heading_drift),
    "dead_reckoning": Kind("localization", _dead_reckoning),
}
