"""Height fields as grids under pyramids of their lowest and highest points.

A grid needs no tree: which cells are where follows from their numbers, and only heights are kept
(Tevs, Ihrke and Seidel, "Maximum mipmaps for fast, accurate, and scalable dynamic height field
rendering", 2008). A node has eight children, by turns 4 x 2 and 2 x 4, so that each second level is
square again; those of the lowest level are cells. A field of 300 x 300 then takes 1.2 MB, where its
triangles under a tree take 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.packets import U
from wayproof.models.rays.wide_tree import CHILDREN, HEIGHTS

BROAD = np.array([4, 2])
"""Children of a node side by side in x, at even and at odd levels; in y the others."""

IN_X = np.array([1, 0, 1, 0], np.float32).repeat(CHILDREN)
IN_Y = np.float32(1.0) - IN_X
"""Whether a column of a node before the heights is an x or a y."""

WIDTHS, LENGTHS = np.zeros((2, 2, HEIGHTS), np.float32)
"""Offsets of a column from a node's lower corner along x and y, children, (2, 32) by level."""

for _level, _broad in enumerate(BROAD):
    _x, _y = np.arange(CHILDREN) % _broad, np.arange(CHILDREN) // _broad
    WIDTHS[_level] = np.concatenate([_x, 0 * _x, _x + 1, 0 * _x])
    LENGTHS[_level] = np.concatenate([0 * _y, _y, 0 * _y, _y + 1])

PLACE_BITS = 20
"""Bits of each coordinate in the number of a node: the highest ones are its level."""

FIRST_LEVEL, LEVELS, FIRST_HEIGHT, ROWS, COLUMNS, FIRST_FACE = range(6)  # columns of `fields`
STEP_X, STEP_Y, HALF_X, HALF_Y, TOP = range(5)  # columns of `sizes`
NODES, WIDTH = range(2)  # columns of `levels`


class Fields(NamedTuple):
    """All height fields that are seen.

    Attributes:
        heights: (h,) shares of the highest point, row by row and field by field.
        ranges: (k, 16) lowest points of a node's children, m, then the highest ones, rounded
            outwards; not a number where there is no child.
        levels: (l, 2) of each level of a field, from the cells up: its first node, and nodes in x.
        fields: (f, 6) first level, number of levels, first height, rows, columns, and what the
            first triangle of a field is numbered as among all assets' triangles.
        sizes: (f, 5) sides of a cell in x and y, half sides of the field, height of the highest
            point, m.
    """

    heights: NDArray[np.float32]
    ranges: NDArray[np.float32]
    levels: NDArray[np.int64]
    fields: NDArray[np.int64]
    sizes: Array


def no_fields() -> Fields:
    """Return the tables of no height field."""
    return Fields(
        np.empty(0, np.float32),
        np.empty((0, 2 * CHILDREN), np.float32),
        np.empty((0, 2), np.int64),
        np.empty((0, 6), np.int64),
        np.empty((0, 5)),
    )


def add_field(
    tables: Fields, heights: NDArray[np.float32], half: tuple[float, float], top: float, face: int
) -> Fields:
    """Return the tables with one field more.

    Args:
        tables: Fields so far.
        heights: (rows, columns) shares of the highest point; rows go up in y.
        half: Half sides in x and y, m.
        top: Height of the highest point, m.
        face: Number of the field's first triangle.
    """
    rows, columns = heights.shape
    points = heights.astype(np.float64) * top
    corners = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    lowest, highest = np.minimum.reduce(corners), np.maximum.reduce(corners)  # of cells
    ranges, nodes = [tables.ranges], len(tables.ranges)
    levels: list[tuple[int, int]] = []
    while not levels or lowest.size > 1:
        broad = int(BROAD[len(levels) % 2])
        low, high = (_children(side, broad) for side in (lowest, highest))  # (rows, columns, 8)
        levels.append((nodes, low.shape[1]))
        nodes += low.shape[0] * low.shape[1]
        down, up = np.float32(-np.inf), np.float32(np.inf)
        outer = np.concatenate(
            [
                np.nextafter(low.astype(np.float32), down),
                np.nextafter(high.astype(np.float32), up),
            ],
            axis=2,
        )
        ranges.append(outer.reshape(-1, 2 * CHILDREN))
        lowest, highest = np.fmin.reduce(low, axis=2), np.fmax.reduce(high, axis=2)
    field = (len(tables.levels), len(levels), len(tables.heights), rows, columns, face)
    step_x, step_y = 2.0 * half[0] / (columns - 1), 2.0 * half[1] / (rows - 1)
    return Fields(
        np.concatenate([tables.heights, heights.ravel()]),
        np.concatenate(ranges),
        np.concatenate([tables.levels, np.array(levels, np.int64)]),
        np.concatenate([tables.fields, np.array([field], np.int64)]),
        np.concatenate([tables.sizes, [(step_x, step_y, *half, top)]]),
    )


def _children(values: Array, broad: int) -> Array:
    """Return values (rows, columns) as the children (r, c, 8) of nodes, NaN where there is none."""
    deep = CHILDREN // broad
    rows, columns = -(-values.shape[0] // deep), -(-values.shape[1] // broad)
    padded = np.full((rows * deep, columns * broad), np.nan)
    padded[: values.shape[0], : values.shape[1]] = values
    blocks = padded.reshape(rows, deep, columns, broad).transpose(0, 2, 1, 3)
    return blocks.reshape(rows, columns, CHILDREN)


def count_faces(rows: int, columns: int) -> int:
    """Return the number of triangles of a field: two a cell."""
    return 2 * (rows - 1) * (columns - 1)


@kernel
def child_of(node: int, child: int) -> int:
    """Return the number of a node's child; below level 0 it is a cell."""
    mask = (1 << PLACE_BITS) - 1
    level, y, x = node >> 2 * PLACE_BITS, node >> PLACE_BITS & mask, node & mask
    broad = 4 if level % 2 == 0 else 2
    deep = CHILDREN // broad
    x, y = x * broad + child % broad, y * deep + child // broad
    return ((level - 1) << 2 * PLACE_BITS) + (y << PLACE_BITS) + x


@kernel
def top_node(tables: Fields, field: int) -> int:
    """Return the number of the node that holds a whole field."""
    return int((tables.fields[field, LEVELS] - 1) << 2 * PLACE_BITS)


@kernel
def unfold(tables: Fields, field: int, node: int, boxes: NDArray[np.float32]) -> int:
    """Write x and y of a node's children into a node (1, 48); return its row of `ranges`."""
    _, _, levels, fields, sizes = tables
    mask = (1 << PLACE_BITS) - 1
    level, y, x = node >> 2 * PLACE_BITS, node >> PLACE_BITS & mask, node & mask
    row_of_level = fields[field, FIRST_LEVEL] + level
    row = levels[row_of_level, NODES] + y * levels[row_of_level, WIDTH] + x
    # Each two levels span 8 x 8 cells; an odd level's children 4 x 2 of them.
    wide, long = 1 << 3 * (level // 2), 1 << 3 * (level // 2)
    broad = 4
    if level % 2 == 1:
        wide, long, broad = 4 * wide, 2 * long, 2
    step_x, step_y = sizes[field, STEP_X] * wide, sizes[field, STEP_Y] * long
    first_x = np.float32(step_x * (x * broad) - sizes[field, HALF_X])
    first_y = np.float32(step_y * (y * (CHILDREN // broad)) - sizes[field, HALF_Y])
    width, length = np.float32(step_x), np.float32(step_y)
    shape = U(level % 2)
    for column in range(HEIGHTS):
        k = U(column)
        boxes[0, k] = (
            first_x * IN_X[k]
            + width * WIDTHS[shape, k]
            + (first_y * IN_Y[k] + length * LENGTHS[shape, k])
        )
    return int(row)


@kernel
def point_of(tables: Fields, field: int, row: int, column: int) -> Vector3:
    """Return the place of a height in the field's frame, m."""
    heights, _, _, fields, sizes = tables
    place = fields[field, FIRST_HEIGHT] + row * fields[field, COLUMNS] + column
    x = sizes[field, STEP_X] * column - sizes[field, HALF_X]
    y = sizes[field, STEP_Y] * row - sizes[field, HALF_Y]
    return x, y, np.float64(heights[place]) * sizes[field, TOP]


def field_normals(tables: Fields, field: int, faces: NDArray[np.int64]) -> Array:
    """Return normals (k, 3), of any length, of triangles (k,) of a field by their own numbers."""
    first, columns = tables.fields[field, FIRST_HEIGHT], int(tables.fields[field, COLUMNS])
    step_x, step_y, _, _, top = tables.sizes[field]
    row, column = np.divmod(faces // 2, columns - 1)
    near = first + row * columns + column
    heights = top * tables.heights.astype(np.float64)
    a, b, c, d = (heights[near + k] for k in (0, 1, columns + 1, columns))
    lower = faces % 2 == 0
    slope_x, slope_y = (
        np.where(lower, b - a, c - d) / step_x,
        np.where(lower, c - b, d - a) / step_y,
    )
    return np.stack([-slope_x, -slope_y, np.ones(len(faces))], axis=1)
