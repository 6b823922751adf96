"""One episode with a planted fault, and the cause found."""

from __future__ import annotations

from typing import NamedTuple


class Judged(NamedTuple):
    """One episode with a planted fault.

    Attributes:
        planted: Name of the fault.
        expected: Causes that are right.
        found: The cause found; the outcome without one.
        seed: Seed of the episode.
        outcome: Outcome of the episode.
        text: Evidence of the cause, and where the episode was.
        troubles: What else went wrong; a contradiction of the cause is of an audit.
    """

    planted: str
    expected: tuple[str, ...]
    found: str
    seed: int
    outcome: str
    text: str
    troubles: tuple[str, ...] = ()

    @property
    def right(self) -> bool:
        """Whether the cause is that of the fault."""
        return self.found in self.expected and not any("audit" in one for one in self.troubles)

    def line(self) -> str:
        """Return the episode in a line, marked unless all is right, and its troubles."""
        mark = " " if self.right and not self.troubles else "*"
        head = f"{mark} {self.planted} {self.seed}: {self.outcome}, {self.found}: {self.text}"
        return "\n    ".join([head, *self.troubles])
