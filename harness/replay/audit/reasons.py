"""Check of the reasons of decisions, by code that shares nothing with the planner.

A reason names one obstruction, or one plain fact (`harness.stack.reasons`). Of an obstruction the
judge asks whether the cell is what it is said to be, whether the body at the place named is too
near to it, and whether that place is on the way; of a fact, whether it holds.
"""

from __future__ import annotations

import string
from collections.abc import Iterator

import numpy as np

from wayproof.harness.replay.audit.committed import Committed
from wayproof.harness.replay.audit.facts import FACTS
from wayproof.harness.replay.audit.obstruction import is_named_truly
from wayproof.harness.replay.audit.past import Past
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reasons import MEANINGS, Kind, logged_reason, sentence

FARTHEST = 10.0
"""Greatest distance of a point outside the operating area, m."""

GREATEST = 1e5
"""Greatest length, m, time, s, or angle, rad."""

MADE_OF = {"turn_degrees": "turn_rad", "delay_ms": "delay_s", "deadline_ms": "deadline_s"}
"""Logged figure behind each figure of a sentence that has another unit."""


def false_parts(now: Committed, past: Past) -> list[str]:
    """Return one text for each false part of the reason of the decision after some others."""
    if not now.decision.HasField("predicate"):
        return ["there is no reason with figures"]
    if now.config.recording is not None:
        past.stand(now.decision)
    return list(_contradictions(now, past))


def _contradictions(now: Committed, past: Past) -> Iterator[str]:
    decision, reason = now.decision, now.reason
    if reason.kind not in MEANINGS:
        yield f"there is no reason '{reason.kind[:40]}'"
        return
    kind: Kind = reason.kind
    meaning = MEANINGS[kind]
    missing = [name for name in figures_of(meaning.text) if not reason.HasField(name)]
    if missing:
        yield f"{kind} without {', '.join(missing)}"
        return
    if text := _out_of_bounds(now):
        yield f"{kind}: {text}"
        return
    if decision.reason != sentence(logged_reason(reason)):
        yield "its sentence is not that of its figures"
    if decision.action not in meaning.actions:
        yield f"{kind} is no reason to {decision.action}"
    if decision.label not in meaning.labels:
        yield f"{kind} does not go with label {decision.label}"
    try:
        for text in (*is_named_truly(now, past), *FACTS[kind](now, past)):
            yield f"{kind}: {text}"
    except (ArithmeticError, LookupError, ValueError) as error:
        yield f"{kind}: nothing can be worked out from its figures ({error})"


def _out_of_bounds(now: Committed) -> str:
    """Return a text for the first figure that is out of range; empty without one."""
    low, high = np.array([now.mission.low, now.mission.high])
    for field, value in now.reason.ListFields():
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
