"""Events of an episode: late decisions, stops, contacts, the last chance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from wayproof.harness.log.reader import Log
from wayproof.harness.schema import wayproof_pb2 as pb

LATE, STOP, CONTACT, LAST_CHANCE = "deadline missed", "stop", "contact", "last chance"

COLOURS = {
    LATE: (224, 176, 0),
    STOP: (210, 105, 30),
    CONTACT: (255, 0, 0),
    LAST_CHANCE: (240, 60, 240),
}
"""Colours of the kinds of events: red, green, blue."""

PLOTS = {LATE: "delay", STOP: "clearance", CONTACT: "clearance", LAST_CHANCE: "clearance"}
"""Curves that the kinds of events are marked on."""

RESTS = ("stop_and_wait", "abort")
"""Actions that bring the robot to rest."""


def name_of(kind: str) -> str:
    """Return the name of an entity or topic for a kind of event."""
    return kind.replace(" ", "_")


class Event(NamedTuple):
    """One event.

    Attributes:
        kind: One of those of `COLOURS`.
        words: Description of the event.
        mark: Description in a few words, for a mark in space.
    """

    kind: str
    words: str
    mark: str


class Events:
    """Events of one log, decision by decision in order.

    Attributes:
        last_chance: Number of the last decision that could have prevented a failure; -1 if none.
    """

    def __init__(self, log: Log) -> None:
        """Read the last chance from the result of the log."""
        number = log.result.get("cause_decision", "")
        self.last_chance = int(number) if number.isdecimal() else -1
        self._cause = f"{log.result.get('cause', '')}: {log.result.get('cause_evidence', '')}"
        self._rests = self._cut = False
        self._contacts = 0

    def at(self, decision: pb.Decision, truth: pb.Truth) -> Iterator[Event]:
        """Yield the events of a decision; call for each."""
        if decision.sequence == self.last_chance:
            yield Event(LAST_CHANCE, self._cause, "last chance")
        if decision.deadline_missed:
            delay, deadline = decision.delay_s * 1e3, decision.deadline_s * 1e3
            words = f"{delay:.0f} ms of {deadline:.0f} ms"
            yield Event(LATE, words, f"deadline missed: {words}")
        rests, cut = decision.action in RESTS, decision.verdict.cut
        if rests and not self._rests:
            yield Event(STOP, f"{decision.action}: {decision.reason}", decision.action)
        elif cut and not self._cut:
            yield Event(STOP, f"the guard brakes: {decision.reason}", "the guard brakes")
        self._rests, self._cut = rests, cut
        contacts = truth.collisions + truth.hit_by_mover
        if contacts > self._contacts:
            self._contacts = contacts
            yield Event(CONTACT, f"contact {contacts}", f"contact {contacts}")
