"""A* over positions and headings, for an elongated body that cannot turn everywhere."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.astar import lattice
from wayproof.planners.astar.primitives import LENGTHS, headings, motion_primitives
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import lattice_search, se2_search, shortcut, sweep
from wayproof.planners.kernels.angles import wrap
from wayproof.planners.kernels.grid import Floats, Pose
from wayproof.planners.kernels.lattice_cells import FREE_RATE, Lattice
from wayproof.planners.kernels.se2_search import HEADINGS, STATE_BITS, Plane, Primitives
from wayproof.planners.path import poses_along

Longs = NDArray[np.int64]

TURN_COST = 0.05
"""Cost of a turn to the next heading, m."""

REVERSAL_COST = 1.0
"""Cost of going on tail first, or nose first again, m."""

ENTRY_RINGS = 2
"""Largest distance of a pose from the node where it enters the search, nodes along each axis."""

CORNER_COST = 0.1
"""Cost of a corner where the body can turn to any heading, m; 26 plans cost 2.5 % less with it."""

BOUND_MARGIN = 1.0
"""Extra cost over the least disc's way up to which costs-to-go are exact, m."""


def se2_path(
    space: FreeSpace, start: Pose, goal: Pose, budget: int, known: Lattice | None = None
) -> Floats | None:
    """Plan poses from a start to a goal where any heading will do.

    Args:
        space: Space with discs that lie as far ahead as behind, and the cost of length.
        start: Free pose.
        goal: Its heading is not used.
        budget: Largest number of states to expand.
        known: Lattice on which a search from the goal, directed to the start, has found a way.

    Returns:
        Shape (n, 4), or None if no way was found.
    """
    if known is None:
        known = _searched_lattice(space, start, goal)
    if known is None:
        return None
    entered = lattice.entry_cell(known, space, np.array(start[:3]))
    coarse = int(known.factor[0])
    margin = round(BOUND_MARGIN * 2 * FREE_RATE * LENGTHS[1] / (coarse * space.resolution))
    lattice.set_heuristic_target(known, entered)
    lattice_search.expand(known, entered, entered, budget, margin + 1)
    limit = int(known.cost[entered]) + margin
    bounds = lattice_search.bounds_to_go(known, entered, limit)
    for factor in (coarse, 1) if coarse > 1 else (1,):
        to_go = bounds if factor == coarse else _finer(space, known, bounds)
        poses = _path_on(space, start, goal, factor, to_go, budget)
        if poses is not None:
            return poses
    return None


def _searched_lattice(space: FreeSpace, start: Pose, goal: Pose) -> Lattice | None:
    """Return the first lattice with a way for the least disc, searched from goal to start."""
    for factor in lattice.factors(space):
        grid = lattice.make_lattice(space, factor, 1.0)
        a, b = (lattice.entry_cell(grid, space, np.array(end[:3])) for end in (start, goal))
        if a >= 0 and b >= 0:
            lattice.open_goal(grid, b, a)
            if lattice_search.expand(grid, a, a, len(grid.state), 0):
                return grid
    return None


def _finer(space: FreeSpace, known: Lattice, bounds: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return bounds of the grid's cells, interpolated between those of a coarse lattice's nodes."""
    nodes = bounds.reshape(known.shape[0] - 2, known.shape[1] - 2)
    finer = np.empty(space.grid.field.shape[:2], np.int32)
    se2_search.interpolate_bounds(nodes, int(known.factor[0]), finer)
    return finer.ravel()


def reversible(space: FreeSpace) -> bool:
    """Return whether a body that is free at one heading is free at the opposite one."""
    discs = sorted(space.discs)
    turned = sorted((-disc.offset, disc.collision_distance_sq) for disc in discs)
    return [(disc.offset, disc.collision_distance_sq) for disc in discs] == turned


class _Found(NamedTuple):
    """States from a start to a goal, and at which of them the body can turn to any heading."""

    space: FreeSpace
    plane: Plane
    start: Pose
    goal: Pose
    states: Longs
    spins: NDArray[np.bool_]


def _path_on(
    space: FreeSpace,
    start: Pose,
    goal: Pose,
    factor: int,
    to_go: NDArray[np.int32],
    budget: int,
) -> Floats | None:
    """Plan poses from a start to a goal over every `factor`-th cell; None without a way."""
    rates = lattice.rates_of(space, 1.0)
    plane = Plane(
        space.grid.field[:, :, 0],
        space.collision_distance_sq,
        rates.price[:, :, 0],
        rates.by_distance,
        rates.by_price,
        factor,
        (space.grid.field.shape[0] // factor, space.grid.field.shape[1] // factor),
    )
    if plane.shape[0] * plane.shape[1] * HEADINGS >= 1 << STATE_BITS:
        return None
    offsets = tuple(disc.offset / space.resolution for disc in space.discs)
    unit = FREE_RATE * LENGTHS[1] / (factor * space.resolution)
    moves = motion_primitives(offsets, plane.threshold, factor)._replace(
        turn_cost=round(TURN_COST * unit), reversal_cost=round(REVERSAL_COST * unit)
    )
    starts, costs = _starts(space, plane, moves, start)
    end = _node_near(space, plane, goal)
    if len(starts) == 0 or end < 0:
        return None
    states, spins = se2_search.search_states(plane, moves, to_go, starts, costs, end, budget)
    if len(states) == 0:
        return None
    return _poses(_Found(space, plane, start, goal, states, spins))


def _starts(space: FreeSpace, plane: Plane, moves: Primitives, start: Pose) -> tuple[Longs, Longs]:
    """Return states that the start reaches by one free sweep, and their costs, each shape (s,)."""
    nodes, angles = _nodes_about(space, plane, start), np.array(headings())
    places = _centres(space, plane, nodes)
    nearest, free = sweep.free_headings(space.grid, space.shape, start, places, angles)
    states, costs = [], []
    for heading, gear in np.argwhere(free).tolist():
        turn = abs(float(wrap(angles[heading] + gear * math.pi - start[3])))
        turns = round(turn / (2.0 * math.pi / HEADINGS))
        states.append(nodes[nearest] * HEADINGS + heading)
        costs.append(turns * moves.turn_cost + gear * moves.reversal_cost)
    return np.array(states, np.int64), np.array(costs, np.int64)


def _node_near(space: FreeSpace, plane: Plane, goal: Pose) -> int:
    """Return the nearest free node with a free edge to a goal; -1 for none."""
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
    """Return nodes near a pose, the nearest first, shape (n,)."""
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
    """Return the positions of nodes, shape (n, 2), m."""
    cells = np.stack(np.divmod(nodes, plane.shape[1]), axis=-1)
    middles = cells * plane.factor + (plane.factor // 2 + 0.5)
    places: Floats = space.origin[:2] + middles * space.resolution
    return places


def _poses(found: _Found) -> Floats | None:
    """Return the path through the states, at the body's headings; None if it is not free."""
    for straight in (True, False):
        for gear in (0.0, math.pi):  # nose first or tail first
            path = _through(found, gear, straight)
            if sweep.poses_free(found.space.grid, found.space.shape, path):
                return path
    return None


def _through(found: _Found, gear: float, straight: bool) -> Floats:
    """Return the path through the states, shape (n, 4).

    Args:
        found: The states.
        gear: Angle from the direction of motion to the heading at first, 0 or pi, rad.
        straight: Whether to pull the path straight where the body can turn to any heading.
    """
    space, plane, start, goal, states, spins = found
    angles, poses, before = headings(), [start], int(states[0])
    # Runs of states where the body can turn to any heading, and where it cannot.
    cuts = np.flatnonzero(spins[1:] != spins[:-1]) + 1
    for begin, end in itertools.pairwise((0, *cuts.tolist(), len(states))):
        turns, part = bool(spins[begin]), states[begin:end]
        if turns:
            part = _corners(part)
        places = _centres(space, plane, part // HEADINGS).tolist()
        points = [(x, y, start[2]) for x, y in places]
        first, last = int(part[0]), int(part[-1])
        if turns:
            poses.append((*points[0], float(wrap(angles[first % HEADINGS] + gear))))
            if end == len(states):
                points.append(goal[:3])
            track = np.array(list(dict.fromkeys(points)))
            if straight:
                threshold = space.collision_distance_sq
                track = shortcut.prune(space.grid, threshold, 1.0, track)
                track = shortcut.fewest_corners(space.grid, threshold, 1.0, CORNER_COST, track)
            poses += poses_along(track, poses.pop(), None).tolist()
            poses.append((*points[-1], angles[last % HEADINGS]))
            gear = 0.0
        else:
            for state, point in zip(part.tolist(), points, strict=True):
                if _is_reversal(before, state):
                    gear = math.pi - gear
                poses.append((*point, float(wrap(angles[state % HEADINGS] + gear))))
                before = state
        before = last
    if turns:
        poses.pop()  # the turn to the last heading leads nowhere
    poses.append((*goal[:3], poses[-1][3]))
    return np.array([pose for pose, _ in itertools.groupby(poses)], dtype=np.float64)


def _is_reversal(before: int, state: int) -> bool:
    """Return whether a state is another one's node at the opposite heading."""
    opposite = (before - state) % HEADINGS == HEADINGS // 2
    return opposite and before // HEADINGS == state // HEADINGS


def _corners(states: Longs) -> Longs:
    """Return the states at which the way turns, and both ends."""
    inner = states[1:-1]
    turning = inner % HEADINGS != states[:-2] % HEADINGS
    return np.concatenate((states[:1], inner[turning], states[-1:]))
