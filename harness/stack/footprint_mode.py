"""How wide a long body is taken: as the disc about it where that leads on, else as it lies.

Where the disc about a body fits, it turns as it likes, and plans and motions are those of a disc:
fast, and with room to spare. Only where no such way leads on, or only one back and around, is the
body planned for by its discs at their heading, through gaps in which it cannot turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from wayproof.harness.stack.behaviour import decide
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.reasons import STUCK_INSIDE
from wayproof.harness.stack.types import Choice, Memory, View, length
from wayproof.maps.elementary import cosine
from wayproof.planners import remaining

DETOUR, WORTH = 2.0, 2.0
"""A way for the disc about the body is a detour where it is so many times as long as the one that
it replaces, and so many metres more. A gap that is too narrow for the disc looks wide enough from
afar, where what bounds it is hardly seen: without this a robot went to and fro between two ways."""


def decide_by_width(
    wide: View, as_it_lies: Callable[[], View], memory: Memory
) -> tuple[Choice, Memory, View]:
    """Choose the next action as a disc, or if that leads nowhere or far as discs at their heading.

    Args:
        wide: The view for the disc about the body.
        as_it_lies: Makes the same for the body as it lies, which is seldom asked for.
        memory: Of the last decision.

    Returns:
        The choice, the memory that it leaves, and the view that it was made on.
    """
    if memory.slender and not _widens(wide, memory):
        slender = as_it_lies()
        return *decide(slender, memory), slender
    as_disc, after = decide(wide, replace(memory, slender=False))
    farthest = DETOUR * _left(memory, wide) + WORTH
    if _leads_on(as_disc) and _way(after) <= farthest:
        return as_disc, after, wide
    slender = as_it_lies()
    as_discs, squeezed = decide(slender, replace(memory, slender=True))
    if _leads_on(as_discs) and (not _leads_on(as_disc) or _way(squeezed) <= farthest):
        return as_discs, squeezed, slender
    return as_disc, after, wide


def _widens(wide: View, memory: Memory) -> bool:
    """Whether the rest of a way begun as discs is one for the disc about the body, too."""
    if memory.guide is None:
        return True
    now = memory.trajectory.at(wide.effect_ns)
    guide = remaining(memory.guide, now.arc_length)
    if wide.passable.free_length(guide) < length(guide) - 1e-6:
        return False
    if not wide.admitted.is_free(now.position):
        return False
    return cosine(heading_at(guide, 0.0) - now.heading) > 0.0  # not tail first


def _left(memory: Memory, view: View) -> float:
    """Length of what is left of the way to the goal, as long as it was known, m."""
    if memory.guide is None or memory.on_errand:
        return math.inf
    return length(remaining(memory.guide, memory.trajectory.at(view.effect_ns).arc_length))


def _way(memory: Memory) -> float:
    """Length of the way to the goal that a decision leaves, m; without one it is endless."""
    return math.inf if memory.guide is None or memory.on_errand else length(memory.guide)


def _leads_on(choice: Choice) -> bool:
    """Whether the robot moves, turns or has arrived; who brakes first has to come to rest."""
    if choice.reason.kind in STUCK_INSIDE or choice.action == "abort":
        return False
    return choice.action != "stop_and_wait" or choice.trajectory.duration_s > 0.0
