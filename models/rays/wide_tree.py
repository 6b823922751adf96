"""Trees of eight boxes a node, of which vector instructions tell at once which a ray enters.

A tree of two children a node is built first, and its levels are then pulled together.
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

LEAF_BITS = 2
"""Bits of a leaf's link that hold the number of its items."""

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
    made = pull_together(tree.boxes, tree.links, boxes, links) if len(tree.boxes) else 1
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


@kernel
def widest_inner(
    count: int, roots: NDArray[np.int64], boxes: Array, links: NDArray[np.int32]
) -> int:
    """Return which of some roots has the largest box and children of its own, -1 without one."""
    widest, largest = -1, -1.0
    for k in range(count):
        if links[roots[k], 1] == 0 and half_area(boxes, roots[k]) > largest:
            widest, largest = k, half_area(boxes, roots[k])
    return widest


@allocating
def pull_together(
    boxes: Array,
    links: NDArray[np.int32],
    wide_boxes: NDArray[np.float32],
    wide_links: NDArray[np.int32],
) -> int:
    """Write the nodes of eight children from the root down; return their number.

    Of what is below a node, the largest box gives way to its own two until there are eight.

    Args:
        boxes: (k, 6) of a `Tree`.
        links: (k, 2) likewise.
        wide_boxes: (k, 48) is written, see `WideTree`; without children before.
        wide_links: (k, 8) likewise; 0 before.
    """
    pending, roots = np.empty((STACK_SIZE, 2), np.int64), np.empty(CHILDREN, np.int64)
    pending[0, 0], pending[0, 1] = 0, 0
    waiting, made = 1, 1
    while waiting > 0:
        waiting -= 1
        wide, count = pending[waiting, 1], 1
        roots[0] = pending[waiting, 0]
        while count < CHILDREN:
            widest = widest_inner(count, roots, boxes, links)
            if widest < 0:
                break
            first = links[roots[widest], 0]
            roots[widest], roots[count] = first, first + 1
            count += 1
        for child in range(count):
            at = roots[child]
            write_box(boxes, at, wide_boxes, wide, child)
            if links[at, 1] > 0:
                wide_links[wide, child] = -((links[at, 0] << LEAF_BITS) + links[at, 1])
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
