import numpy as np
import pytest

from wayproof.harness.bench.episodes.ablations import (
    DELAYS,
    POLICIES,
    Arm,
    Trial,
    _row,
    _unknown_in,
)
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.result import Result
from wayproof.maps import MAPS, MapConfig


def trial(outcome, time_s, length, looks):
    result = Result(
        outcome=outcome,
        reason="",
        goal_distance_m=0.0,
        sim_time_s=time_s,
        wall_time_s=1.0,
        decisions=10,
        collisions=0,
        struck=0,
        min_clearance_m=0.3,
        path_length_m=length,
        route_length_m=None,
        deadline_misses=0,
        chain="",
        log="",
    )
    return Trial(result, looks, 0.5, 0.25, 3, [1.0, 3.0])


def test_a_row_by_hand():
    trials = [
        trial("success", 10.0, 12.0, 1),
        trial("success", 20.0, 18.0, 0),
        trial("collision", 1.0, 1.0, 2),
        trial("aborted", 1.0, 1.0, 1),
    ]
    row = _row(Arm("drone", "allow", ()), trials)
    assert (row.episodes, row.success, row.collisions) == (4, 0.5, 1)
    assert (row.time_s, row.length_m, row.speed_m_s) == (15.0, 15.0, 1.0)
    assert (row.looks, row.edge_share, row.unknown_share, row.unknown_cells) == (1, 0.5, 0.25, 3)
    assert row.plan_ms_p50 == 2.0


@pytest.mark.parametrize("arm", [*POLICIES, *DELAYS], ids=lambda arm: f"{arm.robot} {arm.name}")
def test_settings_of_the_arms_are_settings(arm):
    config = override(Config("warehouse", arm.robot, 0), arm.settings)
    assert config.latency.expected < config.latency.deadline


def test_unknown_cells_in_a_ball_by_hand():
    voxel_map = MAPS["voxel"](MapConfig(), 1, (0.0, 0.0, 0.0), (4.0, 4.0, 3.0))
    place = np.array([2.0, 2.0, 1.0])
    everywhere = len(_unknown_in(voxel_map, place, 0.3))
    assert everywhere == pytest.approx(4 / 3 * np.pi * 3.0**3, rel=0.15)  # cells of 0.1 m
    voxel_map.mark_free_sphere((2.0, 2.0, 1.0), 0.6, 0)
    assert len(_unknown_in(voxel_map, place, 0.3)) == 0
