"""A stack's own costmap in pictures: the newest one, and its colours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from wayproof.harness.attribution import Case
from wayproof.harness.errors import InputError
from wayproof.harness.interface.command_messages import CommandError, check_command, costmap_of
from wayproof.harness.interface.types import Grid
from wayproof.harness.schema import stack_pb2 as sb

Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

MOST = 99
"""Greatest cost but that of an occupied cell, 100, as in an OccupancyGrid of Nav2."""

CHEAP, DEAR = (255, 238, 150), (226, 74, 40)
"""Colours of the costs 1 and 99; between them they change evenly."""


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


def shades(
    cells: NDArray[np.int8], *, unknown: Colour, free: Colour, occupied: Colour
) -> NDArray[np.uint8]:
    """Return costs, any shape, as colours, with an axis of 3 more; only a cost of 0 is free.

    Args:
        cells: Costs 0 to 100; -1, and whatever else is no cost, is unknown.
        unknown: Colour of what is unknown.
        free: Colour of a cost of 0.
        occupied: Colour of a cost of 100.
    """
    table = np.full((256, 3), unknown, np.uint8)
    share = np.linspace(0.0, 1.0, MOST)[:, None]
    table[1 : MOST + 1] = np.round((1.0 - share) * CHEAP + share * DEAR)
    table[0], table[MOST + 1] = free, occupied
    return table[np.ascontiguousarray(cells).view(np.uint8)]
