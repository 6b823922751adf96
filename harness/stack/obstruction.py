"""The obstruction of a path, a turn or a pose: the cell that ends it, where, and as a reason."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import Label
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.harness.stack.types import Array, PlannerInput
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN
from wayproof.planners import FreeSpace, arc_lengths

TURN_STEP = 0.02
"""Spacing of the checked headings of a turn, rad."""

OUTSIDE = 3
"""State of a cell outside the operating area."""

HERE: tuple[Kind, ...] = ("goal_blocked", "leaving_inflation")
"""Kinds whose obstruction is where the body, or its goal, is, and not on a way."""

NAMES = {UNKNOWN: "unknown", OCCUPIED: "occupied", OUTSIDE: "outside"}


class Obstruction(NamedTuple):
    """What the body may not overlap, and does.

    Attributes:
        free_m: Free length before it, m.
        cell: Centre of the cell, m; none if there is no overlap.
        cell_state: `occupied`, `unknown` or `outside`, as the costmap has it.
        place: Centre of the cell of the body's centre, or of one of its discs', at the overlap, m.
    """

    free_m: float
    cell: tuple[float, float, float] | None = None
    cell_state: str = ""
    place: tuple[float, float, float] | None = None


def obstructed(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    """Return a reason with its obstruction; of what is ahead, with the free length before it."""
    if kind not in HERE:
        figures["free_m"] = found.free_m
    return Reason(kind, cell=found.cell, cell_state=found.cell_state, place=found.place, **figures)


def label_ahead(found: Obstruction) -> Label:
    """Return the label of what is ahead: unknown, or blocked."""
    return "unknown_ahead" if found.cell_state == "unknown" else "path_blocked"


def braking_reason(found: Obstruction) -> tuple[Reason, Label]:
    """Return the reason and label of a robot that brakes for what is ahead."""
    unknown = found.cell_state == "unknown"
    kind: Kind = "braking_for_unknown" if unknown else "braking_for_blocked"
    return obstructed(kind, found), label_ahead(found)


def on_path(input: PlannerInput, path: Array, free_m: float, unknown_blocks: bool) -> Obstruction:
    """Return the obstruction at the end of the free length of a path.

    Args:
        input: Planner input of the decision.
        path: (n, 3) m.
        free_m: Its free length, m.
        unknown_blocks: Whether unknown space ends it, too.
    """
    centre = _space(input, unknown_blocks).first_forbidden(path)
    return _at(input, free_m, centre, unknown_blocks)


def on_poses(input: PlannerInput, poses: Array, unknown_blocks: bool) -> Obstruction:
    """Return the first obstruction at and between poses (n, 4): x, y, z, m, and heading, rad."""
    reached, centre = _space(input, unknown_blocks).first_forbidden_pose(poses)
    return _at(input, float(arc_lengths(poses[:, :3])[reached]), centre, unknown_blocks)


def on_turn(input: PlannerInput, position: Array, heading: float, target: float) -> Obstruction:
    """Return the first obstruction of a turn in place, the shorter way round."""
    turn = wrap_angle(target - heading)
    headings = heading + np.linspace(0.0, turn, max(math.ceil(abs(turn) / TURN_STEP), 1) + 1)
    return on_poses(input, _poses(position, headings), input.unknown_blocks)


def at_place(
    input: PlannerInput, position: Array, heading: float, unknown_blocks: bool
) -> Obstruction:
    """Return the obstruction at one pose."""
    return on_poses(input, _poses(position, np.array([heading])), unknown_blocks)


def _space(input: PlannerInput, unknown_blocks: bool) -> FreeSpace:
    """Return the space that ends where something blocks, and where unknown space does or not."""
    if unknown_blocks == input.unknown_blocks:
        return input.traversable
    return input.known_free if unknown_blocks else input.optimistic


def _poses(position: Array, headings: Array) -> Array:
    return np.column_stack((np.tile(position, (len(headings), 1)), headings))


def _at(
    input: PlannerInput, free_m: float, centre: NDArray[np.int64] | None, unknown_blocks: bool
) -> Obstruction:
    """Return the obstruction of a body with a centre in a forbidden cell (3,): the nearest cell."""
    if centre is None:
        return Obstruction(free_m)
    space = input.traversable
    reach = math.isqrt(int(space.shape.thresholds.max())) + 1
    shape = np.array(space.grid.field.shape)
    pad = np.where(shape > 1, reach, 0)  # a plane has nothing above or below
    low, high = centre - pad, centre + pad + 1
    states = np.full(high - low, OUTSIDE, np.uint8)
    first, end = np.clip(low, 0, shape), np.clip(high, 0, shape)
    inner = tuple(slice(a, b) for a, b in zip(first - low, end - low, strict=True))
    states[inner] = input.spaces.cell_states(first, end)
    blocked = np.argwhere(states != FREE if unknown_blocks else states >= OCCUPIED)
    if not len(blocked):  # a distance is out of date, and the decision is made again
        return Obstruction(free_m)
    nearest = blocked[int(np.square(blocked + low - centre).sum(axis=1).argmin())]
    x, y, z = (space.origin + (low + nearest + 0.5) * space.resolution).tolist()
    at = (space.origin + (centre + 0.5) * space.resolution).tolist()
    state = NAMES[int(states[tuple(nearest)])]
    return Obstruction(free_m, (x, y, z), state, (at[0], at[1], at[2]))
