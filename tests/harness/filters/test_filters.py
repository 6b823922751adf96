"""The registry of filters, and evidence of the floor that one keeps from sweep to sweep."""

import numpy as np
import pytest

from tests.maps.test_missing_floor import DIRECTIONS, floor_sweep
from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, to_json
from wayproof.harness.errors import InputError
from wayproof.harness.filters import AS_THEY_COME, NAMES, Filters, Origin, names_of
from wayproof.harness.inputs import Pose, WorldSweep
from wayproof.harness.scenario.scenario import build
from wayproof.maps import VoxelMap
from wayproof.models.sensors.beams import NO_RETURN

RANGE_M = 15.0


class Lidar:
    """Beams that are no image."""

    is_image, range = False, RANGE_M


def filters_of(*settings, robot="quadruped", names=NAMES):
    scenario = build(override(Config("empty", robot, 0), settings))
    config = scenario.config
    return Filters(names, config, scenario.mission, VoxelMap(config.map))


def taken_in(filters, ranges_mm):
    """The sweep of a sensor above a floor, after the filters took it in."""
    moments = np.zeros(len(ranges_mm), np.int32)
    placed = WorldSweep(floor_sweep(0.0)[0], DIRECTIONS, ranges_mm, moments)
    pose = Pose(np.array([0.0, -0.3, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]), position_sigma=0.0)
    return filters(placed, Origin("lidar", Lidar(), pose, 0.0))


def test_a_sweep_in_which_every_beam_returned_ends_the_silence():
    filters = filters_of(names=["missing_floor"])
    floor = filters._filters["missing_floor"]
    silent = floor_sweep(0.0)[2]
    for _ in range(3):
        kept = taken_in(filters, silent)
    assert floor.missing.silent_sweeps.max() == 3
    dropped = np.count_nonzero(silent == NO_RETURN) - np.count_nonzero(kept.ranges_mm == NO_RETURN)
    assert filters.changed["missing_floor"] >= dropped > 0
    seen = np.minimum(floor_sweep(0.0, hole=False)[2], 14_000).astype(np.uint16)
    taken_in(filters, seen)
    assert not floor.missing.silent_sweeps.any()


def test_evidence_is_kept_where_the_unknown_is_forbidden():
    for policy, kept in (("forbid", True), ("penalize", False), ("allow", False)):
        filters = filters_of(f"costmap.unknown_policy={policy}")
        assert ("missing_floor" in filters.contents()) == kept
    assert "missing_floor" not in filters_of(robot="drone").contents()


def test_filters_pass_on_what_they_remember():
    filters, other = filters_of(), filters_of()
    for _ in range(3):
        taken_in(filters, floor_sweep(0.0)[2])
    assert other.contents() != filters.contents()
    other.restore(filters.contents())
    assert other.contents() == filters.contents()
    with pytest.raises(ValueError, match="filters"):
        filters_of(names=["grazing"]).restore(filters.contents())


def test_a_stack_on_trial_has_its_returns_as_they_come_unless_it_asks():
    assert names_of(Config("empty", "drone", 0)) == NAMES
    on_trial = override(Config("empty", "drone", 0), ["stack.name=dwa"])
    assert names_of(on_trial) == AS_THEY_COME
    asked = override(on_trial, ["map.filters=lost_echoes,grazing"])
    assert names_of(asked) == ("lost_echoes", "grazing")
    assert names_of(from_json(to_json(asked))) == names_of(asked)
    assert names_of(override(on_trial, ["map.filters=[]"])) == ()


def test_another_name_is_refused_with_those_that_there_are():
    for value in ("snow", '["grazing", "snow"]', "grazing,snow"):
        with pytest.raises(InputError, match=r"'snow'.*lost_echoes"):
            override(Config("empty", "drone", 0), [f"map.filters={value}"])
    with pytest.raises(InputError, match=r"'snow'.*lost_echoes"):
        filters_of(names=["snow"])
