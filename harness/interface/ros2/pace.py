"""Pace of a ROS 2 stack: the command that answers a sweep, by stamps and not by arrival."""

from __future__ import annotations

from collections.abc import Iterable

from wayproof.harness.interface.ros2.inputs import Received

FIRST_NS = 1_000_000_000
"""ROS time of the first sweep, ns; in ROS, time 0 is none."""


class Unexpected(Exception):
    """A command that answers no sweep, in words."""


def answer_to(sweep_ns: int, commands: Iterable[Received]) -> Received | None:
    """Return the command with a sweep's stamp; those with an earlier one answer an earlier sweep.

    Raises:
        Unexpected: A command has no stamp, or a later one.
    """
    for one in commands:
        if one.stamp_ns == sweep_ns:
            return one
        if one.stamp_ns is None:
            raise Unexpected("a Twist, which has no stamp")
        if one.stamp_ns > sweep_ns:
            raise Unexpected(f"stamp {one.stamp_ns * 1e-9:.9f} s")
    return None


def made_after(clock_ns: int, ticked_ns: int, commands: Iterable[Received]) -> Received | None:
    """Return the first command that was made after the clock had a time.

    Args:
        clock_ns: That ROS time, ns, for commands with a stamp.
        ticked_ns: Wall time at which the next time was sent, ns, for those without: both
            processes have to be on one machine, or their clocks synchronized.
        commands: Received, oldest first.
    """
    for one in commands:
        later = one.sent_ns >= ticked_ns if one.stamp_ns is None else one.stamp_ns > clock_ns
        if later:
            return one
    return None


def ticks_up_to(stamp_ns: int, tick_ns: int, period_ns: int) -> list[int]:
    """Return the ends of the controller periods after one of them, up to a time and with it, ns.

    Args:
        stamp_ns: That time.
        tick_ns: The last end of a period.
        period_ns: Period of the controller.
    """
    return list(range(tick_ns + period_ns, stamp_ns + 1, period_ns))
