"""Picture of a scene from above with its free places, numbered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from wayproof.harness.outputs import written_whole
from wayproof.models.arrays import Vector3
from wayproof.models.world_files.places import FreeSpace

SIDE = 9.0
"""Longer side of the picture, inches."""

OCCUPIED, NARROW, FREE = (0.2, 0.2, 0.2), (0.85, 0.85, 0.85), (1.0, 1.0, 1.0)
"""Colours of cells: something stands there, too narrow for the robot, free for its centre."""

ENDS = {"start": "tab:green", "goal": "tab:red"}


def draw_places(path: Path, space: FreeSpace, ends: dict[str, Vector3]) -> None:
    """Write a PNG of the free space, its numbered places, and the ends that were chosen.

    Args:
        path: Path of the picture.
        space: The free space.
        ends: `start` and `goal`, m; empty where there are none.
    """
    colours = np.empty((*space.free.shape, 3))
    colours[:] = NARROW
    colours[space.gaps <= space.cell / 2.0] = OCCUPIED
    colours[space.free] = FREE
    width, height = np.array(space.free.shape) * space.cell
    low = space.low
    scale = SIDE / max(width, height)
    figure = Figure(figsize=(max(width * scale, 3.0), max(height * scale, 3.0)), dpi=110)
    axes = figure.add_subplot()
    axes.imshow(
        colours.transpose(1, 0, 2), origin="lower", interpolation="nearest",
        extent=(low[0], low[0] + width, low[1], low[1] + height),
    )  # fmt: skip
    for number, place in enumerate(space.places, 1):
        axes.plot(*place.point[:2], "o", color="tab:blue", markersize=3)
        axes.annotate(str(number), place.point[:2], color="tab:blue", fontsize=8)
    for name, point in ends.items():
        axes.plot(*point[:2], "*", color=ENDS[name], markersize=12, label=name)
    if ends:
        axes.legend(loc="upper right", fontsize=8)
    axes.set(xlabel="x, m", ylabel="y, m")
    figure.tight_layout()
    with written_whole(path, "--places") as partial:
        figure.savefig(partial, format="png")
