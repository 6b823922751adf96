"""The audit's own columns over slopes, against those of the stack's costmap."""

import numpy as np
import pytest

from tests.maps.costmap.test_terrain import HIGH, LOW, SIZE, rough
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.judge.slopes import sloping_columns
from wayproof.harness.mission import Mission
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap


def mission(step_height, height):
    sizes = {"radius": 0.2, "height": height, "step_height": step_height}
    limits = {"max_speed": 1.0, "max_acceleration": 1.0, "max_jerk": 1.0, "max_yaw_rate": 1.0}
    ends = {"start": (0.5, 0.5, 0.3), "start_heading": 0.0, "goal": (3.0, 2.0, 0.3)}
    return Mission(motion="ground", low=LOW, high=HIGH, **sizes, **limits, **ends)


@pytest.mark.parametrize("seed", range(6))
def test_they_are_those_of_the_costmap(seed):
    cells, (step, slope, height) = rough(seed), [(0.03, 0.3, 0.45), (0.15, 0.2, 0.4)][seed % 2]
    config = override(Config("warehouse", "quadruped", 1), [f"costmap.max_slope={slope}"])
    costmap = Costmap(config.costmap, cells, LOW, HIGH, "ground", 0.2, height, step)
    feet = [None, (1.25, 1.15, 0.3), (3.35, 1.15, 0.9), (0.05, 0.05, 0.0), (-9.0, 9.0, 0.0)]
    counts = np.zeros(3, int)
    for place in feet:
        if place is not None:
            costmap.stand_at(place)
            costmap.update(0.1)
        found = sloping_columns(cells, config, mission(step, height), place)
        np.testing.assert_array_equal(found.states, costmap.state[:, :, 0])
        counts += np.bincount(found.states.ravel(), minlength=3)
    assert (counts[[FREE, OCCUPIED, UNKNOWN]] > 50).all()
    part = found.within(np.array([-3, 5]), np.array([7, 30]))
    assert (part[:3] == UNKNOWN).all()
    assert (part[:, SIZE[1] - 5 :] == UNKNOWN).all()
    np.testing.assert_array_equal(part[3:, : SIZE[1] - 5], found.states[:7, 5:])
