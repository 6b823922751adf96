"""Checking that each decision's reason is true, by code that shares nothing with what gave it.

A reason is a predicate with figures (`harness.stack.reasons`). They are worked out anew from the
map of that decision, cell by cell, from the logged pose, and from what the decisions before said.
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
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reasons import MEANINGS, logged_reason, sentence
from wayproof.maps import Representation

__all__ = ["PREDICATES", "ReasonCheck"]

FARTHEST = 10.0
"""So far outside of the operating area a point may lie, m."""

GREATEST = 1e5
"""Of a length, m, a time, s, or an angle, rad."""

MADE_OF = {
    "turn_degrees": "turn_rad",
    "speed_percent": "speed_share",
    "delay_ms": "delay_s",
    "deadline_ms": "deadline_s",
}
"""Figures of a sentence that are other logged figures."""


class ReasonCheck:
    """Takes one log's decisions in order.

    Attributes:
        checked: How many reasons it has held against their map.
    """

    def __init__(self, required: bool = True) -> None:
        """Know of no decision.

        Args:
            required: Whether each decision must have a reason with figures: not before format 5.
        """
        self._past = Past()
        self._required = required
        self.checked = 0

    def check(
        self, decision: pb.Decision, built: Representation, config: Config, mission: Mission
    ) -> list[str]:
        """What is false of the reason of the next decision.

        Args:
            decision: With the pose and the path that the reason speaks of.
            built: The map of that decision, as the log's sweeps give it.
            config: Of the decision.
            mission: Likewise.

        Returns:
            A text for each part that does not hold.
        """
        found: list[str] = []
        if decision.HasField("predicate"):
            scene = Scene(decision, built, config, mission)
            found = list(self._false(scene))
            self.checked += 1
        elif self._required:
            found = ["there is no reason with figures"]
        self._past.take(decision)
        return found

    def pass_by(self, decision: pb.Decision) -> None:
        """Take the next decision as it stands, unchecked."""
        self._past.take(decision)

    def _false(self, scene: Scene) -> Iterator[str]:
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
            yield "its words are others than its figures make"
        if decision.action not in meaning.actions:
            yield f"{kind} is no reason to {decision.action}"
        if decision.label not in meaning.labels:
            yield f"{kind} does not go with label {decision.label}"
        try:
            for text in PREDICATES[kind](scene, self._past, reason):
                yield f"{kind}: {text}"
        except (ArithmeticError, LookupError, ValueError) as error:
            yield f"{kind}: nothing can be worked out from its figures ({error})"


def _out_of_bounds(scene: Scene, reason: pb.Reason) -> str:
    """The first figure that no decision in the operating area has."""
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
    """Names of the logged figures in a sentence."""
    names = [name for _, name, _, _ in string.Formatter().parse(text) if name]
    return [MADE_OF.get(name, name) for name in names]


def _has(reason: pb.Reason, name: str) -> bool:
    if name == "cell_state":
        return bool(reason.cell_state)
    return reason.HasField(name)
