"""Trees of eight boxes a node, pyramids over height fields, and the fans that walk them."""

import numpy as np
import pytest

from wayproof.models.rays import fans, field_grid
from wayproof.models.rays.packets import LANES, PX, TILE_NUMBERS, WIDTH, WX
from wayproof.models.rays.wide_tree import (
    CHILDREN,
    COLUMNS,
    LEAF_BITS,
    MAX_LEAF,
    SIDES,
    build_wide_tree,
)


def corners(boxes, node, child):
    """Lower and upper corner of a child."""
    sides = boxes[node, [column + child for column in COLUMNS]].astype(float)
    return sides[:3], sides[3:]


def items_below(tree, node, lower, upper, seen):
    """Check that what is below a node is inside its children's boxes; return the box about it."""
    ends = []
    for child, link in enumerate(tree.links[node]):
        if link == 0:
            assert np.isnan(tree.boxes[node, [column + child for column in COLUMNS]]).all()
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


def test_a_wide_tree_of_nothing_and_of_equal_items():
    empty = build_wide_tree(np.empty((0, 3)), np.empty((0, 3)))
    assert (empty.links == 0).all()
    same, seen = np.zeros((3000, 3)), []
    items_below(build_wide_tree(same, same), 0, same, same, seen)
    assert sorted(seen) == list(range(3000))


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (3, 9), (40, 37), (120, 5)])
def test_a_pyramid_holds_every_cell_once_inside_its_boxes(rows, columns):
    rng = np.random.default_rng(rows)
    heights = rng.uniform(size=(rows, columns)).astype(np.float32)
    tables = field_grid.no_fields()
    for shares in (rng.uniform(size=(4, 6)).astype(np.float32), heights):  # the second one is asked
        tables = field_grid.add_field(tables, shares, (3.0, 2.0), 0.7, 10)
    boxes, cells = np.empty((1, SIDES), np.float32), []
    pending = [(field_grid.top_node(tables, 1), None)]
    while pending:
        node, outer = pending.pop()
        level = node >> 2 * field_grid.PLACE_BITS
        boxes[0, 32:] = tables.ranges[field_grid.unfold(tables, 1, node, boxes)]
        for child in range(CHILDREN):
            low, high = corners(boxes, 0, child)
            if np.isnan(low[2]):
                continue
            if outer is not None:
                assert (low >= outer[0] - 1e-5).all()
                assert (high <= outer[1] + 1e-5).all()
            below = field_grid.child_of(node, child)
            if level > 0:
                pending.append((below, (low, high)))
                continue
            mask = (1 << field_grid.PLACE_BITS) - 1
            row, column = below >> field_grid.PLACE_BITS & mask, below & mask
            cells.append((row, column))
            for i, j in [(0, 0), (0, 1), (1, 0), (1, 1)]:
                point = np.array(field_grid.point_of(tables, 1, row + i, column + j))
                assert (low <= point + 1e-6).all()
                assert (high >= point - 1e-6).all()
                assert point[2] == heights[row + i, column + j].astype(float) * 0.7
    assert sorted(cells) == [(r, c) for r in range(rows - 1) for c in range(columns - 1)]


def naive_met(low, high, origins, directions, limit):
    """Whether any ray enters a box no farther than the limit, by its slabs."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - origins) / directions, (high - origins) / directions
    near, far = np.fmin(one, other).max(axis=1), np.fmax(one, other).min(axis=1)
    return bool(((near <= far) & (far >= 0.0) & (near <= limit)).any())


@pytest.mark.parametrize("spread", [0.0, 0.02])
@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_no_box_that_a_beam_enters_is_ruled_out(spread, offset):
    """Also far from the frame's origin, and of beams that leave from several places."""
    rng = np.random.default_rng(7)
    met = kept = 0
    for _ in range(120):
        rays = np.zeros(TILE_NUMBERS)
        about = np.array([1.0, 0.2, -0.3]) + 0.5 * rng.normal(size=3)
        directions = about / np.linalg.norm(about) + 0.05 * rng.normal(size=(LANES, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        origins = (
            offset + 0.5 * rng.normal(size=3) - 2.0 * about + spread * rng.normal(size=(LANES, 3))
        )
        for axis in range(3):
            first, start = int(WX) + LANES * axis, int(PX) + LANES * axis
            rays[first : first + LANES] = directions[:, axis]
            rays[start : start + LANES] = origins[:, axis]
        frame, slopes = np.empty((3, 3)), np.empty((9, 4))
        planes, sides = np.empty((9, fans.FAN_COLUMNS), np.float32), np.empty((9, 15), np.uint64)
        fans.choose_frame(LANES, rays, frame)
        bits = rays.view(np.int64)
        assert fans.measure_slopes(rays, bits, frame, slopes)
        fans.measure_packets(WIDTH, rays, bits, slopes)
        margin = fans.ROUNDING * (np.abs(origins).sum(axis=1).max() + offset + 10.0)
        stop = LANES if spread > 0.0 else 1
        fans.set_fan(fans.TILE, slopes, frame, rays, PX, 0, stop, margin, planes, sides)
        fans.bound_fan(slopes, frame, rays, PX, stop, 6.0, margin, planes)
        for p in range(WIDTH):
            end = WIDTH * (p + 1) if spread > 0.0 else WIDTH * p + 1
            fans.set_fan(p, slopes, frame, rays, PX, WIDTH * p, end, margin, planes, sides)
        lower = offset + 2.0 * rng.normal(size=(CHILDREN, 3))
        upper = lower + rng.exponential(size=(CHILDREN, 3))
        tree = build_wide_tree(lower, upper)
        for node in range(len(tree.boxes)):
            for fan in range(9):
                limit = np.float32(rng.uniform(1.0, 6.0))
                lanes = slice(None) if fan == fans.TILE else slice(WIDTH * fan, WIDTH * (fan + 1))
                mask = fans.boxes_met(
                    tree.boxes, node, tree.boxes, node, 0, planes, sides, fan, limit
                )
                for child in np.flatnonzero(tree.links[node]):
                    low, high = corners(tree.boxes, node, child)
                    entered = naive_met(low, high, origins[lanes], directions[lanes], limit)
                    kept += bool(mask >> int(child) & 1)
                    met += entered
                    assert not entered or mask >> int(child) & 1
    assert met > 150
    assert kept < 2.2 * met  # planes are tight enough to be of use
