"""Returns in the body's way: without the floor, in the body's frame, thinned, as a scan."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wayproof.harness.inputs import WorldSweep
from wayproof.harness.interface.returns import body_returns, scan

GROUND = SimpleNamespace(
    planar=True, start=(0.0, 0.0, 0.3), step_height=0.03, height=0.4, radius=0.5
)
AIR = SimpleNamespace(planar=False, start=(0.0, 0.0, 1.0), step_height=0.0, height=0.2, radius=0.3)


def seen(points, heading=0.0, position=(1.0, 2.0, 0.3)):
    half, points = 0.5 * heading, np.array(points, float).reshape(-1, 3)
    placed = WorldSweep(
        origins=points,
        directions=np.zeros_like(points),
        ranges_mm=np.ones(len(points), np.uint16),
        moments=np.arange(len(points), dtype=np.int32),
    )
    return SimpleNamespace(
        sweeps=(SimpleNamespace(points=placed.points, placed=placed),),
        position=np.array(position),
        quaternion=np.array([math.cos(half), 0.0, 0.0, math.sin(half)]),
    )


def test_floor_and_what_the_body_passes_below_are_left_out():
    heights = [0.0, 0.03, 0.035, 0.05, 0.39, 0.42]
    kept = body_returns(seen([(3.0, 2.0, z) for z in heights]), GROUND)
    assert kept[:, 2].tolist() == [0.05, 0.39]
    above = body_returns(
        seen([(3.0, 2.0, z) for z in (0.5, 0.8, 1.2, 1.5)], position=(0, 0, 1)), AIR
    )
    assert above[:, 2].tolist() == [0.8, 1.2]


def test_the_body_s_frame_is_level_and_turned_by_the_heading():
    [found] = body_returns(seen([(1.0, 4.0, 0.2)], heading=math.pi / 2), GROUND, frame="body")
    assert found == pytest.approx([2.0, 0.0, -0.1], abs=1e-6)


def test_thinning_keeps_one_return_of_each_cube():
    points = [(2.01, 2.0, 0.2), (2.02, 2.01, 0.21), (2.3, 2.0, 0.2)]
    assert body_returns(seen(points), GROUND, thinned_m=0.1).tolist() == [
        list(points[0]),
        list(points[2]),
    ]


def test_a_scan_has_the_nearest_return_of_each_direction():
    ahead, left, behind = (3.0, 2.01, 0.2), (1.0, 3.0, 0.2), (-3.0, 1.99, 0.2)
    found = scan(seen([ahead, (4.0, 2.01, 0.2), left, behind]), GROUND, bearings=4, reach_m=3.0)
    assert found == pytest.approx([math.hypot(2.0, 0.01), 1.0, 3.0, 3.0])
    assert scan(seen([]), GROUND).tolist() == [10.0] * 72


def test_a_scan_is_that_of_angles():
    generator = np.random.default_rng(1)
    offsets = generator.uniform(-5.0, 5.0, (500, 2))
    points = np.column_stack([offsets + np.array([1.0, 2.0]), np.full(500, 0.2)])
    for heading in (0.0, 0.7, -2.5):
        found = scan(seen(points, heading), GROUND, bearings=36, reach_m=4.0)
        angles = (np.arctan2(offsets[:, 1], offsets[:, 0]) - heading) % (2.0 * math.pi)
        distances = np.hypot(*offsets.T)
        for k in range(36):
            own = distances[np.floor(angles * 36 / (2.0 * math.pi)).astype(int) == k]
            assert found[k] == pytest.approx(min(own.min(initial=4.0), 4.0))
