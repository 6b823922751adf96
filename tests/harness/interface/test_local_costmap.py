"""The costmap that a stack makes of its observations is the referee's own."""

from __future__ import annotations

import numpy as np

from wayproof import Command, Velocity, build, run_episode
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.local_costmap import LocalCostmap
from wayproof.maps.costmap.nav2_costs import NO_INFORMATION, costs_of


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
