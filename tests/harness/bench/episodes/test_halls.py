"""Halls by one rule, and what the bench makes of an episode in one."""

import numpy as np

from wayproof.harness.bench.episodes.halls import (
    FLOOR_PER_SOLID,
    GAP,
    SIDES,
    make_hall,
    peak_memory_mib,
    run_one,
)


def test_halls_are_alike_by_area_and_open_everywhere():
    for side in (20.0, 60.0):
        hall, again = make_hall(side, 0), make_hall(side, 0)
        assert hall == again
        assert hall != make_hall(side, 1)
        boxes = hall.solids[4:]
        assert len(boxes) == round(side * side / FLOOR_PER_SOLID)
        low, high = (np.array([getattr(one, end)[:2] for one in boxes]) for end in ("low", "high"))
        apart = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=2)
        np.fill_diagonal(apart, np.inf)
        assert apart.min() > GAP - 0.01
        assert low.min() > GAP
        assert high.max() < side - GAP
    assert list(SIDES) == ["20", "60", "120", "300"]


def test_a_row_tells_of_an_episode():
    before = peak_memory_mib()
    row = run_one(20.0, "drone", 0)
    assert row.outcome == "success"
    assert row.solids == 4 + round(20.0 * 20.0 / FLOOR_PER_SOLID)
    assert 0.9 < row.path_ratio < 1.3
    assert 0.0 < row.cpu_ms_p50 <= row.cpu_ms_p99 <= row.cpu_ms_max
    assert 0.0 < row.loop_share < 1.0
    assert row.memory_mib >= before > 50.0
