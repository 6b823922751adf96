"""Plots of a report as SVG text; the same data gives the same bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.metrics import Trace
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.study.statistics.exact import Interval
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

STYLE: Any = {
    "svg.hashsalt": "wayproof",  # else ids are drawn at random
    "svg.fonttype": "none",
    "font.size": 9.0,
    "text.parse_math": False,  # what a study is called is no formula
    "axes.spines.top": False,
    "axes.spines.right": False,
}

TALLEST_FLOOR = 0.05
"""Height below which a geom counts as floor, m."""


def dose_response(severities: Sequence[float], rates: Sequence[Interval], ylabel: str) -> str:
    """Plot a rate with its interval over severity; severity 0 is the unperturbed twin."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.6, 2.4), layout="constrained")
        axes = figure.add_subplot()
        middle = np.array([rate.estimate for rate in rates])
        below = middle - [rate.low for rate in rates]
        above = np.array([rate.high for rate in rates]) - middle
        axes.errorbar(severities, middle, yerr=[below, above], fmt="o-", capsize=3, color="#2b6cb0")
        axes.set(xlabel="severity", ylabel=ylabel, ylim=(-0.03, 1.03), xticks=list(severities))
        return _svg(figure)


def borne(thresholds: Sequence[float], greatest: float, xlabel: str) -> str:
    """Plot the share of seeds that still reach the goal over severity."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.6, 2.4), layout="constrained")
        axes = figure.add_subplot()
        steps = np.sort([value for value in thresholds if value <= greatest])
        left = 1.0 - np.arange(len(steps) + 1) / len(thresholds)
        edges = [0.0, *steps, greatest]
        axes.stairs(left, edges, baseline=None, color="#2b6cb0", lw=1.5)
        axes.set(xlabel=xlabel, ylabel="share that bears it", xlim=(0.0, greatest))
        axes.set(ylim=(-0.03, 1.03))
        return _svg(figure)


def track(trace: Trace, scene: str, goal: Sequence[float]) -> str:
    """Plot an episode from above: obstacles, the path of the robot, and its end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.6, 3.0), layout="constrained")
        axes = figure.add_subplot()
        for footprint in footprints(scene):
            axes.add_patch(Polygon(footprint, color="#b8bfc8", lw=0))
        x, y = trace.positions[:, 0], trace.positions[:, 1]
        axes.plot(x, y, color="#2b6cb0", lw=1.2)
        axes.plot(x[0], y[0], "o", color="#2b6cb0", ms=4)
        axes.plot(goal[0], goal[1], "*", color="#2f855a", ms=9)
        if not trace.success:
            axes.plot(x[-1], y[-1], "x", color="#c53030", ms=8, mew=2)
        axes.set_aspect("equal")
        axes.autoscale_view()
        axes.set(xlabel="x, m", ylabel="y, m")
        return _svg(figure)


def footprints(scene: str) -> list[NDArray[np.float64]]:  # (4, 2) each
    """Return the outlines from above of the world's geoms: boxes exactly, others by their bounds.

    Raises:
        InputError: The scene refers to other files, or does not compile.
    """
    text = safe_scene(scene)
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except NOT_COMPILED as error:
        raise InputError(f"scene: {' '.join(str(error).split())[:200]}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    outlines = []
    for geom in range(model.ngeom):
        robot = model.body_weldid[model.geom_bodyid[geom]] != 0
        if robot or model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        R = data.geom_xmat[geom].reshape(3, 3)
        if data.geom_xpos[geom][2] + np.abs(R[2]) @ half < TALLEST_FLOOR:
            continue
        corners = centre + half * [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
        outlines.append((data.geom_xpos[geom] + corners @ R.T)[:, :2])
    return outlines


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
