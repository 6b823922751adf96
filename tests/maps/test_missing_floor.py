"""Missing floor, believed where it is silent in many sweeps in a row."""

import math
from collections import defaultdict

import numpy as np
import pytest

from tests.maps.test_ground_fit import NO_RETURN, RANGE_M, beams, moments_of
from wayproof.maps.ground_fit import TILE, TILES
from wayproof.maps.kernels.ground_fit import HOLE_BEAMS
from wayproof.maps.missing_floor import HOLE_SWEEPS, MissingFloor, lost_echoes_of_one

DIRECTIONS = beams(60, 480)
HOLE = -2.2, 0.0, 1.25  # x and y of its centre and half its edge, m


def floor_sweep(x, hole=True):
    """A sweep above a floor with a hole, from x: origins, floor points and ranges."""
    origins = np.array([[x, -0.3, 0.5]])
    ranges = np.where(DIRECTIONS[:, 2] < -0.05, -0.5 / np.minimum(DIRECTIONS[:, 2], -0.05), np.inf)
    ends = origins[0] + np.where(np.isfinite(ranges), ranges, 0.0)[:, None] * DIRECTIONS
    inside = np.abs(ends[:, 0] - HOLE[0]) < HOLE[2]
    inside &= (np.abs(ends[:, 1] - HOLE[1]) < HOLE[2]) & hole
    met = (ranges < RANGE_M) & ~inside
    ranges_mm = np.where(met, np.rint(np.where(met, ranges, 0.0) * 1e3), NO_RETURN)
    return origins, ends, ranges_mm.astype(np.uint16), inside


def take_in(missing, origins, ranges_mm):
    return missing.lost_echoes(origins, moments_of(ranges_mm), DIRECTIONS, ranges_mm, RANGE_M)


def test_a_hole_is_one_after_so_many_sweeps_from_wherever_they_are():
    missing, found = MissingFloor(), []
    for n in range(HOLE_SWEEPS + 10):
        origins, ends, ranges_mm, inside = floor_sweep(0.02 * n)
        lost = take_in(missing, origins, ranges_mm)
        inner = inside & (np.hypot(ends[:, 0] - HOLE[0], ends[:, 1] - HOLE[1]) < 0.4)
        assert inner.sum() > HOLE_BEAMS
        found.append(lost[inner].mean())
        assert not lost[ranges_mm != NO_RETURN].any()
        assert not lost[DIRECTIONS[:, 2] >= 0.0].any()
    assert found[: HOLE_SWEEPS - 1] == [1.0] * (HOLE_SWEEPS - 1)
    assert found[HOLE_SWEEPS - 1] < 0.5  # all but tiles that had no beam in one of them
    assert found[-1] == 0.0


def test_patches_lost_anew_in_each_sweep_are_no_hole():
    missing, rng, silent = MissingFloor(), np.random.default_rng(4), 0
    for _ in range(60):
        origins, _, ranges_mm, _ = floor_sweep(0.0, hole=False)
        image = ranges_mm.reshape(60, 480)
        first = int(rng.integers(480))
        image[:33, (first + np.arange(262)) % 480] = NO_RETURN  # 30 % of the beams
        alone = lost_echoes_of_one(origins, moments_of(ranges_mm), DIRECTIONS, ranges_mm, RANGE_M)
        lost = take_in(missing, origins, ranges_mm)
        down = (ranges_mm == NO_RETURN) & (DIRECTIONS[:, 2] < -0.05)
        silent += (~alone[down]).sum()
        assert lost[down].all()
    assert silent > 10_000


def test_one_return_where_a_hole_was_believed_begins_anew():
    missing = MissingFloor()
    for _ in range(HOLE_SWEEPS):
        origins, ends, ranges_mm, inside = floor_sweep(0.0)
        lost = take_in(missing, origins, ranges_mm)
    inner = inside & (np.hypot(ends[:, 0] - HOLE[0], ends[:, 1] - HOLE[1]) < 0.4)
    assert not lost[inner].any()
    take_in(missing, origins, floor_sweep(0.0, hole=False)[2])
    assert take_in(missing, origins, ranges_mm)[inner].all()


def naive(history):
    """Tiles of the world that were silent in so many sweeps in a row, by dictionaries."""
    runs = defaultdict(int)
    for origins, ranges_mm in history:
        silent, answered = defaultdict(int), set()
        x0, y0 = (math.floor(v / TILE) for v in origins[0, :2])
        reach = TILES // 2
        runs = defaultdict(
            int,
            {
                tile: run
                for tile, run in runs.items()
                if max(abs(tile[0] - x0), abs(tile[1] - y0)) <= reach
            },
        )
        for direction, range_mm in zip(DIRECTIONS, ranges_mm, strict=True):
            if direction[2] >= 0.0 or -origins[0, 2] / direction[2] > RANGE_M:
                continue
            r = -origins[0, 2] / direction[2]
            tile = tuple(math.floor((origins[0, k] + r * direction[k]) / TILE) for k in range(2))
            if range_mm != NO_RETURN:
                answered.add(tile)
            else:
                silent[tile] += 1
        for tile in {*silent, *answered}:
            about = [(tile[0] + i, tile[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            if answered & set(about):
                runs[tile] = 0
            elif sum(silent[one] for one in about) >= HOLE_BEAMS:
                runs[tile] = min(runs[tile] + 1, HOLE_SWEEPS)
    return {tile: run for tile, run in runs.items() if run}


def test_the_tiles_are_those_of_a_naive_count_and_move_with_the_sensor():
    missing, history, rng = MissingFloor(), [], np.random.default_rng(8)
    for n in range(12):
        origins, _, ranges_mm, _ = floor_sweep(-1.7 + 0.45 * n)
        ranges_mm[rng.random(len(ranges_mm)) < 0.3] = NO_RETURN
        history.append((origins, ranges_mm))
        take_in(missing, origins, ranges_mm)
    expected, (x, y) = naive(history), missing.tile
    assert len(expected) > 20
    assert max(expected.values()) > 5
    middle = TILES // 2
    found = {
        (int(i) + x - middle, int(j) + y - middle): int(missing.silent_sweeps[i, j])
        for i, j in np.argwhere(missing.silent_sweeps)
    }
    assert found == expected


def test_a_jump_beyond_all_tiles_forgets_them():
    missing = MissingFloor()
    take_in(missing, *floor_sweep(0.0)[:3:2])
    assert missing.silent_sweeps.any()
    take_in(missing, *floor_sweep(1000.0, hole=False)[:3:2])
    assert not missing.silent_sweeps.any()


def test_what_is_none_of_it_is_refused():
    missing, right = MissingFloor(), np.zeros((TILES, TILES), np.uint8)
    with pytest.raises(ValueError, match="tiles of floor"):
        missing.restore(right[1:], (0, 0))
    with pytest.raises(ValueError, match="sweeps"):
        missing.restore(right + np.uint8(HOLE_SWEEPS + 1), (0, 0))
    with pytest.raises(ValueError, match="floor about tile"):
        missing.restore(right, (1 << 30, 0))
    assert missing.tile == (0, 0)
