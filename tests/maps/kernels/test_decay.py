from fractions import Fraction

import numpy as np
import pytest

from wayproof.maps import MapConfig
from wayproof.maps.kernels import decay as kernels
from wayproof.maps.kernels.bricks import BrickArrays
from wayproof.maps.voxel.log_odds import decay_per_tick


def naive_tick(values, tick, share):
    """One tick of every magnitude, in fractions."""
    threshold = Fraction(tick * 0x9E3779B97F % 2**40, 2**40)
    return [max(v - int(Fraction(round(v * share * 2**40), 2**40) + threshold), 0) for v in values]


@pytest.mark.parametrize(("half_life", "period"), [(30.0, 1.0), (1.0, 1.0), (2.0, 0.5), (7.0, 3.0)])
def test_values_fade_as_tick_by_tick(half_life, period):
    config = MapConfig(half_life=half_life, decay_period=period)
    share = 1.0 - 2.0 ** (-period / half_life)
    for start in (0, 5, 1000):
        expected = list(range(128))
        for tick in range(start, start + 60):
            expected = naive_tick(expected, tick, share)
        for sign in (1, -1):
            values = (sign * np.arange(128)).astype(np.int8)
            ticks = np.full(128, start)
            kernels.fade_values(values, ticks, start + 60, decay_per_tick(config))
            assert (sign * values).tolist() == expected


@pytest.mark.parametrize("value", [3, 12, 27, 60, 104])
def test_the_half_life_holds_for_every_value(value):
    """Averaged over when it starts: where a tick takes less than a unit, that decides when."""
    starts = np.arange(0, 3000, 7)
    losses = decay_per_tick(MapConfig(half_life=30.0, decay_period=1.0))
    left = np.concatenate([faded(value, start, start + 30, losses) for start in starts])
    # A loss of one unit comes early by half a unit on average: the first threshold is anywhere.
    assert left.mean() == pytest.approx(value / 2 - 0.25, rel=0.02, abs=0.25)


def faded(value, tick, until, losses):
    values = np.array([value], np.int8)
    kernels.fade_values(values, np.array([tick]), until, losses)
    return values


def faded_brick(ticks_seen, until):
    """A brick of every value, its first columns spared by the first tick, as kernels fade it."""
    cells = np.zeros((1, 6, 64), np.int8)
    cells[0, :4] = np.arange(-128, 128, dtype=np.int16).clip(-127).reshape(4, 64)
    cells[0, 4, :3] = 1, -2, 60
    fresh = np.zeros((1, 6), np.uint64)
    fresh[0, 0], fresh[0, 1] = 2**64 - 1, 0xFF00FF
    settled, before = np.full((1, 6), 7, np.uint64), cells.copy()
    ticks, dues = np.array([ticks_seen]), np.array([kernels.NEVER])
    none = np.zeros(1, np.int64)
    turned, alive = (np.zeros(1, np.bool_) for _ in range(2))
    eights = np.empty(8, np.uint64)
    losses = decay_per_tick(MapConfig(half_life=3.0))
    bricks = BrickArrays(
        cells=cells,
        eights=cells.view(np.uint64),
        fresh=fresh,
        settled=settled,
        observed_ns=none,
        ticks=ticks,
        dues=dues,
        stamps=none,
        dirty=np.zeros(1, np.bool_),
    )
    scratch = kernels.FadeScratch(
        steps=np.empty(kernels.MAGNITUDES, np.uint8),
        magnitudes=np.empty(64, np.uint8),
        losses=eights.view(np.uint8),
        loss_words=eights,
    )
    faded = kernels.FadedBricks(turned, alive)
    kernels.fade_bricks(np.array([0]), until, True, bricks, losses, faded, scratch)
    return before, cells, (settled, ticks, turned, alive)


@pytest.mark.parametrize("until", [8, 9, 30, 90])
def test_a_brick_fades_as_its_values_do(until):
    before, cells, (settled, ticks, turned, alive) = faded_brick(7, until)
    expected = before.reshape(-1).copy()
    losses = decay_per_tick(MapConfig(half_life=3.0))
    kernels.fade_values(expected, np.full(expected.size, 7), until, losses)
    expected = expected.reshape(before.shape)
    passed_away = bool(np.any((before != 0) & (expected == 0)))
    expected[0, 0] = before[0, 0]  # spared
    expected[0, 1, :8], expected[0, 1, 16:24] = before[0, 1, :8], before[0, 1, 16:24]
    np.testing.assert_array_equal(cells, expected)
    assert ticks.tolist() == [until]
    assert alive.tolist() == [True]
    assert turned.tolist() == [passed_away]
    assert settled[0].tolist() == [7, 7, 0, 0, 0, 0]
