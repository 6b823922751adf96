"""The cheapest way for a body that is longer than wide, where it cannot turn everywhere."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from planners import _heading_kernels as heading_kernels
from planners import kernels, lattice
from planners._heading_kernels import WAYS, Plane, Ways
from planners._lattice_kernels import FREE_RATE
from planners.kernels import Floats, Pose
from planners.space import FreeSpace

Longs = NDArray[np.int64]

STEPS = (
    (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1),
    (-1, 0), (-2, -1), (-1, -1), (-1, -2), (0, -1), (1, -2), (1, -1), (2, -1),
)  # fmt: skip
"""The ways, counterclockwise."""

LENGTHS = {1: 12, 2: 17, 5: 27}
"""Of a step by its square: 1, 2^0.5, 5^0.5 in twelfths."""

SPACING = 0.1
"""Of the nodes [m], at most; where there is no way so, those of the grid itself."""

TURN_PRICE = 0.05
"""What a turn to the next way costs against length [m]."""

REVERSAL_PRICE = 1.0
"""What it costs to go on tail first, or nose first again [m]."""

SAMPLES = 16
"""Points along a step or turn, by cells of its length, of which the cells are taken."""

NEXT_TO = 0.02
"""And those so near beside [cells]: a line through the corner of four cells touches all."""

ENTRY_RINGS = 2


def turning_path(space: FreeSpace, start: Pose, goal: Pose, budget: int) -> Floats | None:
    """Poses from a start to a goal, at which the heading is free, shape (n, 4); None for no way.

    Args:
        space: With discs that lie as far ahead as behind, and what length costs where.
        start: Free pose.
        goal: Place.
        budget: States that may be closed.
    """
    coarse = max(round(SPACING / space.resolution), 1)
    for factor in (coarse, 1) if coarse > 1 else (1,):
        poses = _path_on(space, start, goal, factor, budget)
        if poses is not None:
            return poses
    return None


def reversible(space: FreeSpace) -> bool:
    """Whether a body that is free at one heading is free at the opposite one."""
    discs = sorted(space.discs)
    turned = sorted((-disc.offset, disc.blocked_at_or_below) for disc in discs)
    return [(disc.offset, disc.blocked_at_or_below) for disc in discs] == turned


def _path_on(space: FreeSpace, start: Pose, goal: Pose, factor: int, budget: int) -> Floats | None:
    plane = Plane(
        space.grid.field[:, :, 0],
        space.blocked_at_or_below,
        lattice.rates(space, 1.0),
        factor,
        (space.field.shape[0] // factor, space.field.shape[1] // factor),
    )
    if plane.shape[0] * plane.shape[1] * WAYS >= 1 << heading_kernels.NODE_BITS:
        return None
    ways = _ways(tuple(disc.offset / space.resolution for disc in space.discs), factor)
    unit = FREE_RATE * LENGTHS[1] / (factor * space.resolution)
    ways = ways._replace(
        turn_price=round(TURN_PRICE * unit), reversal_price=round(REVERSAL_PRICE * unit)
    )
    starts, prices = _starts(space, plane, ways, start)
    end = _node_near(space, plane, goal)
    if len(starts) == 0 or end < 0:
        return None
    to_go = heading_kernels.costs_to_go(plane, ways, end, np.unique(starts // WAYS))
    states = heading_kernels.search_states(plane, ways, to_go, starts, prices, end, budget)
    if len(states) == 0:
        return None
    return _poses(space, plane, states, start, goal)


def _starts(space: FreeSpace, plane: Plane, ways: Ways, start: Pose) -> tuple[Longs, Longs]:
    """States that the start reaches by one free sweep, and their prices."""
    states, prices = [], []
    angles = _angles()
    for node in _nodes_about(space, plane, start):
        x, y = _centre(space, plane, node)
        for way in range(WAYS):
            for gear in (0.0, math.pi):
                pose = (x, y, start[2], float(kernels.wrap(angles[way] + gear)))
                turn = abs(float(kernels.wrap(pose[3] - start[3])))
                if turn > 0.5 * math.pi + 1e-9 and gear > 0.0:
                    continue  # nose first takes no longer
                if not kernels.sweep_free(space.grid, space.shape, start, pose):
                    continue
                turns = round(turn / (2.0 * math.pi / WAYS))
                states.append(node * WAYS + way)
                prices.append(turns * ways.turn_price + (gear > 0.0) * ways.reversal_price)
        if states:
            break
    return np.array(states, np.int64), np.array(prices, np.int64)


def _node_near(space: FreeSpace, plane: Plane, goal: Pose) -> int:
    for node in _nodes_about(space, plane, goal):
        x, y = _centre(space, plane, node)
        cell = node // plane.shape[1], node % plane.shape[1]
        i, j = (n * plane.factor + plane.factor // 2 for n in cell)
        if plane.field[i, j] > plane.threshold and space.edge_free(
            np.array((x, y, goal[2])), np.array(goal[:3])
        ):
            return node
    return -1


def _nodes_about(space: FreeSpace, plane: Plane, pose: Pose) -> list[int]:
    """Nodes near a place, the nearest first."""
    spacing = plane.factor * space.resolution
    own = [math.floor((pose[n] - space.origin[n]) / spacing) for n in range(2)]
    found = []
    for i in range(own[0] - ENTRY_RINGS, own[0] + ENTRY_RINGS + 1):
        for j in range(own[1] - ENTRY_RINGS, own[1] + ENTRY_RINGS + 1):
            if 0 <= i < plane.shape[0] and 0 <= j < plane.shape[1]:
                node = i * plane.shape[1] + j
                x, y = _centre(space, plane, node)
                found.append(((x - pose[0]) ** 2 + (y - pose[1]) ** 2, node))
    return [node for _, node in sorted(found)]


def _centre(space: FreeSpace, plane: Plane, node: int) -> tuple[float, float]:
    i, j = node // plane.shape[1], node % plane.shape[1]
    middle = plane.factor // 2 + 0.5
    x = space.origin[0] + (i * plane.factor + middle) * space.resolution
    y = space.origin[1] + (j * plane.factor + middle) * space.resolution
    return float(x), float(y)


def _poses(space: FreeSpace, plane: Plane, states: Longs, start: Pose, goal: Pose) -> Floats | None:
    """The path through states, its headings those of the body; None if it is not free."""
    angles = _angles()
    for gear in (0.0, math.pi):  # nose first or tail first
        poses = [start]
        for before, state in zip([states[0], *states[:-1]], states, strict=True):
            if (before - state) % WAYS == WAYS // 2 and before // WAYS == state // WAYS:
                gear = math.pi - gear
            x, y = _centre(space, plane, int(state // WAYS))
            heading = float(kernels.wrap(angles[int(state % WAYS)] + gear))
            poses.append((x, y, start[2], heading))
        poses.append((*goal[:3], poses[-1][3]))
        path = np.array(poses, dtype=np.float64)
        if kernels.poses_free(space.grid, space.shape, path):
            return path
    return None


@functools.lru_cache(maxsize=1)
def _angles() -> list[float]:
    return [float(kernels.heading_of(float(x), float(y))) for x, y in STEPS]


@functools.lru_cache(maxsize=16)
def _ways(offsets: tuple[float, ...], factor: int) -> Ways:
    """The tables for discs at these offsets along the body [cells]; the prices are to be filled."""
    angles = _angles()
    shares = np.linspace(0.0, 1.0, SAMPLES * factor + 1)
    steps, turns = [], []
    for way, (x, y) in enumerate(STEPS):
        cosine, sine = kernels.direction(angles[way])
        moved = factor * shares[:, None] * np.array([x, y])
        steps.append(_cells([moved + offset * np.array([cosine, sine]) for offset in offsets]))
        turn = float(kernels.wrap(angles[(way + 1) % WAYS] - angles[way]))
        spun = np.array([kernels.direction(angles[way] + share * turn) for share in shares])
        turns.append(_cells([offset * spun for offset in offsets]))
    step_cells, step_counts = _table(steps)
    turn_cells, turn_counts = _table(turns)
    lengths = np.array([LENGTHS[x * x + y * y] for x, y in STEPS], np.int64)
    return Ways(
        np.array(STEPS, np.int64), lengths, step_cells, step_counts, turn_cells, turn_counts, 0, 0
    )


def _cells(tracks: list[Floats]) -> Longs:
    """Cells that points, from the centre of a cell [cells], lie in or next to, shape (k, 2)."""
    beside = NEXT_TO * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    points = (np.concatenate(tracks)[:, None] + beside).reshape(-1, 2)
    found: Longs = np.unique(np.floor(points + 0.5).astype(np.int64), axis=0)
    return found


def _table(rows: list[Longs]) -> tuple[Longs, Longs]:
    """Rows of different length as one array, filled up, and their lengths."""
    counts = np.array([len(row) for row in rows], np.int64)
    table = np.zeros((len(rows), int(counts.max()), 2), np.int64)
    for place, row in zip(table, rows, strict=True):
        place[: len(row)] = row
    return table, counts
