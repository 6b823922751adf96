"""The plane of a floor in a sweep: found, levelled; and the echoes that were lost from it."""

import math

import numpy as np
import pytest

from tests.maps.sweeps import scan
from wayproof.maps.ground_fit import TILE, fit_ground, level
from wayproof.maps.kernels import ground_fit as kernels
from wayproof.maps.missing_floor import lost_echoes_of_one

SENSOR = np.array([[0.4, -0.3, 0.5]])
LOW_SENSOR = np.array([[0.4, -0.3, 0.42]])
NO_RETURN, DROPPED = 65535, 0
RANGE_M = 15.0


def beams(rows=40, columns=120):
    """Directions of a scanner, from 60 degrees down to 10 up."""
    around = np.linspace(-math.pi, math.pi, columns, endpoint=False)
    return scan(np.radians(np.linspace(-60.0, 10.0, rows)), around)


def cast(directions, slopes=(0.0, 0.0), height=0.0, wall_x=4.0, noise=0.0, seed=0):
    """Ranges to a plane, and to a wall on one side, mm."""
    plane_normal = np.array([-slopes[0], -slopes[1], 1.0])
    down = directions @ plane_normal
    floor = np.where(down < 0.0, -(SENSOR[0, 2] - height) / np.minimum(down, -1e-9), np.inf)
    ahead = directions[:, 0]
    wall = np.where(ahead > 0.0, (wall_x - SENSOR[0, 0]) / np.maximum(ahead, 1e-9), np.inf)
    ranges = np.minimum(floor, wall)
    met = ranges < RANGE_M
    error = noise * np.random.default_rng(seed).standard_normal(len(ranges))
    return np.where(met, np.rint((np.where(met, ranges, 0) + error) * 1e3), NO_RETURN).astype(
        np.uint16
    )


def moments_of(ranges_mm):
    return np.zeros(len(ranges_mm), np.int32)


def heights(sweep, of):
    returned = (sweep.ranges_mm != NO_RETURN) & (sweep.ranges_mm != DROPPED) & of
    return sweep.origins[0, 2] + sweep.ranges_mm[returned] * 1e-3 * sweep.directions[returned, 2]


@pytest.mark.parametrize("slopes", [(0.0, 0.0), (0.0175, 0.0), (-0.01, 0.02)])
@pytest.mark.parametrize(("noise", "within"), [(0.0, 0.0005), (0.03, 0.003)])
def test_the_plane_is_found_beside_a_wall(slopes, noise, within):
    directions = beams()
    ranges_mm = cast(directions, slopes, 0.02, noise=noise)
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    assert np.abs(plane.numbers[:3] - [0.02, *slopes]).max() < within
    assert plane.range_deviation == pytest.approx(noise, rel=0.15, abs=0.005)
    expected = slopes == (0.0, 0.0) and noise == 0.0
    low = cast(directions, slopes, noise=noise)
    assert fit_ground(SENSOR, moments_of(low), directions, low).as_expected == expected


def test_a_sweep_is_levelled_and_what_stands_on_the_floor_stays():
    directions = beams(80, 360)
    slopes = (0.0175, -0.01)
    ranges_mm = cast(directions, slopes, noise=0.02)
    box = (np.abs(directions[:, 1]) < 0.1) & (directions[:, 0] < 0.0)  # 0.2 m high, 1.5 m behind
    reach = np.where(box, 1.5 / np.maximum(-directions[:, 0], 1e-9), np.inf)
    top = SENSOR[0, 2] + reach * directions[:, 2]
    hit = box & (top > 0.0) & (top < 0.2)
    ranges_mm[hit] = np.rint(reach[hit] * 1e3)
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    found = level(SENSOR, moments_of(ranges_mm), directions, ranges_mm, plane)
    assert np.abs(heights(found, found.on_floor)).max() < 0.0011  # millimetres of range
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1.0, atol=1e-12)
    assert not found.on_floor[hit & (top > 0.1)].any()
    ends = SENSOR[0] + ranges_mm[:, None] * 1e-3 * directions
    floor = (ranges_mm != NO_RETURN) & ~hit & (ends[:, 0] < 3.5) & (directions[:, 2] < -0.1)
    assert found.on_floor[floor].mean() > 0.99


def on_pallets(directions, slopes, noise):
    """Ranges to a floor with pallets on every second square of it, mm; and which meet them."""
    ranges_mm, tops = (cast(directions, slopes, high, wall_x=50.0) for high in (0.0, 0.14))
    x, y, _ = (SENSOR[0] + tops[:, None] * 1e-3 * directions).T
    pallet = (tops < ranges_mm) & ((np.floor(x / 1.2) + np.floor(y / 1.2)) % 2 == 0)
    ranges_mm = np.where(pallet, tops, ranges_mm)
    error = np.random.default_rng(4).standard_normal(len(ranges_mm)) * noise * 1e3
    noisy = np.where(ranges_mm == NO_RETURN, NO_RETURN, np.rint(ranges_mm + error))
    return noisy.astype(np.uint16), pallet


@pytest.mark.parametrize("slopes", [(0.0, 0.0), (0.0175, 0.0)])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_what_stands_on_half_of_the_floor_does_not_lift_it(slopes, noise):
    directions = beams(80, 360)
    ranges_mm, pallet = on_pallets(directions, slopes, noise)
    assert pallet.sum() > 5000
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    assert np.abs(plane.numbers[:3] - [0.0, *slopes]).max() < 0.003
    assert plane.as_expected == (slopes == (0.0, 0.0) and noise == 0.0)


def test_a_pit_beside_a_floor_as_expected_changes_nothing():
    directions = beams(80, 360)
    ranges_mm = cast(directions)
    deep = cast(directions, height=-0.2)
    floor = SENSOR[0] + ranges_mm[:, None] * 1e-3 * directions
    pit = (np.abs(floor[:, 2]) < 0.01) & (floor[:, 0] < -0.5) & (floor[:, 1] > -1.0)
    ranges_mm[pit] = deep[pit]
    assert pit.sum() > 1000
    assert fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm).as_expected


def test_a_low_step_is_no_noise_of_the_floor():
    directions = beams(200, 720)
    ranges_mm = cast(directions, noise=0.02)
    down = directions[:, 2] < -0.1
    reach = np.where(down, (SENSOR[0, 2] - 0.05) / -np.minimum(directions[:, 2], -0.1), 0.0)
    ends = SENSOR[0] + reach[:, None] * directions
    step = down & (np.abs(ends[:, 0] + 1.0) < 0.25) & (np.abs(ends[:, 1]) < 0.5)
    error = 0.02 * np.random.default_rng(1).standard_normal(len(reach))
    ranges_mm[step] = np.rint((reach[step] + error[step]) * 1e3)
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    found = level(SENSOR, moments_of(ranges_mm), directions, ranges_mm, plane)
    inner = step & (np.abs(ends[:, 0] + 1.0) < 0.25 - TILE / 2)
    assert inner.sum() > 100
    assert found.on_floor[inner].mean() < 0.02
    floor = ~step & (directions[:, 0] < 0) & (directions[:, 2] < -0.2)
    assert found.on_floor[floor].mean() > 0.9


def between_walls(front, aside, behind, noise=0.02):
    """Beams of a scanner that looks 16.6 degrees down, four walls about it; and ranges, mm."""
    around = np.linspace(-math.pi, math.pi, 1024, endpoint=False)
    directions = scan(np.radians(np.linspace(-16.6, 16.6, 64)), around)
    x, y, z = directions.T
    ways = [(x, front), (-x, behind), (np.abs(y), aside), (-z, LOW_SENSOR[0, 2])]
    ranges = np.min([far / np.maximum(along, 1e-9) for along, far in ways], axis=0)
    ranges += noise * np.random.default_rng(5).standard_normal(len(ranges))
    return directions, np.rint(ranges * 1e3).astype(np.uint16)


@pytest.mark.parametrize("front", [1.0, 1.3])
@pytest.mark.parametrize("behind", [2.5, 5.0, 7.5])
def test_the_feet_of_near_walls_do_not_lift_the_floor(front, behind):
    directions, ranges_mm = between_walls(front, 1.3, behind)
    moments = moments_of(ranges_mm)
    plane = fit_ground(LOW_SENSOR, moments, directions, ranges_mm)
    assert abs(plane.numbers[0]) < 0.023


@pytest.mark.parametrize(("front", "aside"), [(0.7, 0.7), (1.0, 0.7), (1.0, 1.0), (1.3, 0.7)])
def test_where_walls_hide_the_floor_their_feet_are_none(front, aside):
    directions, ranges_mm = between_walls(front, aside, 1.3)
    assert fit_ground(LOW_SENSOR, moments_of(ranges_mm), directions, ranges_mm) is None


def deep_below(pit_depth=0.0):
    """Lowest end of levelled sweeps in 3 cm of noise, m, and a pit's share on the floor."""
    directions = beams(200, 720)
    in_pit, lowest, kept = None, [], []
    for seed in range(4):
        ranges_mm = cast(directions, wall_x=50.0, noise=0.03, seed=seed)
        if pit_depth:
            deep = cast(directions, height=-pit_depth, wall_x=50.0, noise=0.03, seed=seed)
            ends = SENSOR[0] + deep[:, None] * 1e-3 * directions
            in_pit = (np.abs(ends[:, 0] + 1.0) < 0.4) & (np.abs(ends[:, 1]) < 0.4)
            ranges_mm[in_pit] = deep[in_pit]
        moments = moments_of(ranges_mm)
        plane = fit_ground(SENSOR, moments, directions, ranges_mm)
        found = level(SENSOR, moments, directions, ranges_mm, plane)
        lowest.append(heights(found, np.ones(len(ranges_mm), bool)).min())
        kept.append(1.0 if in_pit is None else found.on_floor[in_pit].mean())
    return min(lowest), max(kept)


def test_a_single_return_below_the_floor_is_noise():
    assert deep_below()[0] > -0.03


@pytest.mark.parametrize("pit_depth", [0.07, 0.15, 0.3])
def test_returns_beside_one_another_below_the_floor_are_a_pit(pit_depth):
    assert deep_below(pit_depth)[1] < 0.3


def test_a_lost_echo_of_the_floor_is_told_from_a_hole():
    directions = beams(80, 360)
    ranges_mm = cast(directions)
    down = SENSOR[0] + ranges_mm[:, None] * 1e-3 * directions
    floor = (np.abs(down[:, 2]) < 0.01) & (ranges_mm != NO_RETURN)
    hole = floor & (np.abs(down[:, 0] + 2.5) < 1.0) & (np.abs(down[:, 1]) < 1.0)
    lost = floor & ~hole & (np.random.default_rng(2).random(len(floor)) < 0.2)
    ranges_mm[hole | lost] = NO_RETURN
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    assert plane.as_expected
    found = lost_echoes_of_one(SENSOR, moments_of(ranges_mm), directions, ranges_mm, RANGE_M)
    near = lost & (np.hypot(*(down - SENSOR[0])[:, :2].T) < 10.0)
    assert near.sum() > 500
    assert found[near].mean() > 0.99
    inner = hole & (np.abs(down[:, 0] + 2.5) < 0.5) & (np.abs(down[:, 1]) < 0.5)
    assert inner.sum() > 20
    assert not found[inner].any()
    assert not found[directions[:, 2] >= 0.0].any()
    assert not found[ranges_mm != NO_RETURN].any()


def test_an_echo_lost_behind_an_obstacle_is_no_hole():
    directions = beams(80, 360)
    ranges_mm = cast(directions)
    wall = (ranges_mm != NO_RETURN) & (SENSOR[0, 0] + ranges_mm * 1e-3 * directions[:, 0] > 3.99)
    lost = wall & (np.random.default_rng(3).random(len(wall)) < 0.3) & (directions[:, 2] < -0.1)
    ranges_mm[lost] = NO_RETURN
    found = lost_echoes_of_one(SENSOR, moments_of(ranges_mm), directions, ranges_mm, RANGE_M)
    assert lost.sum() > 50
    assert found[lost].mean() > 0.98


@pytest.mark.parametrize(
    "kind", ["none", "dropped", "walls", "ramp", "high", "few", "line", "under the floor"]
)
def test_no_floor_is_made_up(kind):
    directions = beams()
    ranges_mm = {
        "none": lambda: np.full(len(directions), NO_RETURN, np.uint16),
        "dropped": lambda: np.full(len(directions), DROPPED, np.uint16),
        "walls": lambda: np.where(directions[:, 2] < -0.05, DROPPED, cast(directions)),
        "ramp": lambda: cast(directions, (0.15, 0.0), wall_x=50.0),
        "high": lambda: cast(directions, height=0.3, wall_x=50.0),
        "few": lambda: np.where(np.arange(len(directions)) % 97, DROPPED, cast(directions)),
        "line": lambda: np.where(np.abs(directions[:, 1]) > 1e-6, DROPPED, cast(directions)),
        "under the floor": lambda: np.full(len(directions), 1, np.uint16),
    }[kind]().astype(np.uint16)
    assert fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm) is None


def test_an_empty_sweep_has_no_floor():
    nothing = np.empty((0, 3)), np.empty(0, np.uint16)
    assert fit_ground(SENSOR, np.empty(0, np.int32), *nothing) is None


def test_kernels_compiled_and_interpreted_agree_bit_by_bit():
    directions = beams(20, 40)
    ranges_mm = cast(directions, (0.01, -0.01), 0.03, noise=0.03)
    ranges_mm[::7] = NO_RETURN
    origins = np.array([[0.4, -0.3, 0.5], [0.45, -0.3, 0.51]])
    moments = (np.arange(len(ranges_mm)) >= 400).astype(np.int32)
    runs = []
    for run in (lambda kernel: kernel, lambda kernel: kernel.py_func):
        near, plane, figures = np.zeros((len(ranges_mm), 3)), np.zeros(5), np.zeros(3)
        count = run(kernels.returns_near_floor)(origins, moments, directions, ranges_mm, 1, near)
        at_zero = run(kernels.count_at_zero)(near[:count], 0.05)
        used = run(kernels.fit_plane)(
            near[:count], (0.45, -0.3, 0.51), kernels.BANDS, 0.06, plane, figures
        )
        levelled, ends = np.zeros_like(origins), np.zeros_like(directions)
        run(kernels.tilt_back)(origins, moments, directions, ranges_mm, plane, levelled, ends)
        on_floor, lost = np.zeros((2, len(ranges_mm)), np.bool_)
        deviations, tiling = (float(figures[2]), 0.01, 0.1), (0.25, 97)
        centre, silent_sweeps = (0.25, -0.5), np.zeros((97, 97), np.uint8)
        run(kernels.put_on_floor)(levelled, moments, ranges_mm, deviations, tiling, ends, on_floor)
        new, new_mm = np.zeros_like(directions), np.zeros_like(ranges_mm)
        run(kernels.beams_of)(ends, ranges_mm, new, new_mm)
        beams_down = levelled, moments, new, RANGE_M, centre, tiling[0], 0.25, 2, new_mm
        run(kernels.find_lost)(*beams_down, silent_sweeps, lost)
        found = count, used, at_zero, near, plane, figures, levelled, new, new_mm, on_floor
        runs.append((*found, silent_sweeps, lost))
    assert runs[0][1] > 100
    assert runs[0][-1].any()
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_fit_is_that_of_least_squares_in_rounds():
    directions = beams()
    ranges_mm = cast(directions, (0.01, -0.01), 0.03, noise=0.01)
    plane = fit_ground(SENSOR, moments_of(ranges_mm), directions, ranges_mm)
    points = ranges_mm[ranges_mm != NO_RETURN, None] * 1e-3 * directions[ranges_mm != NO_RETURN]
    x, y, z = points.T
    z = z + SENSOR[0, 2]
    near = (np.hypot(x, y) <= kernels.FARTHEST) & (np.abs(z) <= 0.3 + kernels.TILT * np.hypot(x, y))
    x, y, z = x[near], y[near], z[near]
    kept, off, deviation, fitted = np.ones(len(x), bool), z, 0.0, np.zeros(3)
    for k, band in enumerate(kernels.BANDS):
        if k:
            off = z - np.column_stack([np.ones_like(x), x, y]) @ fitted
            kept = np.abs(off) <= max(band, 3.0 * deviation)
        design = np.column_stack([np.ones_like(x), x, y])[kept]
        asymmetric = 0 < k <= kernels.ASYMMETRIC
        root = np.where((off > 0.0) & asymmetric, math.sqrt(kernels.ABOVE), 1.0)[kept]
        fitted = np.linalg.lstsq(design * root[:, None], z[kept] * root, rcond=None)[0]
        off = z - np.column_stack([np.ones_like(x), x, y]) @ fitted
        below = (off <= 0.0) & (off >= -max(band, 3.0 * deviation))
        deviation = math.sqrt(float(np.square(off[below]).mean()))
    np.testing.assert_allclose(plane.numbers[:3], fitted, atol=1e-9)
    assert plane.deviation == pytest.approx(deviation, rel=1e-9)
    assert plane.points == kept.sum()
