"""Trees of boxes over items (bounding volume hierarchies), so that a ray is tried on few.

A tree of two children a node is built first. Its levels are then pulled together to eight boxes a
node; vector instructions find at once which a ray enters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array

BOX_MARGIN = 1e-9
"""Excess of boxes over what they bound, m, so that rounding never rules out a hit."""

MAX_LEAF = 2
"""Maximum number of items of a leaf: two triangles often fill one box."""

BINS = 16
"""Number of bins between which a split is tried; Wald 2007 finds 16 nearly as good as all."""

MAX_SORTED_DEPTH = 48
"""Depth below which nodes are halved by number, which bounds the depth for any geometry."""

DEEPEST = MAX_SORTED_DEPTH + 32
"""Maximum depth: 32-bit numbers of items cannot be halved more often."""


class Tree(NamedTuple):
    """Boxes within boxes over n items; node 0 is the root.

    Attributes:
        boxes: (k, 6) lower and upper corner of each node, margin included.
        links: (k, 2) of a leaf its first place in `order` and its number of items; of an inner node
            its first child, whose second is the next node, and 0.
        order: (n,) items as the leaves list them.
    """

    boxes: Array
    links: NDArray[np.int32]
    order: NDArray[np.int32]


class Items(NamedTuple):
    """Boxes of n items, and the order in which the leaves list them.

    Attributes:
        lower: (n, 3) lower corners.
        upper: (n, 3) upper corners.
        order: (n,) every item once.
    """

    lower: Array
    upper: Array
    order: NDArray[np.int32]


def build_tree(lower: Array, upper: Array) -> Tree:
    """Build the tree over n items with corners (n, 3) and (n, 3).

    It is empty without items.
    """
    count = len(lower)
    order = np.arange(count, dtype=np.int32)
    boxes, links = np.empty((2 * count, 6)), np.empty((2 * count, 2), np.int32)
    pending = np.empty((DEEPEST, 4), np.int64)
    bins, costs = np.empty((BINS + 1, 7)), np.empty(BINS)
    items = Items(lower, upper, order)
    nodes = grow_tree(items, boxes, links, pending, bins, costs) if count else 0
    return Tree(boxes[:nodes].copy(), links[:nodes].copy(), order)


@kernel
def grow_tree(
    items: Items,
    boxes: Array,
    links: NDArray[np.int32],
    pending: NDArray[np.int64],
    bins: Array,
    costs: Array,
) -> int:
    """Split from the root down by binned splits (Wald 2007); return the number of nodes.

    Args:
        items: At least one; their order becomes that of the leaves.
        boxes: (2 n, 6) is written, see `Tree`.
        links: (2 n, 2) is written, see `Tree`.
        pending: (DEEPEST, 4) scratch: nodes that wait, their first and last place, their depth.
        bins: (BINS + 1, 7) scratch: boxes and numbers of items; the last row is of one side.
        costs: (BINS,) scratch: costs of the left sides.
    """
    pending[0, 0], pending[0, 1], pending[0, 2], pending[0, 3] = 0, 0, len(items.order), 0
    waiting, nodes = 1, 1
    while waiting > 0:
        waiting -= 1
        node, start, stop = pending[waiting, 0], pending[waiting, 1], pending[waiting, 2]
        depth = pending[waiting, 3] + 1
        enclose(items, start, stop, boxes, node)
        if stop - start <= MAX_LEAF:
            links[node, 0], links[node, 1] = start, stop - start
            continue
        axis, low, high = widest_axis(items, start, stop)
        middle = start
        if (high > low) & (depth < MAX_SORTED_DEPTH):
            scale = BINS / (high - low)
            middle = split(items, start, stop, axis, low, scale, bins, costs)
        if (middle == start) | (middle == stop):
            middle = (start + stop) // 2
        links[node, 0], links[node, 1] = nodes, 0
        for side in range(2):
            pending[waiting, 0] = nodes + 1 - side
            pending[waiting, 1] = start if side == 1 else middle
            pending[waiting, 2] = middle if side == 1 else stop
            pending[waiting, 3] = depth
            waiting += 1
        nodes += 2
    return nodes


@kernel
def enclose(items: Items, start: int, stop: int, boxes: Array, node: int) -> None:
    """Write the box about the items from `start` to `stop`, with the margin about it."""
    lower, upper, order = items
    for k in range(3):
        low, high = math.inf, -math.inf
        for place in range(start, stop):
            item = order[place]
            low = lower[item, k] if lower[item, k] < low else low
            high = upper[item, k] if upper[item, k] > high else high
        margin = BOX_MARGIN * (1.0 + abs(low) + abs(high))
        boxes[node, k], boxes[node, 3 + k] = low - margin, high + margin


@kernel
def widest_axis(items: Items, start: int, stop: int) -> tuple[int, float, float]:
    """Return the axis of the widest spread of middles, and twice their minimum and maximum, m."""
    lower, upper, order = items
    axis, lowest, highest = 0, 0.0, -1.0
    for k in range(3):
        low, high = math.inf, -math.inf
        for place in range(start, stop):
            middle = lower[order[place], k] + upper[order[place], k]
            low = middle if middle < low else low
            high = middle if middle > high else high
        if high - low > highest - lowest:
            axis, lowest, highest = k, low, high
    return axis, lowest, highest


@kernel
def bin_of(lower: Array, upper: Array, item: int, axis: int, low: float, scale: float) -> int:
    """Return the bin of an item by its middle."""
    b = int((lower[item, axis] + upper[item, axis] - low) * scale)
    return b if b < BINS else BINS - 1


@kernel
def split(
    items: Items,
    start: int,
    stop: int,
    axis: int,
    low: float,
    scale: float,
    bins: Array,
    costs: Array,
) -> int:
    """Move the items of the cheapest left side to the front; return the right one's first place."""
    lower, upper, order = items
    for b in range(BINS):
        clear(bins, b)
    for place in range(start, stop):
        item = order[place]
        b = bin_of(lower, upper, item, axis, low, scale)
        for k in range(3):
            x, y = lower[item, k], upper[item, k]
            bins[b, k] = x if x < bins[b, k] else bins[b, k]
            bins[b, 3 + k] = y if y > bins[b, 3 + k] else bins[b, 3 + k]
        bins[b, 6] += 1.0
    last = cheapest_bin(bins, costs)
    front = start
    for place in range(start, stop):
        item = order[place]
        if bin_of(lower, upper, item, axis, low, scale) <= last:
            order[place] = order[front]
            order[front] = item
            front += 1
    return front


@kernel
def clear(bins: Array, b: int) -> None:
    """Empty one bin."""
    for k in range(3):
        bins[b, k], bins[b, 3 + k] = math.inf, -math.inf
    bins[b, 6] = 0.0


@kernel
def gather(bins: Array, b: int) -> float:
    """Widen the last row by bin b; return the cost of the side that it then stands for."""
    for k in range(3):
        low, high = bins[b, k], bins[b, 3 + k]
        bins[BINS, k] = low if low < bins[BINS, k] else bins[BINS, k]
        bins[BINS, 3 + k] = high if high > bins[BINS, 3 + k] else bins[BINS, 3 + k]
    bins[BINS, 6] += bins[b, 6]
    x = bins[BINS, 3] - bins[BINS, 0]
    y = bins[BINS, 4] - bins[BINS, 1]
    z = bins[BINS, 5] - bins[BINS, 2]
    return (x * y + y * z + z * x) * bins[BINS, 6] if bins[BINS, 6] > 0.0 else 0.0


@kernel
def cheapest_bin(bins: Array, costs: Array) -> int:
    """Return the left side's last bin by the surface area heuristic (Goldsmith & Salmon 1987)."""
    clear(bins, BINS)
    for b in range(BINS):
        costs[b] = gather(bins, b)
    clear(bins, BINS)
    last, cheapest = 0, math.inf
    for b in range(BINS - 1, 0, -1):
        cost = gather(bins, b) + costs[b - 1]
        if cost < cheapest:
            last, cheapest = b - 1, cost
    return last


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
