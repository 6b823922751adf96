"""Picture of a recorded way over the map: where it was admitted, and where it was not and why."""

from __future__ import annotations

import io

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wayproof.harness.judge.cells import Cells, cells_around
from wayproof.harness.shadow.assess import Assessed
from wayproof.harness.shadow.summary import Summary

ADMITTED = "#2a9d4a"
COLOURS = {
    "margin": "#ff4fc3",
    "occupied": "#d1232a",
    "unknown": "#0072b2",
    "stale": "#8e44ad",
    "outside": "#000000",
}
"""Colours of the way by the reason why it was not admitted."""

COLOURS_OF_WAY = {"admitted": ADMITTED, **COLOURS}
"""Colours of the way by its verdict, none of them that of a cell of the map."""

MAP_COLOURS = ("#d5d9df", "#ffffff", "#3b4252", "#d5d9df")
"""Colours of cells that are unknown, free, occupied, or outside the operating area."""

ROOM = 3.0
"""Distance around the way that is shown, m."""

NUMBERED = 10
"""Number of the worst places that are numbered."""


def draw_way(assessed: Assessed, summary: Summary) -> bytes:
    """Return a PNG of the way over the map without decay at the end, the worst places numbered."""
    with mpl.rc_context({"font.size": 8.0, "text.parse_math": False}):
        figure = Figure(figsize=(9.0, 7.0), layout="constrained", dpi=110)
        axes = figure.add_subplot()
        way = np.concatenate([leg.poses for leg in assessed.legs] or [_places(assessed)])
        _draw_map(axes, assessed, way)
        for leg in assessed.legs:
            colour = ADMITTED if leg.admitted else COLOURS[leg.why]
            axes.plot(leg.poses[:, 0], leg.poses[:, 1], color=colour, lw=1.6)
        for number, place in enumerate(summary.places[:NUMBERED], 1):
            at = place.position[0], place.position[1]
            axes.annotate(str(number), at, textcoords="offset points", xytext=(6, 6), weight="bold")
            axes.plot(*at, "o", color=COLOURS[place.why], ms=4)
        axes.plot(way[0, 0], way[0, 1], "s", color="#1f77d0", ms=6)
        axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
        names = {"admitted": ADMITTED, **{why: COLOURS[why] for why in summary.refused_m}}
        handles = [Line2D([], [], color=colour, lw=2, label=name) for name, colour in names.items()]
        handles.append(Line2D([], [], color="#1f77d0", marker="s", ls="none", label="start"))
        axes.legend(handles=handles, loc="upper right", fontsize=7)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", metadata={"Software": None})
        return buffer.getvalue()


def _places(assessed: Assessed) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.array([one.pose for one in assessed.passed])


def _draw_map(
    axes: Axes, assessed: Assessed, way: np.ndarray[tuple[int, int], np.dtype[np.float64]]
) -> None:
    cells = cells_around(
        assessed.memory,
        path=way,
        reach=ROOM,
        config=assessed.log.config,
        mission=assessed.log.mission,
    )
    states = _layer(cells, way)
    (nx, ny), (x, y) = states.shape, cells.corner[:2]
    axes.imshow(
        states.T,
        origin="lower",
        extent=(x, x + nx * cells.size, y, y + ny * cells.size),
        cmap=ListedColormap(list(MAP_COLOURS)),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )


def _layer(
    cells: Cells, way: np.ndarray[tuple[int, int], np.dtype[np.float64]]
) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    """Return states (nx, ny): of a body that flies those at its mean height."""
    if cells.axes == 2:
        return cells.states
    index = int((way[:, 2].mean() - cells.corner[2]) / cells.size)
    return cells.states[:, :, min(max(index, 0), cells.states.shape[2] - 1)]
