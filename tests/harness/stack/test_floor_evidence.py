"""Evidence of the floor that is kept from sweep to sweep."""

import numpy as np

from tests.maps.test_missing_floor import DIRECTIONS, floor_sweep
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.inputs import Pose, WorldSweep
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.ground import floor_evidence, missing_floor_of

RANGE_M = 15.0


def taken_in(scenario, missing, ranges_mm):
    """The sweep of a sensor above a floor, after the evidence took it in."""
    moments = np.zeros(len(ranges_mm), np.int32)
    placed = WorldSweep(floor_sweep(0.0)[0], DIRECTIONS, ranges_mm, moments)
    pose = Pose(np.array([0.0, -0.3, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]), position_sigma=0.0)
    return floor_evidence(placed, RANGE_M, pose, scenario.config, scenario.mission, missing)


def test_a_sweep_in_which_every_beam_returned_ends_the_silence():
    scenario = build(Config("empty", "quadruped", 0))
    missing = missing_floor_of(scenario.config, scenario.mission)
    silent = floor_sweep(0.0)[2]
    for _ in range(3):
        taken_in(scenario, missing, silent)
    assert missing.silent_sweeps.max() == 3
    seen = np.minimum(floor_sweep(0.0, hole=False)[2], 14_000).astype(np.uint16)
    taken_in(scenario, missing, seen)
    assert not missing.silent_sweeps.any()


def test_evidence_is_kept_where_the_unknown_is_forbidden():
    for policy, kept in (("forbid", True), ("penalize", False), ("allow", False)):
        config = override(Config("empty", "quadruped", 0), [f"costmap.unknown_policy={policy}"])
        scenario = build(config)
        assert (missing_floor_of(scenario.config, scenario.mission) is not None) == kept
    plain = build(override(Config("empty", "quadruped", 0), ["map.ground_fit=false"]))
    assert missing_floor_of(plain.config, plain.mission) is None
    drone = build(Config("empty", "drone", 0))
    assert missing_floor_of(drone.config, drone.mission) is None
