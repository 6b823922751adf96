"""Commands as messages: a stack's own costmap, there and back, and what is none."""

import numpy as np
import pytest

from wayproof.harness.interface.command_messages import (
    CommandError,
    check_command,
    command_message,
    costmap_of,
)
from wayproof.harness.interface.types import Command, Grid, Velocity, Waypoints
from wayproof.harness.schema import stack_pb2 as sb

CELLS = np.array([[0, 50, 100], [-1, 99, 1]], np.int8)


def test_a_costmap_comes_back_as_it_was():
    message = command_message(Command(costmap=Grid(np.array([-1.0, 2.0]), 0.05, CELLS)), 3)
    grid = costmap_of(sb.Command.FromString(message.SerializeToString()))
    assert (grid.origin.tolist(), grid.resolution) == ([-1.0, 2.0], 0.05)
    assert grid.cells.tolist() == CELLS.tolist()
    assert costmap_of(command_message(Command(), 3)) is None


def of_grid(origin=(0.0, 0.0), resolution=0.1, cells=CELLS):
    return Command(costmap=Grid(np.array(origin), resolution, cells))


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (of_grid((0.0, np.nan)), "costmap: expected an origin within 10000 m"),
        (of_grid((np.inf, 0.0)), "costmap: expected an origin within 10000 m"),
        (of_grid(np.zeros(3)), "costmap.origin: got 3 numbers"),
        (of_grid(resolution=np.nan), "a resolution above 0 m"),
        (of_grid(resolution=0.0), "a resolution above 0 m"),
        (of_grid(cells=CELLS.astype(float)), r"shape \(2, 3\), float64, expected \(ny, nx\) int8"),
        (of_grid(cells=CELLS[0]), r"shape \(3,\), int8, expected \(ny, nx\) int8"),
        (Command(Velocity(np.array([0.3]))), r"velocity.forward: got an array of shape \(1,\)"),
        (Command(Velocity("fast")), "velocity.forward: got str, expected a number"),
        (Command(scalars={"a": None}), r"scalars\['a'\]: got NoneType, expected a number"),
        (Command(Waypoints(np.zeros((1, 3)), [1.0])), "waypoints.speed: got list"),
    ],
)
def test_what_is_no_command_is_named(command, line):
    with pytest.raises(CommandError, match=line):
        command_message(command, 0)


def test_a_costmap_of_another_process_has_as_many_cells_as_it_says():
    grid = sb.Grid(resolution=0.1, width=2, height=2, cells=b"123")
    with pytest.raises(CommandError, match="got 3 cells for 2 x 2"):
        check_command(sb.Command(costmap=grid))
