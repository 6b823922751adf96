"""Boxes that stand for runs of cells."""

import numpy as np

from wayproof.harness.viewer.boxes import runs, surrounding_boxes


def test_runs_by_hand():
    rows = np.array([[1, 1, 0, 1], [0, 0, 0, 0], [0, 1, 1, 1]], bool)
    row, first, end = runs(rows)
    assert list(zip(row, first, end, strict=True)) == [(0, 0, 2), (0, 3, 4), (2, 1, 4)]


def test_boxes_around_a_map_cover_the_outside_once_and_none_of_the_map():
    origin = np.array([-1.0, 2.0, 0.0])
    middles, halves = surrounding_boxes((20, 10), origin, 0.1, 3.0)  # x -1 to 1, y 2 to 3
    rng = np.random.default_rng(0)
    points = rng.uniform((-4.0, -1.0), (4.0, 6.0), (500, 2))
    inside = ((points > (-1.0, 2.0)) & (points < (1.0, 3.0))).all(axis=1)
    hits = (np.abs(points[:, None] - middles) <= halves).all(axis=2).sum(axis=1)
    assert inside.any()
    np.testing.assert_array_equal(hits, np.where(inside, 0, 1))
