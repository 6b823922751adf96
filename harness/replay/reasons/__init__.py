"""Check of the reasons of decisions, by code that shares nothing with the planner.

A reason is a predicate with figures (`harness.stack.reasons`). Both are computed again from the map
of the decision, cell by cell, from the logged pose, and from the decisions before.
"""

from __future__ import annotations

import string
from collections.abc import Iterator

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.predicates import PREDICATES
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.replay.reasons.uncertain import slowed, slowed_by_noise
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reason_sentences import MEANINGS, sentence
from wayproof.harness.stack.reasons import logged_reason
from wayproof.maps.columns import ColumnMap

__all__ = ["PREDICATES", "ReasonCheck"]

FARTHEST = 10.0
"""Greatest distance of a point outside the operating area, m."""

GREATEST = 1e5
"""Greatest length, m, time, s, or angle, rad."""

MADE_OF = {
    "turn_degrees": "turn_rad",
    "speed_percent": "speed_share",
    "delay_ms": "delay_s",
    "deadline_ms": "deadline_s",
}
"""Logged figure behind each figure of a sentence that has another unit."""


class ReasonCheck:
    """Check of the reasons of one log, decision by decision in order.

    Attributes:
        checked: Number of reasons checked so far.
    """

    def __init__(self) -> None:
        """Start before the first decision."""
        self._past = Past()
        self.checked = 0

    def check(
        self, decision: pb.Decision, built: ColumnMap, config: Config, mission: Mission
    ) -> list[str]:
        """Return the false parts of the reason of the next decision.

        Args:
            decision: Decision with its pose and paths.
            built: Map of the decision, rebuilt from the sweeps.
            config: Settings of the decision.
            mission: Mission of the decision.

        Returns:
            One text for each false part.
        """
        found: list[str] = []
        if decision.HasField("predicate"):
            if config.recording is not None:
                self._past.stand(decision)
            scene = Scene(decision, built, config, mission)
            found = list(self._contradictions(scene))
            self.checked += 1
        else:
            found = ["there is no reason with figures"]
        self._past.take(decision)
        return found

    def pass_by(self, decision: pb.Decision) -> None:
        """Record the next decision without checking it."""
        self._past.take(decision)

    def _contradictions(self, scene: Scene) -> Iterator[str]:
        decision = scene.decision
        reason, kind = decision.predicate, decision.predicate.kind
        meaning = MEANINGS.get(kind)  # type: ignore[call-overload]
        if meaning is None:
            yield f"there is no reason '{kind[:40]}'"
            return
        missing = [name for name in figures_of(meaning.text) if not _has(reason, name)]
        if "cell" in figures_of(meaning.text) and not reason.HasField("place"):
            missing.append("place")
        if missing:
            yield f"{kind} without {', '.join(missing)}"
            return
        if text := _out_of_bounds(scene, reason):
            yield f"{kind}: {text}"
            return
        if decision.reason != sentence(logged_reason(reason)):
            yield "its sentence is not that of its figures"
        if decision.action not in meaning.actions:
            yield f"{kind} is no reason to {decision.action}"
        if decision.label not in meaning.labels:
            yield f"{kind} does not go with label {decision.label}"
        try:
            for text in PREDICATES[kind](scene, self._past, reason):
                yield f"{kind}: {text}"
            if decision.action == "slow" and reason.HasField("sigma_m"):
                yield from slowed(scene, reason)
            if decision.action == "slow" and reason.HasField("range_sigma_m"):
                yield from slowed_by_noise(scene, reason)
        except (ArithmeticError, LookupError, ValueError) as error:
            yield f"{kind}: nothing can be worked out from its figures ({error})"


def _out_of_bounds(scene: Scene, reason: pb.Reason) -> str:
    """Return a text for the first figure that is out of range; empty without one."""
    low, high = np.array([scene.mission.low, scene.mission.high])
    for field, value in reason.ListFields():
        if isinstance(value, pb.Point):
            point = np.array([value.x, value.y, value.z])
            if not ((low - FARTHEST <= point) & (point <= high + FARTHEST)).all():
                return f"{field.name} is not in the operating area"
        elif isinstance(value, float) and not abs(value) <= GREATEST:
            return f"{field.name} is {value:g}"
    return ""


def figures_of(text: str) -> list[str]:
    """Return the names of the logged figures in a sentence."""
    names = [name for _, name, _, _ in string.Formatter().parse(text) if name]
    return [MADE_OF.get(name, name) for name in names]


def _has(reason: pb.Reason, name: str) -> bool:
    if name == "cell_state":
        return bool(reason.cell_state)
    return reason.HasField(name)
