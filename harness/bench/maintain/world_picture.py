"""Picture of an episode from above, cut at a walker's height, to look at a verdict by eye."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case
from wayproof.harness.scenario.scenario import Scenario
from wayproof.models.sensors.caster import ROBOT_GROUP

CUT = 1.2
"""Height above the floor from which beams look down, m: higher parts are not seen."""

PIXELS = 240
"""Number of beams along the longer side."""

DOWN = np.array([0.0, 0.0, -1.0])

LOWEST = 0.03
"""Height above the floor from which a thing is drawn as an obstacle, m."""


def draw_from_above(path: Path, scenario: Scenario, case: Case, title: str) -> None:
    """Write a PNG of what MuJoCo's own rays meet from above, and of the way truly gone.

    Args:
        path: Path of the picture.
        scenario: World and robot.
        case: The episode.
        title: Line above it.
    """
    low, high = (np.array(corner[:2]) for corner in (scenario.world.low, scenario.world.high))
    extent = high - low
    tops = _tops(scenario, low, extent)
    figure = Figure(figsize=(6.0, max(2.5, 6.0 * extent[1] / extent[0])), dpi=80)
    axes = figure.add_subplot()
    axes.imshow(
        tops.T, origin="lower", cmap="YlGnBu", vmin=0.0, vmax=CUT, interpolation="nearest",
        extent=(low[0], high[0], low[1], high[1]),
    )  # fmt: skip
    track = np.array([moment.truth.position for moment in case.moments])
    axes.plot(track[:, 0], track[:, 1], color="tab:orange", linewidth=1.5)
    axes.plot(*scenario.world.start[:2], "o", color="tab:green")
    axes.plot(*scenario.world.goal[:2], "*", color="tab:red", markersize=10)
    axes.set_title(title[:90], fontsize=7)
    figure.tight_layout()
    figure.savefig(path, format="png")


def _tops(
    scenario: Scenario, low: NDArray[np.float64], extent: NDArray[np.float64]
) -> NDArray[np.float64]:  # (nx, ny)
    """Return the height of the top surface at each place, m; 0 on the floor, NaN without one."""
    model, world = scenario.scene.model, scenario.world
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = np.ones(6, np.uint8)
    groups[ROBOT_GROUP] = 0
    shape = np.maximum(np.round(extent / extent.max() * PIXELS), 1).astype(int)
    tops, geom = np.full(shape, np.nan), np.zeros(1, np.int32)
    floors = set(scenario.scene.floor)
    for i, j in np.ndindex(*shape):
        x, y = low + (np.array([i, j]) + 0.5) * extent / shape
        ground = world.ground_height((x, y))
        origin = np.array([x, y, ground + CUT])
        if world.contains_obstacle(origin, 0.0) is not None:
            tops[i, j] = CUT
            continue
        distance = mujoco.mj_ray(model, data, origin, DOWN, groups, 1, -1, geom)
        if int(geom[0]) in floors:
            tops[i, j] = 0.0
        elif distance >= 0.0:
            tops[i, j] = max(CUT - distance, LOWEST)
    return tops
