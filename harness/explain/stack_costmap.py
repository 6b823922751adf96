"""The newest costmap of a stack on trial."""

from __future__ import annotations

from typing import NamedTuple

from google.protobuf.message import DecodeError

from wayproof.harness.attribution import Case
from wayproof.harness.errors import InputError
from wayproof.harness.interface.command_messages import CommandError, check_command, costmap_of
from wayproof.harness.interface.types import Grid
from wayproof.harness.schema import stack_pb2 as sb


class Newest(NamedTuple):
    """The newest costmap of a stack at a decision.

    Attributes:
        sequence: Number of the decision that it came with.
        grid: The costmap.
    """

    sequence: int
    grid: Grid


def costmap_at(case: Case, number: int) -> Newest | None:
    """Return the newest costmap that a stack on trial gave up to a decision; None without one.

    Raises:
        InputError: A logged answer is no command.
    """
    for moment in reversed(case.moments[: number + 1]):
        if moment.answer is None:
            return None
        try:
            message = sb.Command.FromString(moment.answer.command)
            check_command(message)
        except (DecodeError, CommandError):
            text = f"decision {moment.answer.sequence}: its answer is no command"
            raise InputError(text) from None
        grid = costmap_of(message)
        if grid is not None:
            return Newest(moment.decision.sequence, grid)
    return None
