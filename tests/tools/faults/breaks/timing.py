"""Faults of timing: decisions come too late."""

from __future__ import annotations

from tests.tools.faults.breaks.broken import Broken, Kind, Rng
from wayproof.harness.result import Result
from wayproof.harness.scenario.scenario import Scenario


def _late(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let decisions take longer than their deadline allows."""
    return Broken(perturbation="latency:5")


def _planning(sound: Scenario, result: Result, rng: Rng) -> Broken:
    """Let planning alone take longer than the deadline."""
    return Broken(settings=(f"latency.plan={rng.uniform(0.25, 0.6):.3f}",))


KINDS = {"late": Kind("latency", _late), "planning": Kind("latency", _planning)}
