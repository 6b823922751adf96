"""Halls by one rule, and what the bench makes of an episode in one."""

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from wayproof.harness.bench.episodes.halls import (
    FLOOR_PER_SOLID,
    GAP,
    SIDES,
    HallRow,
    make_hall,
    peak_memory_mib,
    run_one,
    summarise,
)
from wayproof.harness.bench.table import print_rows


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


ROW = HallRow(
    side_m=300.0,
    solids=1389,
    robot="quadruped",
    outcome="success",
    time_s=249.3,
    path_ratio=1.03,
    cpu_ms_p50=17.3,
    cpu_ms_p99=35.0,
    cpu_ms_max=110.0,
    map_ms=18.84,
    costmap_ms=14.96,
    plan_ms=18.12,
    loop_share=0.175,
    build_s=0.5,
    memory_mib=710.5,
)


def test_the_summary_is_of_each_side_and_robot():
    rows = [
        replace(ROW, path_ratio=1.02),
        replace(ROW, path_ratio=1.08, loop_share=0.2, memory_mib=720.0),
        replace(ROW, path_ratio=0.4, outcome="timeout"),
        replace(ROW, robot="drone", outcome="collision", path_ratio=0.9),
        replace(ROW, side_m=20.0, path_ratio=None),
    ]
    first, drone, small = summarise(rows)
    assert (first.side_m, first.robot, first.halls) == (300.0, "quadruped", 3)
    assert first.reached == pytest.approx(2 / 3)
    assert (first.path_ratio, first.path_ratio_max) == (1.05, 1.08)
    assert (first.loop_share, first.memory_mib) == (0.183, 720.0)
    assert (drone.robot, drone.reached, drone.path_ratio, drone.path_ratio_max) == (
        ("drone", 0.0, None, None)
    )
    assert (small.side_m, small.reached, small.path_ratio) == (20.0, 1.0, None)


def test_rows_fit_a_table_of_80_columns():
    console = Console(width=80)
    with console.capture() as printed:
        print_rows(console, "halls", [ROW, *summarise([ROW, replace(ROW, path_ratio=1.09)])])
    text = printed.get()
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    assert all(value in text for value in ("0.175", "quadruped", "success", "710", "18.8", "1389"))
    assert all(value in text for value in ("1.06", "1.09"))
