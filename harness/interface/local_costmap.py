"""A costmap for a stack, by the referee's own map, margin and inflation.

def start(self, task):
self.costmap = LocalCostmap(task)

def step(self, observation):
self.costmap.update(observation)
grid = self.costmap.around(observation, half_m=4.0)
"""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_document
from wayproof.harness.inputs import Inputs, Pose, SweepInput
from wayproof.harness.interface.types import Observation, Sweep, Task
from wayproof.harness.stack.mapping import Mapper
from wayproof.maps.costmap.nav2_costs import NO_INFORMATION, costs_of
from wayproof.models.poses import Trail


class CostGrid(NamedTuple):
    """Costs around a body, in the plane of a body that walks, else at its height.

    Attributes:
        costs: (nx, ny) uint8 by Nav2's scale: 254 occupied, 253 where the body's centre must not
            be, 252 to 0 beyond; 255 unknown, and outside of the operating area.
        low: (2,) lower corner of cell (0, 0), m, world.
        resolution: Edge of a cell, m.
    """

    costs: NDArray[np.uint8]
    low: NDArray[np.float64]
    resolution: float


class LocalCostmap:
    """Map and costmap of one task, made of a stack's observations as the referee makes its own."""

    def __init__(self, task: Task) -> None:
        """Start with an unknown map but for the start area, by the settings of the task."""
        beams = {name: sensor.beams for name, sensor in task.sensors.items()}
        self._mapper = Mapper(config_of(task), task.mission, beams)

    def update(self, observation: Observation) -> None:
        """Integrate the sweeps of an observation; once for each, in order."""
        self._mapper.update(inputs_of(observation))

    def around(self, observation: Observation, half_m: float = 4.0) -> CostGrid:
        """Return the costs of the cells up to `half_m` from the estimated position along x and y.

        Args:
            observation: The newest observation.
            half_m: Half the edge of the grid, m.
        """
        costmap = self._mapper.costmap
        point = self._mapper.planning_point(observation.position)
        cell = np.floor((point - costmap.origin) / costmap.resolution).astype(np.int64)
        layer = min(max(int(cell[2]), 0), costmap.shape[2] - 1)
        whole = costs_of(costmap, layer, costmap.collision_distance_sq)
        reach = int(np.ceil(half_m / costmap.resolution))
        first = cell[:2] - reach
        costs = np.full((2 * reach + 1, 2 * reach + 1), NO_INFORMATION, np.uint8)
        low, end = np.maximum(first, 0), np.minimum(first + 2 * reach + 1, whole.shape)
        if (low < end).all():
            inside = tuple(slice(a, b) for a, b in zip(low - first, end - first, strict=True))
            costs[inside] = whole[low[0] : end[0], low[1] : end[1]]
        return CostGrid(costs, costmap.origin[:2] + costmap.resolution * first, costmap.resolution)


def config_of(task: Task) -> Config:
    """Return the settings of a task as a config, of no world."""
    named = {"world": "", "robot": task.robot, "seed": task.seed}
    return from_document({**named, **json.loads(task.settings)})


def inputs_of(observation: Observation) -> Inputs:
    """Return an observation as inputs of a map, in own arrays, as kernels take no others."""
    trail = observation.trail
    if trail is not None:
        trail = Trail(trail.positions.copy(), trail.quaternions.copy(), trail.period)
    pose = Pose(
        position=observation.position.copy(),
        quaternion=observation.quaternion.copy(),
        position_sigma=observation.position_sigma,
        trail=trail,
        heading_sigma=observation.heading_sigma,
        covariance=None if observation.covariance is None else observation.covariance.copy(),
        unheld=observation.unheld.copy(),
        age_ns=observation.pose_age_ns,
    )
    sweeps = tuple(_sweep_input(sweep) for sweep in observation.sweeps)
    return Inputs(observation.time_ns, observation.sequence, pose, sweeps, digest="")


def _sweep_input(sweep: Sweep) -> SweepInput:
    classes = None if sweep.classes is None else sweep.classes.copy()
    return SweepInput(
        sweep.sensor, sweep.ranges_mm.copy(), classes, age_ns=sweep.age_ns, lag=sweep.lag
    )
