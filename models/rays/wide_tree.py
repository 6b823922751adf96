"""Trees of eight boxes a node, of which vector instructions tell at once which a beam may meet.

A tree of two children a node is built first, and its levels are then pulled together: of all ways
to do so the one of least expected cost (Ylitie, Karras and Laine, "Efficient incoherent ray
traversal on GPUs through compressed wide BVHs", 2017).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.tree import DEEPEST, build_tree

CHILDREN = 8
"""Children of a node: one 256-bit register of single precision."""

SIDES = 6 * CHILDREN

MAX_LEAF = 2
"""Maximum number of items of a leaf: two triangles often fill one box."""

LEAF_BITS = 2
"""Bits of a leaf's link that hold the number of its items."""

ITEM_COST, NODE_COST = 1.0, 1.0
"""Cost of trying an item, and of a node: both take about 10 ns, measured on one core."""

STACK_SIZE = CHILDREN * DEEPEST
"""Maximum number of nodes that wait during a walk: all children of each level."""


class WideTree(NamedTuple):
    """Boxes within boxes over n items; node 0 is the root.

    Attributes:
        boxes: (k, 48) lower x, y and z of eight children, then the upper ones, rounded outwards;
            from infinity down to minus infinity where there is no child.
        links: (k, 8) node of each child; of a leaf minus (4 * first place in `order` + number of
            items); 0 where there is no child.
        order: (n,) items as the leaves list them.
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    order: NDArray[np.int32]


def build_wide_tree(lower: Array, upper: Array) -> WideTree:
    """Build the tree over n items with corners (n, 3) and (n, 3).

    Without items it has one node without children.
    """
    tree = build_tree(lower, upper)
    nodes = max(len(tree.boxes), 1)
    boxes = np.empty((nodes, SIDES), np.float32)
    boxes[:, : SIDES // 2], boxes[:, SIDES // 2 :] = np.inf, -np.inf
    links = np.zeros((nodes, CHILDREN), np.int32)
    made = 1
    if len(tree.boxes):
        costs = np.empty((nodes, CHILDREN))
        shares, counts = np.empty((nodes, CHILDREN), np.int8), np.empty((nodes, 2), np.int32)
        weigh(tree.boxes, tree.links, costs, shares, counts)
        made = pull_together(tree.boxes, tree.links, shares, counts, boxes, links)
    return WideTree(boxes[:made].copy(), links[:made].copy(), tree.order)


@kernel
def half_area(boxes: Array, node: int) -> float:
    """Return half the surface of a box, m^2."""
    x, y, z = (
        boxes[node, 3] - boxes[node, 0],
        boxes[node, 4] - boxes[node, 1],
        boxes[node, 5] - boxes[node, 2],
    )
    return float(x * y + y * z + z * x)


LEAF, FEWER = -1, 0
"""Codes among the shares: a leaf; as with one root less."""


@allocating
def weigh(
    boxes: Array,
    links: NDArray[np.int32],
    costs: Array,
    shares: NDArray[np.int8],
    counts: NDArray[np.int32],
) -> None:
    """Find the cheapest way to hold what is below each node under at most 1 to 8 roots.

    Args:
        boxes: (k, 6) of a tree with two children a node and one item a leaf.
        links: (k, 2) likewise; children stand behind their parents.
        costs: (k, 8) is written: expected cost, with at most 1 to 8 roots.
        shares: (k, 8) is written: how many of the roots the first child gets, LEAF or FEWER; with
            one root, how many of a node's children are from the first child.
        counts: (k, 2) is written: first place and number of items.
    """
    split, share = np.empty(CHILDREN + 1), np.empty(CHILDREN + 1, np.int8)
    for node in range(len(boxes) - 1, -1, -1):
        area = half_area(boxes, node)
        if links[node, 1] > 0:
            counts[node, 0], counts[node, 1] = links[node, 0], links[node, 1]
            costs[node], shares[node] = area * ITEM_COST * links[node, 1], LEAF
            continue
        one, other = links[node, 0], links[node, 0] + 1
        counts[node, 0], counts[node, 1] = counts[one, 0], counts[one, 1] + counts[other, 1]
        for roots in range(2, CHILDREN + 1):
            split[roots] = math.inf
            for k in range(1, roots):
                cost = costs[one, k - 1] + costs[other, roots - k - 1]
                if cost < split[roots]:
                    split[roots], share[roots] = cost, k
        inner = split[CHILDREN] + area * NODE_COST
        leaf = area * ITEM_COST * counts[node, 1] if counts[node, 1] <= MAX_LEAF else math.inf
        costs[node, 0] = min(leaf, inner)
        shares[node, 0] = LEAF if leaf <= inner else share[CHILDREN]
        for roots in range(2, CHILDREN + 1):
            fewer = costs[node, roots - 2]
            costs[node, roots - 1] = min(split[roots], fewer)
            shares[node, roots - 1] = share[roots] if split[roots] < fewer else FEWER


@allocating
def take_roots(
    node: int,
    roots: int,
    links: NDArray[np.int32],
    shares: NDArray[np.int8],
    taken: NDArray[np.int64],
    found: int,
) -> int:
    """Write the roots that hold what is below a node behind those found; return their number."""
    pending = np.empty((CHILDREN + 1, 2), np.int64)
    pending[0, 0], pending[0, 1] = node, roots
    waiting = 1
    while waiting > 0:
        waiting -= 1
        at, left = pending[waiting, 0], pending[waiting, 1]
        while (left > 1) & (shares[at, left - 1] == FEWER):
            left -= 1
        if (left == 1) | (shares[at, left - 1] == LEAF):
            taken[found] = at
            found += 1
            continue
        share = shares[at, left - 1]
        pending[waiting, 0], pending[waiting, 1] = links[at, 0] + 1, left - share
        pending[waiting + 1, 0], pending[waiting + 1, 1] = links[at, 0], share
        waiting += 2
    return found


@allocating
def pull_together(
    boxes: Array,
    links: NDArray[np.int32],
    shares: NDArray[np.int8],
    counts: NDArray[np.int32],
    wide_boxes: NDArray[np.float32],
    wide_links: NDArray[np.int32],
) -> int:
    """Write the nodes of eight children from the root down; return their number.

    Args:
        boxes: (k, 6) as for `weigh`.
        links: (k, 2) likewise.
        shares: (k, 8) by `weigh`.
        counts: (k, 2) by `weigh`.
        wide_boxes: (k, 48) is written, see `WideTree`; without children before.
        wide_links: (k, 8) likewise; 0 before.
    """
    pending = np.empty((STACK_SIZE, 2), np.int64)
    pending[0, 0], pending[0, 1] = 0, 0
    waiting, made = 1, 1
    taken = np.empty(CHILDREN, np.int64)
    while waiting > 0:
        waiting -= 1
        node, wide = pending[waiting, 0], pending[waiting, 1]
        found, share = 1, shares[node, 0]
        taken[0] = node
        if share != LEAF:  # else the root itself is a leaf, and its only child
            found = take_roots(links[node, 0], share, links, shares, taken, 0)
            found = take_roots(links[node, 0] + 1, CHILDREN - share, links, shares, taken, found)
        for child in range(found):
            at = taken[child]
            write_box(boxes, at, wide_boxes, wide, child)
            if shares[at, 0] == LEAF:
                wide_links[wide, child] = -((counts[at, 0] << LEAF_BITS) + counts[at, 1])
            else:
                wide_links[wide, child] = made
                pending[waiting, 0], pending[waiting, 1] = at, made
                waiting += 1
                made += 1
    return made


@kernel
def write_box(
    boxes: Array, node: int, wide_boxes: NDArray[np.float32], wide: int, child: int
) -> None:
    """Write a box as a child's, rounded outwards."""
    for axis in range(3):
        low, high = np.float32(boxes[node, axis]), np.float32(boxes[node, 3 + axis])
        if low > boxes[node, axis]:
            low = np.nextafter(low, np.float32(-math.inf))
        if high < boxes[node, 3 + axis]:
            high = np.nextafter(high, np.float32(math.inf))
        wide_boxes[wide, CHILDREN * axis + child] = low
        wide_boxes[wide, CHILDREN * (3 + axis) + child] = high
