"""The cheapest way for a body that is longer than wide, where it cannot turn everywhere."""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners import _heading_kernels as heading_kernels
from wayproof.planners import _lattice_kernels, kernels
from wayproof.planners._heading_kernels import WAYS, Plane, Swept, Ways
from wayproof.planners._lattice_kernels import FREE_RATE, Lattice
from wayproof.planners.astar import lattice
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import Floats, Pose

Longs = NDArray[np.int64]

STEPS = (
    (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1),
    (-1, 0), (-2, -1), (-1, -1), (-1, -2), (0, -1), (1, -2), (1, -1), (2, -1),
)  # fmt: skip
"""The ways, counterclockwise."""

LENGTHS = {1: 12, 2: 17, 5: 27}
"""Of a step by its square: 1, 2^0.5, 5^0.5 in twelfths."""

TURN_PRICE = 0.05
"""What a turn to the next way costs against length [m]."""

REVERSAL_PRICE = 1.0
"""What it costs to go on tail first, or nose first again [m]."""

SAMPLES = 16
"""Points along a step or turn, by cells of its length, of which the cells are taken."""

NEXT_TO = 0.02
"""And those so near beside [cells]: a line through the corner of four cells touches all."""

ENTRY_RINGS = 2

BEND_PRICE = 0.1
"""What a corner costs where the body can turn about [m]; 26 plans cost 2.5 % less with it."""

BEYOND = 1.0
"""Costs-to-go are searched for ways that cost so much more than the least disc's [m]."""


def turning_path(
    space: FreeSpace, start: Pose, goal: Pose, budget: int, known: Lattice | None = None
) -> Floats | None:
    """Poses from a start to a goal, at which the heading is free, shape (n, 4); None for no way.

    Args:
        space: With discs that lie as far ahead as behind, and what length costs where.
        start: Free pose.
        goal: Place.
        budget: States that may be closed.
        known: Lattice that a search from the goal, drawn to the start, has found a way on.
    """
    if known is None:
        known = _searched_lattice(space, start, goal)
    if known is None:
        return None
    entered = lattice.entry(known, space, np.array(start[:3]))
    coarse = int(known.factor[0])
    beyond = round(BEYOND * 2 * FREE_RATE * LENGTHS[1] / (coarse * space.resolution))
    lattice.draw_to(known, entered)
    _lattice_kernels.spread(known, entered, entered, budget, beyond + 1)
    limit = int(known.cost[entered]) + beyond
    bounds = _lattice_kernels.bounds_to_go(known, entered, limit)
    for factor in (coarse, 1) if coarse > 1 else (1,):
        to_go = bounds if factor == coarse else _finer(space, known, bounds)
        poses = _path_on(space, start, goal, factor, to_go, budget)
        if poses is not None:
            return poses
    return None


def _searched_lattice(space: FreeSpace, start: Pose, goal: Pose) -> Lattice | None:
    """The first lattice that has a way for the least disc, its costs-to-go drawn to the start."""
    for factor in lattice.factors(space):
        grid = lattice.make_lattice(space, factor, 1.0)
        a, b = (lattice.entry(grid, space, np.array(end[:3])) for end in (start, goal))
        if a >= 0 and b >= 0:
            lattice.open_goal(grid, b, a)
            if _lattice_kernels.spread(grid, a, a, len(grid.state), 0):
                return grid
    return None


def _finer(space: FreeSpace, known: Lattice, bounds: NDArray[np.int32]) -> NDArray[np.int32]:
    """Bounds by node of a coarse lattice as those of the grid's cells, which lie between them."""
    nodes = bounds.reshape(known.shape[0] - 2, known.shape[1] - 2)
    finer = np.empty(space.grid.field.shape[:2], np.int32)
    heading_kernels.refine(nodes, int(known.factor[0]), finer)
    return finer.ravel()


def head_along(points: Floats, start: Pose, goal: Pose | None) -> Floats:
    """Poses of a body that heads along a path and turns at its corners, shape (n, 4).

    Args:
        points: Shape (n, 3) [m].
        start: Where it begins.
        goal: Where it turns to at last; None for as it comes.
    """
    poses = [start]
    for a, b in itertools.pairwise(points):
        if b[0] == a[0] and b[1] == a[1]:
            heading = poses[-1][3]  # straight up or down
        else:
            heading = float(kernels.heading_of(b[0] - a[0], b[1] - a[1]))
        poses += [(*a, heading), (*b, heading)]
    return np.array(poses if goal is None else [*poses, goal], dtype=np.float64)


def reversible(space: FreeSpace) -> bool:
    """Whether a body that is free at one heading is free at the opposite one."""
    discs = sorted(space.discs)
    turned = sorted((-disc.offset, disc.collision_distance_sq) for disc in discs)
    return [(disc.offset, disc.collision_distance_sq) for disc in discs] == turned


class _Found(NamedTuple):
    """States from a start to a goal, and at which of them the body can turn about."""

    space: FreeSpace
    plane: Plane
    start: Pose
    goal: Pose
    states: Longs
    wide: NDArray[np.bool_]


def _path_on(
    space: FreeSpace,
    start: Pose,
    goal: Pose,
    factor: int,
    to_go: NDArray[np.int32],
    budget: int,
) -> Floats | None:
    plane = Plane(
        space.grid.field[:, :, 0],
        space.collision_distance_sq,
        lattice.rates(space, 1.0),
        factor,
        (space.grid.field.shape[0] // factor, space.grid.field.shape[1] // factor),
    )
    if plane.shape[0] * plane.shape[1] * WAYS >= 1 << heading_kernels.NODE_BITS:
        return None
    ways = _ways(_offsets(space), plane.threshold, factor)
    unit = FREE_RATE * LENGTHS[1] / (factor * space.resolution)
    ways = ways._replace(
        turn_price=round(TURN_PRICE * unit), reversal_price=round(REVERSAL_PRICE * unit)
    )
    starts, prices = _starts(space, plane, ways, start)
    end = _node_near(space, plane, goal)
    if len(starts) == 0 or end < 0:
        return None
    states, wide = heading_kernels.search_states(plane, ways, to_go, starts, prices, end, budget)
    if len(states) == 0:
        return None
    return _poses(_Found(space, plane, start, goal, states, wide))


def _offsets(space: FreeSpace) -> tuple[float, ...]:
    """Of the discs along the body [cells]."""
    return tuple(disc.offset / space.resolution for disc in space.discs)


def _starts(space: FreeSpace, plane: Plane, ways: Ways, start: Pose) -> tuple[Longs, Longs]:
    """States that the start reaches by one free sweep, and their prices."""
    nodes, angles = _nodes_about(space, plane, start), np.array(_angles())
    places = _centres(space, plane, nodes)
    nearest, free = kernels.free_headings(space.grid, space.shape, start, places, angles)
    states, prices = [], []
    for way, gear in np.argwhere(free).tolist():
        turn = abs(float(kernels.wrap(angles[way] + gear * math.pi - start[3])))
        turns = round(turn / (2.0 * math.pi / WAYS))
        states.append(nodes[nearest] * WAYS + way)
        prices.append(turns * ways.turn_price + gear * ways.reversal_price)
    return np.array(states, np.int64), np.array(prices, np.int64)


def _node_near(space: FreeSpace, plane: Plane, goal: Pose) -> int:
    nodes = _nodes_about(space, plane, goal)
    for node, (x, y) in zip(nodes.tolist(), _centres(space, plane, nodes).tolist(), strict=True):
        cell = node // plane.shape[1], node % plane.shape[1]
        i, j = (n * plane.factor + plane.factor // 2 for n in cell)
        if plane.field[i, j] > plane.threshold and space.edge_free(
            np.array((x, y, goal[2])), np.array(goal[:3])
        ):
            return int(node)
    return -1


def _nodes_about(space: FreeSpace, plane: Plane, pose: Pose) -> Longs:
    """Nodes near a place, the nearest first, shape (n,)."""
    place, rings = np.array(pose[:2]), np.arange(-ENTRY_RINGS, ENTRY_RINGS + 1)
    own = np.floor((place - space.origin[:2]) / (plane.factor * space.resolution)).astype(np.int64)
    rows, columns = (
        (at + rings)[(at + rings >= 0) & (at + rings < count)]
        for at, count in zip(own, plane.shape, strict=True)
    )
    nodes = (rows[:, None] * plane.shape[1] + columns).ravel()
    apart = _centres(space, plane, nodes) - place
    squared = apart[:, 0] * apart[:, 0] + apart[:, 1] * apart[:, 1]
    nearest: Longs = nodes[np.argsort(squared, kind="stable")]
    return nearest


def _centres(space: FreeSpace, plane: Plane, nodes: Longs) -> Floats:
    """Places of nodes, shape (n, 2) [m]."""
    cells = np.stack(np.divmod(nodes, plane.shape[1]), axis=-1)
    middles = cells * plane.factor + (plane.factor // 2 + 0.5)
    places: Floats = space.origin[:2] + middles * space.resolution
    return places


def _poses(found: _Found) -> Floats | None:
    """The path through the states, its headings those of the body; None if it is not free."""
    for straight in (True, False):
        for gear in (0.0, math.pi):  # nose first or tail first
            path = _through(found, gear, straight)
            if kernels.poses_free(found.space.grid, found.space.shape, path):
                return path
    return None


def _through(found: _Found, gear: float, straight: bool) -> Floats:
    """The path through the states, pulled straight where the body can turn about if so asked."""
    space, plane, start, goal, states, wide = found
    angles, poses, before = _angles(), [start], int(states[0])
    cuts = np.flatnonzero(wide[1:] != wide[:-1]) + 1
    for begin, end in itertools.pairwise((0, *cuts.tolist(), len(states))):
        turns, part = bool(wide[begin]), states[begin:end]
        if turns:
            part = _bends(part)
        places = _centres(space, plane, part // WAYS).tolist()
        points = [(x, y, start[2]) for x, y in places]
        first, last = int(part[0]), int(part[-1])
        if turns:
            poses.append((*points[0], float(kernels.wrap(angles[first % WAYS] + gear))))
            if end == len(states):
                points.append(goal[:3])
            track = np.array(list(dict.fromkeys(points)))
            if straight:
                walked = space.grid, space.collision_distance_sq, 1.0
                track = kernels.fewest_corners(*walked, BEND_PRICE, kernels.prune(*walked, track))
            poses += head_along(track, poses.pop(), None).tolist()
            poses.append((*points[-1], angles[last % WAYS]))
            gear = 0.0
        else:
            for state, point in zip(part.tolist(), points, strict=True):
                if (before - state) % WAYS == WAYS // 2 and before // WAYS == state // WAYS:
                    gear = math.pi - gear
                poses.append((*point, float(kernels.wrap(angles[state % WAYS] + gear))))
                before = state
        before = last
    if turns:
        poses.pop()  # it has nowhere to turn to
    poses.append((*goal[:3], poses[-1][3]))
    return np.array([pose for pose, _ in itertools.groupby(poses)], dtype=np.float64)


def _bends(states: Longs) -> Longs:
    """Those of the states at which the way turns, and both ends."""
    inner = states[1:-1]
    return np.concatenate((states[:1], inner[inner % WAYS != states[:-2] % WAYS], states[-1:]))


@functools.lru_cache(maxsize=1)
def _angles() -> list[float]:
    return [float(kernels.heading_of(float(x), float(y))) for x, y in STEPS]


@functools.lru_cache(maxsize=16)
def _ways(offsets: tuple[float, ...], threshold: int, factor: int) -> Ways:
    """The tables for discs at these offsets along the body [cells]; the prices are to be filled."""
    angles = _angles()
    shares = np.linspace(0.0, 1.0, SAMPLES * factor + 1)
    steps, turns = [], []
    for way, (x, y) in enumerate(STEPS):
        cosine, sine = kernels.direction(angles[way])
        moved = factor * shares[:, None] * np.array([x, y])
        steps.append([_cells(moved + offset * np.array([cosine, sine])) for offset in offsets])
        turn = float(kernels.wrap(angles[(way + 1) % WAYS] - angles[way]))
        spun = np.array([kernels.direction(angles[way] + share * turn) for share in shares])
        turns.append([_cells(offset * spun) for offset in offsets])
    spins = [np.unique(np.concatenate(parts), axis=0) for parts in zip(*turns, strict=True)]
    return Ways(
        steps=np.array(STEPS, np.int64),
        lengths=np.array([LENGTHS[x * x + y * y] for x, y in STEPS], np.int64),
        stepped=_swept(steps, threshold),
        turned=_swept(turns, threshold),
        spun=_swept([spins], threshold),
        turn_price=0,
        reversal_price=0,
    )


def _cells(track: Floats) -> Longs:
    """Cells that points, from the centre of a cell [cells], lie in or next to, shape (k, 2)."""
    beside = NEXT_TO * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    points = (track[:, None] + beside).reshape(-1, 2)
    found: Longs = np.unique(np.floor(points + 0.5).astype(np.int64), axis=0)
    return found


def _swept(motions: list[list[Longs]], threshold: int) -> Swept:
    """Tables of the cells that the discs touch on each motion."""
    shape = len(motions), len(motions[0])
    counts = np.array([[len(cells) for cells in discs] for discs in motions], np.int64)
    table = np.zeros((*shape, int(counts.max()), 2), np.int64)
    middles = np.zeros((*shape, 2), np.int64)
    reaches, enough = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for at in np.ndindex(shape):
        cells = motions[at[0]][at[1]]
        table[at][: len(cells)] = cells
        apart = cells[:, None] - cells  # (k, k, 2)
        squared = (apart * apart).sum(axis=2).max(axis=1)
        middle = int(np.argmin(squared))
        middles[at], reaches[at] = cells[middle], np.abs(apart[middle]).max()
        reach = math.sqrt(threshold) + math.sqrt(squared[middle])
        enough[at] = math.ceil(reach * reach)
    return Swept(table, counts, middles, reaches, enough)
