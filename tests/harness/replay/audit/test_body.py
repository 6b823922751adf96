"""Bodies swept along committed paths."""

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.body import BESIDE, ROUNDING, Body
from wayproof.maps import VoxelMap


def test_the_discs_of_a_long_body_have_slack_and_a_round_one_that_of_rounding():
    """Free is x < 1; 0.295 m and half a diagonal of 10-cm cells are 3 cells from one's own."""
    mission = Mission(
        "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
        (-3.0, -3.0, -0.2), (3.0, 3.0, 2.0), (0.0, 0.0, 0.3), 0.0, (0.5, 0.5, 0.3),
        discs=((-0.1, 0.2), (0.1, 0.2)),
    )  # fmt: skip
    config = Config("empty", "quadruped", 1)
    voxel_map = VoxelMap(config.map, 1, mission.low, mission.high)
    voxel_map.mark_floor((-1.0, -1.0), (1.0, 1.0), 0)
    voxel_map.mark_free((-1.0, -1.0, 0.0), (1.0, 1.0, 0.6), 0)
    body = Body(config, mission, "forbid")

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
