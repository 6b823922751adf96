"""Trees of eight boxes a node, and the rays that enter these."""

import numpy as np
import pytest

from wayproof.models.rays.records import Waiting
from wayproof.models.rays.tree import (
    CHILDREN,
    LEAF_BITS,
    MAX_LEAF,
    MAX_SORTED_DEPTH,
    build_tree,
    build_wide_tree,
)
from wayproof.models.rays.walks import open_node, slabs_of


def corners(boxes, node, child):
    """Lower and upper corner of a child."""
    sides = boxes[node].reshape(2, 3, CHILDREN)[:, :, child].astype(float)
    return sides[0], sides[1]


def items_below(tree, node, lower, upper, seen):
    """Check that what is below a node is inside its children's boxes; return the box about it."""
    ends = []
    for child, link in enumerate(tree.links[node]):
        if link == 0:
            assert corners(tree.boxes, node, child)[0].tolist() == 3 * [np.inf]
            continue
        low, high = corners(tree.boxes, node, child)
        if link > 0:
            inner_low, inner_high = items_below(tree, link, lower, upper, seen)
        else:
            first, count = -link >> LEAF_BITS, -link & ((1 << LEAF_BITS) - 1)
            assert 1 <= count <= MAX_LEAF
            own = tree.order[first : first + count]
            seen += own.tolist()
            inner_low, inner_high = lower[own].min(axis=0), upper[own].max(axis=0)
        assert (low <= inner_low).all()
        assert (high >= inner_high).all()
        ends.append((inner_low, inner_high))
    return np.min([e[0] for e in ends], axis=0), np.max([e[1] for e in ends], axis=0)


@pytest.mark.parametrize("count", [1, 2, 3, 8, 9, 500])
@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_a_wide_tree_holds_every_item_once_inside_its_boxes(count, scale):
    """Boxes are rounded outwards, which at 10 km is a millimetre."""
    rng = np.random.default_rng(count)
    lower = scale * rng.normal(size=(count, 3))
    upper = lower + scale * rng.exponential(size=(count, 3))
    tree, seen = build_wide_tree(lower, upper), []
    items_below(tree, 0, lower, upper, seen)
    assert sorted(seen) == list(range(count))
    assert len(tree.boxes) <= max(1, count // 3)  # most nodes have most of their children


def test_a_tree_of_nothing_has_no_children():
    assert (build_wide_tree(np.empty((0, 3)), np.empty((0, 3))).links == 0).all()


@pytest.mark.parametrize("spread", ["none", "exponential"])
def test_a_tree_that_no_plane_parts_well_stays_shallow(spread):
    """Equal middles, and ones of which each plane parts one from the rest."""
    along = np.zeros(5000) if spread == "none" else 2.0 ** np.arange(-500, 500)
    items = np.repeat(along[:, None], 3, axis=1)
    _, links, order = build_tree(items, items)
    assert sorted(order) == list(range(len(items)))
    depth = np.zeros(len(links), int)
    for node, (first, count) in enumerate(links):
        if count == 0:
            depth[first : first + 2] = depth[node] + 1
    assert depth.max() <= MAX_SORTED_DEPTH + 14


def naive_met(low, high, origins, directions, limit):
    """Whether any ray enters a box no farther than the limit, by its slabs."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - origins) / directions, (high - origins) / directions
    near, far = np.fmin(one, other).max(axis=1), np.fmax(one, other).min(axis=1)
    return bool(((near <= far) & (far >= 0.0) & (near <= limit)).any())


@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_no_box_that_a_ray_enters_is_ruled_out(offset):
    """Also far from the frame's origin, along axes, and from a corner or within a side."""
    rng = np.random.default_rng(7)
    waiting = Waiting(np.empty(99, np.int64), np.empty(99, np.float32))
    met = kept = 0
    for number in range(500):
        lower = offset + 2.0 * rng.normal(size=(CHILDREN, 3))
        upper = lower + rng.exponential(size=(CHILDREN, 3))
        origin = offset + 4.0 * rng.normal(size=3)
        direction = offset - origin + rng.normal(size=3)
        if number % 2:
            direction[rng.integers(3)] = rng.choice([0.0, -0.0, 1e-19])
            origin[rng.integers(3)] = rng.choice([lower, upper])[0, rng.integers(3)]
        direction /= np.linalg.norm(direction)
        tree, limit = build_wide_tree(lower, upper), np.float32(rng.uniform(1.0, 20.0))
        slabs = slabs_of(tuple(origin), tuple(direction), offset + 10.0)
        for node in range(len(tree.boxes)):
            top = open_node(tree.boxes, tree.links, node, slabs, limit, 0, waiting)
            assert (np.diff(waiting.ahead[:top]) <= 0.0).all()
            for child in np.flatnonzero(tree.links[node]):
                low, high = corners(tree.boxes, node, child)
                entered = naive_met(low, high, origin[None], direction, limit)
                found = tree.links[node, child] in waiting.links[:top]
                kept += found
                met += entered
                assert found or not entered
    assert met > 75
    assert kept < 1.1 * met
