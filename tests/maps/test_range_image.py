"""A sweep as a range image: lost echoes between returns, and the noise of its ranges."""

import math

import numpy as np
import pytest

from wayproof.maps.kernels import range_image as kernels
from wayproof.maps.range_image import (
    LEAST_TRIPLES,
    lost_echoes,
    lost_share,
    range_deviation,
    reach_for,
)

NO_RETURN, DROPPED = 65535, 0


def random_image(seed, rows=5, columns=23):
    """Ranges of which a third has no return and a tenth was dropped, mm."""
    rng = np.random.default_rng(seed)
    fate = rng.random((rows, columns))
    image = rng.integers(1, 12_000, (rows, columns))
    image[fate < 0.35] = NO_RETURN
    image[fate < 0.1] = DROPPED
    image[0], image[1] = NO_RETURN, DROPPED
    return image.astype(np.uint16 if seed % 2 else np.uint32)


def naive_lost(image, closed, reach):
    rows, columns = image.shape
    lost = np.zeros(image.shape, bool)
    for i in range(rows):
        for j in range(columns):
            if image[i, j] != NO_RETURN:
                continue
            sides = []
            for step in (-1, 1):
                beside = [j + step * k for k in range(1, reach + 1)]
                within = [k % columns for k in beside] if closed else beside
                inside = [k for k in within if 0 <= k < columns]
                returned = any(image[i, k] not in (NO_RETURN, DROPPED) for k in inside)
                sides.append(returned or len(inside) < reach)
            lost[i, j] = all(sides)
    return lost


def naive_share(image, closed):
    rows, columns = image.shape
    beside = silent = 0
    for i in range(rows):
        for j in range(columns):
            sides = [j - 1, j + 1]
            if not closed and not 0 < j < columns - 1:
                continue
            if any(image[i, k % columns] in (NO_RETURN, DROPPED) for k in sides):
                continue
            beside += image[i, j] != DROPPED
            silent += image[i, j] == NO_RETURN
    return silent / beside


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_lost_echoes_are_those_between_returns(seed, closed):
    image = random_image(seed)
    share = lost_share(image, closed)
    assert share == naive_share(image, closed) > 0.0
    counts = kernels.count_silent.py_func(image, closed)
    assert counts == kernels.count_silent(image, closed)
    reach = reach_for(share)
    expected = naive_lost(image, closed, reach)
    np.testing.assert_array_equal(lost_echoes(image, closed), expected)
    interpreted = np.empty(image.shape, bool)
    find = kernels.find_lost.py_func
    assert find(image, reach, closed, interpreted) == expected.sum() > 0
    np.testing.assert_array_equal(interpreted, expected)


@pytest.mark.parametrize(
    ("share", "reach"),
    [(0.0, 1), (0.01, 1), (0.05, 2), (0.2, 3), (0.3, 4), (0.6, 10), (0.9, 24), (1.0, 24)],
)
def test_the_more_is_lost_the_farther_a_return_counts(share, reach):
    assert reach_for(share) == reach


@pytest.mark.parametrize("share", [0.03, 0.3, 0.6])
def test_echoes_lost_at_random_are_found_and_an_opening_is_not(share):
    image = room(0.0, share)
    image[:, 200:260] = NO_RETURN
    lost = lost_echoes(image, closed=True)
    silent = image == NO_RETURN
    assert lost_share(image, closed=True) == pytest.approx(share, rel=0.1)
    assert lost[:, 230:232].sum() == 0
    around = np.ones(image.shape[1], bool)
    around[190:270] = False
    assert lost[:, around].sum() >= 0.97 * silent[:, around].sum()


def test_in_a_clean_sweep_a_gap_of_two_columns_is_free():
    image = room(0.0)
    image[:, 50], image[:, 100:102], image[0, 300] = NO_RETURN, NO_RETURN, DROPPED
    lost = lost_echoes(image, closed=True)
    assert np.flatnonzero(lost.any(axis=0)).tolist() == [50]


def test_beside_the_border_the_image_goes_on_where_it_is_closed():
    image = np.full((1, 60), 5000, np.uint16)
    image[0, 0] = NO_RETURN
    assert lost_echoes(image, closed=False)[0, 0]
    assert lost_echoes(image, closed=True)[0, 0]
    image[0, 59] = NO_RETURN
    assert np.flatnonzero(lost_echoes(image, closed=False)[0]).tolist() == [0, 59]
    assert not lost_echoes(image, closed=True).any()


def room(noise_m, lost=0.0, seed=0, rows=32, columns=512):
    """Ranges in a room of 8 x 6 m with a pillar, mm."""
    rng = np.random.default_rng(seed)
    azimuth = 2.0 * math.pi * (np.arange(columns) + 0.3) / columns
    to_walls = np.minimum(4.0 / np.abs(np.cos(azimuth)), 3.0 / np.abs(np.sin(azimuth)))
    to_walls[100:120] = 1.5
    ranges = to_walls + noise_m * rng.standard_normal((rows, columns))
    image = np.rint(1e3 * ranges).astype(np.uint16)
    image[rng.random((rows, columns)) < lost] = NO_RETURN
    return image


@pytest.mark.parametrize("lost", [0.0, 0.6])
@pytest.mark.parametrize("noise_m", [0.01, 0.03, 0.12, 0.24])
def test_the_deviation_is_that_of_the_ranges(noise_m, lost):
    assert range_deviation(room(noise_m, lost)) == pytest.approx(noise_m, rel=0.06)


def test_ranges_without_errors_deviate_by_no_more_than_walls_bend_them():
    assert range_deviation(room(0.0)) < 0.002


def test_too_few_triples_hold_no_deviation():
    image = np.full((1, LEAST_TRIPLES + 2), 5000, np.uint16)
    assert range_deviation(image) == 0.0
    image[0, 7] = DROPPED
    assert range_deviation(image) is None


def test_compiled_and_interpreted_count_alike():
    for seed in range(4):
        image = random_image(seed)
        compiled, interpreted = np.empty(500, np.int64), np.empty(500, np.int64)
        total = kernels.count_bends(image, compiled)
        assert total == kernels.count_bends.py_func(image, interpreted) == compiled.sum() > 0
        np.testing.assert_array_equal(compiled, interpreted)
        seen = np.where((image == NO_RETURN) | (image == DROPPED), -1, image.astype(np.int64))
        triples = [row[j : j + 3] for row in seen for j in range(len(row) - 2)]
        bends = [abs(a - 2 * b + c) for a, b, c in triples if min(a, b, c) > 0]
        naive = np.bincount(np.minimum(bends, 499), minlength=500)
        np.testing.assert_array_equal(compiled, naive)
