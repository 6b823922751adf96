"""What a stack makes of its observations: returns in the body's way, a scan, a costmap."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wayproof import Command, Velocity, build, run_episode
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.local_costmap import LocalCostmap
from wayproof.harness.interface.returns import body_returns, scan
from wayproof.maps.costmap.nav2_costs import NO_INFORMATION, costs_of

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


def test_a_stack_s_costmap_is_that_of_the_referee_around_it(tmp_path):
    grids, checked = [], []

    class Session:
        def start(self, task):
            self.costmap = LocalCostmap(task)

        def announce(self):
            pass

        def query(self, observation):
            self.costmap.update(observation)
            grids.append(self.costmap.around(observation, half_m=3.0))
            return command_message(Command(Velocity(0.4, yaw_rate=0.3)), observation.sequence)

        def close(self):
            pass

        def stderr(self):
            return ""

    def observe(moment):
        costmap = moment.navigator.costmap
        whole = costs_of(costmap, 0, costmap.collision_distance_sq)
        grid = grids[-1]
        assert grid.costs.shape[0] * grid.resolution > 6.0
        first = np.rint((grid.low - costmap.origin[:2]) / grid.resolution).astype(int)
        for i, j in np.argwhere(grid.costs != NO_INFORMATION)[::37]:
            assert grid.costs[i, j] == whole[first[0] + i, first[1] + j]
            checked.append(grid.costs[i, j])

    config = override(
        Config("cylinders", "quadruped", 2), ["episode.time_limit=1.5", "stack.name=own"]
    )
    run_episode(build(config), tmp_path / "a.mcap", observe, session=Session())
    assert {0, 253, 254} <= set(checked)
