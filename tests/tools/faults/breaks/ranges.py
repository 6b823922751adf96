"""Faults of the ranges, or of their integration."""

from __future__ import annotations

from tests.tools.faults.breaks.broken import Broken, Kind, Rng
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario

UNFITTED = ("map.ground_fit=false",)
"""The floor as each beam has it: a fitted one bears most of these faults."""


def _dropout(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Lose returns."""
    mode = ("ray", "patch", "sweep")[int(rng.integers(3))]
    return Broken(UNFITTED, f"depth_dropout:{rng.uniform(2.0, 5.0):.2f}:{mode}")


def _noise(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Make ranges noisier than the device states."""
    return Broken(UNFITTED, f"depth_noise:{rng.uniform(2.5, 5.0):.2f}")


def _occlusion(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Block a sector of the view."""
    return Broken(perturbation=f"occlusion:{rng.uniform(3.0, 5.0):.2f}")


def _calibration(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Rotate the sensor against its stated mount."""
    return Broken(UNFITTED, f"calibration:{rng.uniform(3.0, 5.0):.2f}:rotation")


def _blind(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Drop near returns."""
    return Broken(settings=(f"map.minimum_range={rng.uniform(1.5, 4.0):.2f}",))


KINDS = {
    "dropout": Kind("perception", _dropout),
    "noise": Kind("perception", _noise),
    "occlusion": Kind("perception", _occlusion),
    "calibration": Kind("perception", _calibration),
    "blind": Kind("perception", _blind),
}
