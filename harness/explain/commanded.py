"""Command of a stack on trial in one decision, with its plan and its costmap, to show them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from wayproof.harness.attribution import Case
from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError, printable
from wayproof.harness.interface.command_messages import (
    CommandError,
    check_command,
    costmap_of,
    planned_path_of,
)
from wayproof.harness.interface.types import Grid
from wayproof.harness.log.paths import arc_lengths, densely
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb

Array = NDArray[np.float64]

SPACING = 0.02
"""Distance between points of a path that is divided, m."""


class Commanded(NamedTuple):
    """The command of one decision.

    Attributes:
        message: The command as it was sent.
        verdict: Verdict of the referee: `admitted`, `unknown` or `blocked`.
        cut: Whether the guard braked in the stack's place.
        refused: (k, 3) its path from the first overlap to its rest, m, world; empty of an admitted
            command, and of one that the guard cut, whose path the log does not hold.
        planned_path: (n, 3) the stack's own plan, m, world; empty if it gave none.
        costmap: The stack's own costmap; None if it gave none with this command.
    """

    message: sb.Command
    verdict: str
    cut: bool
    refused: Array
    planned_path: Array
    costmap: Grid | None


class Newest(NamedTuple):
    """The newest costmap of a stack at a decision.

    Attributes:
        sequence: Number of the decision that it came with.
        grid: The costmap.
    """

    sequence: int
    grid: Grid


def commanded(answer: pb.StackCommand | None, decision: pb.Decision) -> Commanded | None:
    """Return the command that a decision was made with; None of the built-in stack.

    Raises:
        InputError: The answer is no command.
    """
    if answer is None:
        return None
    try:
        message = sb.Command.FromString(answer.command)
        check_command(message)
        planned = planned_path_of(message)
    except (DecodeError, CommandError):
        raise InputError(f"decision {answer.sequence}: its answer is no command") from None
    verdict, refused = decision.verdict, np.zeros((0, 3))
    if verdict.verdict != "admitted" and not verdict.cut:
        path = path_of(decision.trajectory.path)
        if verdict.free_m < float(arc_lengths(path)[-1]):
            points = densely(path, SPACING)
            refused = points[int(np.searchsorted(arc_lengths(points), verdict.free_m)) :]
    return Commanded(
        message=message,
        verdict=verdict.verdict,
        cut=verdict.cut,
        refused=refused,
        planned_path=np.zeros((0, 3)) if planned is None else planned,
        costmap=costmap_of(message),
    )


def costmap_at(case: Case, number: int) -> Newest | None:
    """Return the newest costmap that a stack on trial gave up to a decision; None without one.

    Raises:
        InputError: A logged answer is no command.
    """
    for moment in reversed(case.moments[: number + 1]):
        command = commanded(moment.answer, moment.decision)
        if command is None:
            return None
        if command.costmap is not None:
            return Newest(moment.decision.sequence, command.costmap)
    return None


def command_in_words(command: sb.Command) -> str:
    """Return the motion, the reason and the scalars of a stack's command in one line."""
    parts = [command.WhichOneof("motion") or "no motion"]
    if command.WhichOneof("motion") == "velocity":
        one = command.velocity
        parts = [
            f"velocity ({one.forward:.2f}, {one.left:.2f}, {one.up:.2f}) m/s, "
            f"{one.yaw_rate:.2f} rad/s for {one.duration_s:.1f} s"
        ]
    if command.reason:
        parts.append(printable(command.reason)[:200])
    parts += [
        f"{printable(name)[:40]} {command.scalars[name]:g}" for name in sorted(command.scalars)
    ]
    return "; ".join(parts)
