"""Bodies swept along committed paths."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.config import Config
from wayproof.harness.judge.body import BESIDE, ROUNDING, Body
from wayproof.harness.log.reader import open_log
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import VoxelMap

MISSION = Mission(
    "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
    (-3.0, -3.0, -0.2), (3.0, 3.0, 2.0), (0.0, 0.0, 0.3), 0.0, (0.5, 0.5, 0.3),
    discs=((-0.1, 0.2), (0.1, 0.2)),
)  # fmt: skip
CONFIG = Config("empty", "quadruped", 1)
LOGS = Path(__file__).parents[1] / "logs"


def test_the_discs_of_a_long_body_have_slack_and_a_round_one_that_of_rounding():
    """Free is x < 1; 0.295 m and half a diagonal of 10-cm cells are 3 cells from one's own."""
    voxel_map = VoxelMap(CONFIG.map, MISSION.low, MISSION.high)
    voxel_map.mark_floor((-1.0, -1.0), (1.0, 1.0), 0)
    voxel_map.mark_free((-1.0, -1.0, 0.0), (1.0, 1.0, 0.6), 0)
    body = Body(CONFIG, MISSION, "forbid")

    def met(x, slack):
        return body.first_overlap(voxel_map, np.array([[x, 0.05, 0.3]]), 0.295, slack)

    assert met(0.695, 0.0) is None
    assert met(0.705, 0.0)[1] == "unknown"
    assert met(0.705, BESIDE) is None
    assert met(0.715, BESIDE)[1] == "unknown"
    # On the face itself it lies in either cell, by rounding.
    assert met(0.7 + 0.5 * ROUNDING, 0.0)[1] == "unknown"
    assert met(0.7 + 0.5 * ROUNDING, ROUNDING) is None
    assert met(0.7 + 2.0 * ROUNDING, ROUNDING)[1] == "unknown"


@pytest.mark.parametrize(("from_ms", "first"), [(50, 0.0), (100, 0.0), (199, 0.0), (200, 0.1)])
def test_poses_begin_with_the_last_sample_before_a_time(from_ms, first):
    followed = trajectory()
    poses = Body(CONFIG, MISSION, "forbid").poses(followed, from_ms * 1_000_000)
    assert poses[0, 0] == pytest.approx(first)
    assert poses[-1, 0] == pytest.approx(0.4)


@pytest.mark.parametrize(("shifted", "first"), [(0.0, 0.1), (0.01, 0.0)])
def test_only_a_trajectory_that_goes_on_is_checked_from_where_the_decision_takes_effect(
    shifted, first
):
    decision, before = pb.Decision(trajectory=trajectory()), trajectory()
    decision.timestamp.FromMilliseconds(150)  # decisions take effect after 50 ms
    before.path[1].x += shifted
    real = next(committed_of(open_log(LOGS / "small.mcap")))
    body = Body(CONFIG, MISSION, "forbid")
    record = replace(real.record, decision=decision)
    moment = replace(
        real, record=record, config=CONFIG, mission=MISSION, body=body, before=(before,)
    )
    assert moment.keeps_trajectory == (shifted == 0.0)
    assert moment.poses[0, 0] == pytest.approx(first)


def trajectory():
    """A trajectory from 0.1 s on, 0.4 m along x."""
    arcs = [0.0, 0.1, 0.2, 0.3, 0.4]
    made = pb.Trajectory(sample_period_s=0.1, arc_length=arcs, heading=[0.5 * a for a in arcs])
    made.start.FromMilliseconds(100)
    made.path.add()
    made.path.add(x=0.4)
    return made
