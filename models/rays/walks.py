"""Walks of a tile down the tree of an asset, and down the grid of a height field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.fans import TILE, boxes_met, distance_ahead
from wayproof.models.rays.field_grid import (
    COLUMNS,
    FIRST_FACE,
    PLACE_BITS,
    Fields,
    child_of,
    point_of,
    top_node,
    unfold,
)
from wayproof.models.rays.lanes import Lanes
from wayproof.models.rays.packets import (
    WIDTH,
    U,
    farthest_hit,
    keep_nearest,
    numbers_of,
    triangle_of,
)
from wayproof.models.rays.wide_tree import HEIGHTS, LEAF_BITS

SUBSETS = np.array(
    [[k for k in range(8) if m >> k & 1] + [0] * (8 - m.bit_count()) for m in range(256)]
)
"""Elements of each subset of eight, by the bits of its number; zeros behind them."""

SIZES = np.array([m.bit_count() for m in range(256)])
"""Number of elements of each subset."""


class Soup(NamedTuple):
    """Triangles of all assets, each asset in its own frame under a tree of its own.

    Attributes:
        boxes: (k, 48) nodes of all trees, see `WideTree`.
        links: (k, 8) likewise; children and triangles are rows of these tables.
        vertices: (v, 3) m.
        corners: (t, 3) rows of the vertices of each triangle, in the order of the leaves.
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    vertices: Array
    corners: NDArray[np.int32]


class Placed(NamedTuple):
    """Geoms made of triangles at their present poses, under one tree in the world.

    Attributes:
        boxes: (k, 48) nodes of the tree, in the world.
        links: (k, 8) likewise; the leaves' items are rows of these tables.
        geoms: (g, 3) geom id in the model, the node of `Soup` that holds its triangles, and its row
            in `Fields`, or -1; the triangles of a field are its walls and the box under it.
        poses: (g, 12) position in the world, m, and R_world_geom, row-major.
        reaches: (g + 1,) largest coordinate of each geom in its frame, and of all in the world, m.
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    geoms: NDArray[np.int32]
    poses: Array
    reaches: Array


@kernel
def farthest_of(count: int, farthest: NDArray[np.float32]) -> np.float32:
    """Return the farthest hit of the first packets, m."""
    most: np.float32 = farthest[0]
    for p in range(1, count):
        most = max(most, farthest[p])
    return most


@kernel
def list_geoms(
    boxes: NDArray[np.float32], links: NDArray[np.int32], limit: float, lanes: Lanes
) -> int:
    """List the geoms that a tile may meet within the limit, nearest first; return their number."""
    fans, sides = lanes.fans, lanes.sides
    stack, near, near_ahead = lanes.stack, lanes.near, lanes.near_ahead
    stack[0] = 0
    waiting, listed = 1, 0
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        mask = boxes_met(
            boxes, node, boxes, node, 0, fans, sides, TILE, np.float32(limit * (1.0 + 2e-7))
        )
        for j in range(SIZES[mask]):
            child = SUBSETS[mask, j]
            link = links[node, child]
            if link >= 0:
                stack[waiting] = link
                waiting += 1
                continue
            ahead = distance_ahead(boxes, node, boxes, node, 0, child, fans, sides, TILE)
            items = (-link) & ((1 << LEAF_BITS) - 1)
            for g in range((-link) >> LEAF_BITS, ((-link) >> LEAF_BITS) + items):
                at = listed
                while at > 0 and near_ahead[at - 1] > ahead:
                    near[at], near_ahead[at] = near[at - 1], near_ahead[at - 1]
                    at -= 1
                near[at], near_ahead[at] = g, ahead
                listed += 1
    return listed


@kernel
def put(
    node: int, distance: np.float32, bottom: int, waiting: int,
    stack: NDArray[np.int64], ahead: NDArray[np.float32],
) -> int:  # fmt: skip
    """Let a child wait among its siblings, from `bottom` up, the nearest on top; return the top."""
    at = waiting
    while at > bottom and ahead[at - 1] < distance:
        stack[at], ahead[at] = stack[at - 1], ahead[at - 1]
        at -= 1
    stack[at], ahead[at] = node, distance
    return waiting + 1


@kernel
def packets_met(
    count: int, boxes: NDArray[np.float32], node: int, heights: NDArray[np.float32], level: int,
    skipped: int, nearest: np.float32, leaves: int, lanes: Lanes,
) -> int:  # fmt: skip
    """Write which leaves of a node each packet may meet; return those that any may meet."""
    fans, sides, farthest, masks = lanes.fans, lanes.sides, lanes.farthest, lanes.masks
    needed = 0
    for p in range(count):
        masks[p] = 0
        if nearest <= farthest[p]:
            masks[p] = (
                boxes_met(boxes, node, heights, level, skipped, fans, sides, p, farthest[p])
                & leaves
            )
        needed |= masks[p]
    return needed


@kernel
def meet_triangle(
    count: int, leaf: int, numbers: tuple[float, ...], row: int, rays: Array,
    masks: NDArray[np.int64],
) -> int:  # fmt: skip
    """Meet a triangle with the packets that may meet its leaf; return a bit for each that does."""
    met = 0
    for p in range(count):
        if masks[p] >> leaf & 1:
            if keep_nearest(rays, U(WIDTH * p), numbers, row) > 0:
                met |= 1 << p
    return met


@kernel
def move_farthest(count: int, met: int, lanes: Lanes) -> np.float32:
    """Update the farthest hits of the packets that met something; return the tile's, m."""
    for j in range(SIZES[met]):
        p = SUBSETS[met, j]
        lanes.farthest[p] = farthest_hit(lanes.rays, lanes.bits, U(WIDTH * p))
    return farthest_of(count, lanes.farthest)


@kernel
def walk_tree(count: int, root: int, soup: Soup, lanes: Lanes) -> bool:
    """Meet one geom's triangles with the tile in its frame, nodes front to back.

    Args:
        count: Number of packets.
        root: Node of `soup` that holds the whole geom.
        soup: Triangles.
        lanes: Beams and fans, in the frame of the geom.

    Returns:
        Whether a nearer hit was found.
    """
    boxes, links = soup.boxes, soup.links
    fans, sides, stack, ahead = lanes.fans, lanes.sides, lanes.stack, lanes.ahead
    most, any_hit = farthest_of(count, lanes.farthest), False
    stack[0], ahead[0] = root, np.float32(-1.0)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node, nearest = stack[waiting], ahead[waiting]
        if nearest > most:
            continue
        mask = boxes_met(boxes, node, boxes, node, 0, fans, sides, TILE, most)
        bottom, leaves = waiting, 0
        for j in range(SIZES[mask]):
            child = SUBSETS[mask, j]
            link = links[node, child]
            if link < 0:
                leaves |= 1 << child
                continue
            distance = distance_ahead(boxes, node, boxes, node, 0, child, fans, sides, TILE)
            waiting = put(link, distance, bottom, waiting, stack, ahead)
        if leaves == 0:
            continue
        # Leaf by leaf, so that the numbers of a triangle serve all packets.
        needed, met = packets_met(count, boxes, node, boxes, node, 0, nearest, leaves, lanes), 0
        for j in range(SIZES[needed]):
            leaf = SUBSETS[needed, j]
            link = -links[node, leaf]
            first = link >> LEAF_BITS
            for row in range(first, first + (link & ((1 << LEAF_BITS) - 1))):
                numbers = triangle_of(soup.vertices, soup.corners, row)
                met |= meet_triangle(count, leaf, numbers, row, lanes.rays, lanes.masks)
        if met > 0:
            any_hit = True
            most = move_farthest(count, met, lanes)
    return any_hit


@kernel
def walk_field(count: int, field: int, tables: Fields, lanes: Lanes) -> bool:
    """Meet the cells of a height field as `walk_tree` meets triangles."""
    fans, sides, stack, ahead = lanes.fans, lanes.sides, lanes.stack, lanes.ahead
    boxes, ranges = lanes.node, tables.ranges
    most, any_hit = farthest_of(count, lanes.farthest), False
    stack[0], ahead[0] = top_node(tables, field), np.float32(-1.0)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node, nearest = stack[waiting], ahead[waiting]
        if nearest > most:
            continue
        level = unfold(tables, field, node, boxes)
        mask = boxes_met(boxes, 0, ranges, level, HEIGHTS, fans, sides, TILE, most)
        if node >> 2 * PLACE_BITS > 0:
            bottom = waiting
            for j in range(SIZES[mask]):
                child = SUBSETS[mask, j]
                distance = distance_ahead(
                    boxes, 0, ranges, level, HEIGHTS, child, fans, sides, TILE
                )
                waiting = put(child_of(node, child), distance, bottom, waiting, stack, ahead)
            continue
        needed, met = packets_met(count, boxes, 0, ranges, level, HEIGHTS, nearest, mask, lanes), 0
        for j in range(SIZES[needed]):
            leaf = SUBSETS[needed, j]
            met |= meet_cell(count, leaf, child_of(node, leaf), field, tables, lanes)
        if met > 0:
            any_hit = True
            most = move_farthest(count, met, lanes)
    return any_hit


@kernel
def meet_cell(count: int, leaf: int, cell: int, field: int, tables: Fields, lanes: Lanes) -> int:
    """Meet both triangles of a cell of a height field; see `meet_triangle`."""
    place = (1 << PLACE_BITS) - 1
    row, column = cell >> PLACE_BITS & place, cell & place
    a, b = point_of(tables, field, row, column), point_of(tables, field, row, column + 1)
    c, d = point_of(tables, field, row + 1, column + 1), point_of(tables, field, row + 1, column)
    fields = tables.fields
    face = fields[field, FIRST_FACE] + 2 * (row * (fields[field, COLUMNS] - 1) + column)
    rays, masks = lanes.rays, lanes.masks
    met = meet_triangle(count, leaf, numbers_of(a, b, c), face, rays, masks)
    return met | meet_triangle(count, leaf, numbers_of(a, c, d), face + 1, rays, masks)
