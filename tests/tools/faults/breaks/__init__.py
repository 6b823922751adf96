"""Single changes that make a successful episode fail, so that the cause is known.

Each kind takes an episode that reached its goal and changes one thing. If the changed episode
fails, undoing that one thing makes the failure go away.
"""

from tests.tools.faults.breaks import body, changing, hidden, no_way, pose, ranges, stack, timing
from tests.tools.faults.breaks.broken import Broken, Kind

__all__ = ["KINDS", "Broken", "Kind"]

KINDS: dict[str, Kind] = {
    name: kind
    for part in (pose, ranges, hidden, changing, body, timing, stack, no_way)
    for name, kind in part.KINDS.items()
}
"""Kinds of changes by name."""
