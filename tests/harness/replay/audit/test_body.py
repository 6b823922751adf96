"""Bodies swept along committed paths."""

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.body import BESIDE, ROUNDING, Body
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import VoxelMap

MISSION = Mission(
    "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
    (-3.0, -3.0, -0.2), (3.0, 3.0, 2.0), (0.0, 0.0, 0.3), 0.0, (0.5, 0.5, 0.3),
    discs=((-0.1, 0.2), (0.1, 0.2)),
)  # fmt: skip


def test_the_discs_of_a_long_body_have_slack_and_a_round_one_that_of_rounding():
    """Free is x < 1; 0.295 m and half a diagonal of 10-cm cells are 3 cells from one's own."""
    config = Config("empty", "quadruped", 1)
    voxel_map = VoxelMap(config.map, 1, MISSION.low, MISSION.high)
    voxel_map.mark_floor((-1.0, -1.0), (1.0, 1.0), 0)
    voxel_map.mark_free((-1.0, -1.0, 0.0), (1.0, 1.0, 0.6), 0)
    body = Body(config, MISSION, "forbid")

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


@pytest.mark.parametrize(("decided_ms", "first"), [(50, 0.0), (150, 0.1), (190, 0.1), (450, 0.4)])
def test_a_trajectory_that_goes_on_is_checked_from_where_the_decision_takes_effect(
    decided_ms, first
):
    config = Config("empty", "quadruped", 1)  # decisions take effect after 50 ms
    arcs = [0.0, 0.1, 0.2, 0.3, 0.4]
    decision = pb.Decision()
    decision.timestamp.FromMilliseconds(decided_ms)
    followed = pb.Trajectory(sample_period_s=0.1, arc_length=arcs, heading=[0.5 * a for a in arcs])
    followed.start.FromMilliseconds(100)
    followed.path.add()
    followed.path.add(x=0.4)
    decision.trajectory.CopyFrom(followed)
    poses = Body(config, MISSION, "forbid").poses(decision)
    assert poses[0, 0] == pytest.approx(first)
    assert poses[-1, 0] == pytest.approx(0.4)
