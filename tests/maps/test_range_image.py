"""A sweep as a range image: lost echoes between returns, and the noise of its ranges."""

import math

import numpy as np
import pytest

from wayproof.maps.kernels import range_image as kernels
from wayproof.maps.range_image import (
    LEAST_FALSE,
    LEAST_TRIPLES,
    false_returns,
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
@pytest.mark.parametrize("seed", range(2))
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


def naive_protruding(image, farthest, depth, sky, closed):
    rows, columns = image.shape
    protruding = np.zeros(image.shape, bool)
    for i in range(rows):
        for j in range(columns):
            own = int(image[i, j])
            if own in (NO_RETURN, DROPPED) or own > farthest:
                continue
            sides = []
            for step in (-1, 1):
                beside = [j + step * k for k in range(1, kernels.BESIDE + 1)]
                inside = [k % columns for k in beside if closed or 0 <= k < columns]
                ranges = [int(image[i, k]) for k in inside]
                seen = [one for one in ranges if one != DROPPED and (sky or one != NO_RETURN)]
                sides.append(all(one > own + depth for one in seen) and (seen or not inside))
            protruding[i, j] = all(sides)
    return protruding


def naive_isolated(image, protruding, near, closed):
    rows, columns = image.shape
    isolated = protruding.copy()
    for i, j in zip(*np.nonzero(protruding), strict=True):
        for row in (i - 1, i + 1):
            for column in (j - 1, j, j + 1):
                if not 0 <= row < rows or not (closed or 0 <= column < columns):
                    continue
                other = (row, column % columns)
                if protruding[other] and abs(int(image[other]) - int(image[i, j])) <= near:
                    isolated[i, j] = False
    return isolated


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("sky", [True, False])
@pytest.mark.parametrize("seed", range(2))
def test_single_returns_before_others_are_found_as_a_naive_search_does(seed, sky, closed):
    image = random_image(seed, rows=9)
    image[2:, ::3] //= 4
    image[image == 16383] = NO_RETURN
    args = image, 6000, 50, sky, closed
    expected = naive_protruding(*args)
    assert 0 < expected.sum() < expected.size / 2
    for find in (kernels.find_protruding, kernels.find_protruding.py_func):
        protruding = np.empty(image.shape, bool)
        returns = ((image != NO_RETURN) & (image != DROPPED)).sum()
        assert find(*args, protruding) == (returns, expected.sum())
        np.testing.assert_array_equal(protruding, expected)
    for near in (100, 3000):
        isolated = naive_isolated(image, expected, near, closed)
        for find in (kernels.find_isolated, kernels.find_isolated.py_func):
            got = np.empty(image.shape, bool)
            assert find(image, expected, near, closed, got) == isolated.sum()
            np.testing.assert_array_equal(got, isolated)


def rain(image, share, seed=1, nearest=500):
    """The image with false returns before its own, and where they are."""
    rng = np.random.default_rng(seed)
    false = rng.integers(nearest, 4000, image.shape)
    chosen = (rng.random(image.shape) < share) & (false < image.astype(np.int64) - 300)
    return np.where(chosen, false, image).astype(image.dtype), chosen


@pytest.mark.parametrize("noise_m", [0.0, 0.03])
@pytest.mark.parametrize("share", [0.01, 0.03, 0.1])
def test_false_returns_are_found_and_surfaces_are_not(share, noise_m):
    image, chosen = rain(room(noise_m), share)
    found = false_returns(image, closed=True, farthest_m=5.0, deviation_m=noise_m)
    assert found[chosen].mean() > 0.9 - 4.0 * share
    assert found[~chosen].mean() < 0.001


def test_before_open_sky_they_are_found_unless_echoes_get_lost():
    sky = np.full((32, 512), NO_RETURN, np.uint16)
    image, chosen = rain(sky, 0.02)
    found = false_returns(image, closed=True, farthest_m=5.0, deviation_m=0.0)
    assert found[chosen].mean() > 0.9
    walls = room(0.0, lost=0.3)
    walls[8:24] = image[8:24]
    kept = false_returns(walls, closed=True, farthest_m=5.0, deviation_m=0.0)
    assert kept is None or not kept[8:24].any()


def test_a_pole_one_beam_wide_and_a_thing_two_beams_wide_are_no_false_returns():
    image, _ = rain(room(0.0), 0.02)
    image[10:14, 300] = 1100  # four rows of a pole
    image[20, 400:402] = 1100
    image[24, 200] = 1100
    found = false_returns(image, closed=True, farthest_m=5.0, deviation_m=0.0)
    assert not found[10:14, 300].any()
    assert not found[20, 400:402].any()
    assert found[24, 200]


def test_few_single_returns_are_tips_of_things_and_a_single_row_holds_none():
    image = room(0.0)
    image[5, 50:500:30] = 1000  # 15 of 16,384
    assert 15 / image.size < LEAST_FALSE
    assert false_returns(image, closed=True, farthest_m=5.0, deviation_m=0.0) is None
    image[9, 50:500:15] = 1000
    assert false_returns(image, closed=True, farthest_m=5.0, deviation_m=0.0)[5, 50]
    assert false_returns(image[5:6], closed=True, farthest_m=5.0, deviation_m=0.0) is None


def test_beyond_the_range_at_which_two_beams_meet_a_thing_nothing_is_false():
    image, chosen = rain(room(0.0), 0.05)
    found = false_returns(image, closed=True, farthest_m=1.0, deviation_m=0.0)
    assert not found[image > 1000].any()
    assert found[chosen & (image <= 1000)].mean() > 0.9


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
