"""The first obstruction of a path, a turn or a pose: its cell, and the free length before."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import GRAIN
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.types import Array, PlannerInput, arc_length
from wayproof.maps.elementary import sines_cosines
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN
from wayproof.planners import arc_lengths, point_at

JUST_BEYOND = 1e-3
"""Distance from the last free position of a path to the first blocked one, cells."""

BESIDE = 2e-3
"""Distance of the positions checked right beside a position, cells."""

STEP = 0.25
"""Spacing of the checked positions of a path, cells."""

SAME_EDGE = 1e-3
"""Distance before an arc length at which the edge that leads to it is found, m."""

REACH = 0.3
"""Length of the pieces in which the path of an elongated body is checked, m."""

FINENESS = (1.0, 0.01)
"""Fractions of the steps along a path and of a turn; a grazed cell is found by the finer one."""

TURN_STEP = 0.02
"""Spacing of the checked headings of a turn, rad."""

OUTSIDE = 3
"""State of a cell outside the operating area."""

NAMES = {UNKNOWN: "unknown", OCCUPIED: "occupied", OUTSIDE: "outside"}


class Obstruction(NamedTuple):
    """The first overlap of the footprint with a cell.

    Attributes:
        free_m: Free length before it, m.
        cell: Centre of the cell, m; none if there is no overlap.
        cell_state: `occupied`, `unknown` or `outside`.
        place: Position of the body's centre, or of one of its discs, at the overlap, m.
    """

    free_m: float
    cell: tuple[float, float, float] | None = None
    cell_state: str = ""
    place: tuple[float, float, float] | None = None


def on_path(input: PlannerInput, path: Array, free_m: float, unknown_blocks: bool) -> Obstruction:
    """Return the obstruction at the end of the free length of a path.

    Args:
        input: Planner input of the decision.
        path: (n, 3) m.
        free_m: Its free length, m.
        unknown_blocks: Whether unknown space ends it, too.
    """
    size = input.traversable.resolution
    reach, end = size, free_m
    if input.traversable.discs:  # anything on the next edge, or in the turn at its end, may end it
        arcs = arc_lengths(path)
        reach, end = REACH, float(np.append(arcs[arcs > free_m + SAME_EDGE], free_m)[0])
    # Cells grazed on that edge or in that turn come before those overlapped farther on.
    turned = end + STEP * size
    for begin, length, fineness in _pieces(free_m, turned, end + reach, reach):
        beyond = begin + JUST_BEYOND * size + np.arange(0.0, length, fineness * STEP * size)
        arcs = np.minimum(beyond, arc_length(path))
        poses = _headed(input, path, arcs, fineness * TURN_STEP)
        found = _first_obstruction(input, poses, np.full(len(poses), free_m), unknown_blocks)
        if found.cell is not None:
            break
    return found


def _pieces(
    begin: float, turned: float, end: float, reach: float
) -> Iterator[tuple[float, float, float]]:
    """Yield the begin and length, m, of each piece of a path to check, and the fineness.

    All pieces up to `turned` are checked coarsely, then finely, before any beyond it.
    """
    for first, last, limit in ((begin, turned, turned), (turned, end, math.inf)):
        for fineness, one in itertools.product(FINENESS, np.arange(first, last, reach).tolist()):
            yield one, min(reach, limit - one), fineness


def on_poses(input: PlannerInput, poses: Array, unknown_blocks: bool) -> Obstruction:
    """Return the first obstruction at poses (n, 4): x, y, z, m, and heading, rad."""
    return _first_obstruction(input, poses, arc_lengths(poses[:, :3]), unknown_blocks)


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


def _poses(position: Array, headings: Array) -> Array:
    return np.column_stack((np.tile(position, (len(headings), 1)), headings))


def _headed(input: PlannerInput, path: Array, arcs: Array, turn_step: float) -> Array:
    """Return poses (m, 4) on a path; an elongated body heads along it and turns at its points.

    A turn adds poses, `turn_step` rad apart.
    """
    poses = []
    before = heading_at(path, max(float(arcs[0]) - SAME_EDGE, 0.0))
    for arc in arcs.tolist():
        point, heading = point_at(path, arc), heading_at(path, arc)
        if input.traversable.discs:
            turn = wrap_angle(heading - before)
            steps = np.linspace(0.0, turn, max(math.ceil(abs(turn) / turn_step), 1) + 1)
            poses += [(*point, before + step) for step in steps.tolist()]
        else:
            poses.append((*point, heading))
        before = heading
    return np.array(poses)


def _first_obstruction(
    input: PlannerInput, poses: Array, along: Array, unknown_blocks: bool
) -> Obstruction:
    """Return the first pose with a cell within a disc, and the nearest such cell."""
    offsets, thresholds = input.traversable.shape
    size, origin = input.traversable.resolution, input.traversable.origin
    centres = np.repeat(poses[:, None, None, :3], len(offsets), axis=2)  # (n, 1, discs, 3)
    sines, cosines = sines_cosines(poses[:, 3])
    centres[:, 0, :, 0] += offsets * cosines[:, None]
    centres[:, 0, :, 1] += offsets * sines[:, None]
    # A path can touch the mere edge of a cell, so positions right beside it count, too.
    places = centres + _beside(input)[:, None] * size  # (n, sides, discs, 3)
    places = np.rint(places / GRAIN) * GRAIN
    cells = np.floor((places - origin) / size).astype(np.int64)
    found, states = _blocked_cells(
        input, cells.reshape(-1, 3), int(thresholds.max()), unknown_blocks
    )
    seen: set[tuple[int, ...]] = set()
    order = np.ndindex(*cells.shape[:3]) if len(found) else ()
    for n, side, k in order:
        key = (k, *cells[n, side, k].tolist())
        if key in seen:
            continue
        seen.add(key)
        squared = np.square(found - cells[n, side, k]).sum(axis=1)
        nearest = int(squared.argmin())
        if squared[nearest] <= thresholds[k]:
            x, y, z = (origin + (found[nearest] + 0.5) * size).tolist()
            at, state = places[n, side, k].tolist(), NAMES[int(states[nearest])]
            return Obstruction(float(along[n]), (x, y, z), state, (at[0], at[1], at[2]))
    return Obstruction(float(along[-1]))


def _beside(input: PlannerInput) -> Array:
    """Return shifts (sides, 3) of a place, cells: none first, then all corners around it."""
    flat = input.traversable.flat
    corners = itertools.product(
        (-BESIDE, BESIDE), (-BESIDE, BESIDE), (0,) if flat else (-BESIDE, BESIDE)
    )
    return np.array([(0.0, 0.0, 0.0), *corners])


def _blocked_cells(
    input: PlannerInput, cells: NDArray[np.int64], threshold: int, unknown_blocks: bool
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return the blocked cells (m, 3) near any of the given ones, and their states."""
    reach = math.isqrt(threshold) + 1
    shape = np.array(input.traversable.grid.field.shape)
    pad = np.where(shape > 1, reach, 0)  # a plane has nothing above or below
    low, high = cells.min(axis=0) - pad, cells.max(axis=0) + pad + 1
    states = np.full(high - low, OUTSIDE, np.uint8)
    first, end = np.clip(low, 0, shape), np.clip(high, 0, shape)
    inner = tuple(slice(a, b) for a, b in zip(first - low, end - low, strict=True))
    states[inner] = input.cell_states(first, end)
    blocked = states != FREE if unknown_blocks else states >= OCCUPIED
    return np.argwhere(blocked) + low, states[blocked]
