"""Plots of a report as SVG text; the same data gives the same bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.statistics.exact import Interval
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

STYLE: Any = {
    "svg.hashsalt": "wayproof",  # else ids are drawn at random
    "svg.fonttype": "none",
    "font.size": 9.0,
    "text.parse_math": False,  # what a study is called is no formula
    "axes.spines.top": False,
    "axes.spines.right": False,
}

COLOURS = ("#2b6cb0", "#d55e00", "#009e73", "#cc79a7", "#806000", "#444444")
MARKERS = "osD^vP"
"""Colours and markers of curves, in turn; the colours differ for the colour-blind as well."""

ASIDE = 0.02
"""Distance between the points of two curves, as a share of the axis, so that no interval hides
another."""

UP, DOWN = 6, 7
"""Matplotlib's markers of an interval that goes on beyond the axis."""

REACH = 1.5
"""Reach of the axis beyond the means, in their spread or their size: an interval may be a hundred
times as wide, and would press the means together."""

TALLEST_FLOOR = 0.05
"""Height below which a geom counts as floor, m."""


class Curve(NamedTuple):
    """Means over the amount of a perturbation.

    Attributes:
        name: Name in the legend; empty of a single curve.
        doses: Severity and amount of each mean; the first is that of the unperturbed twin.
        means: Means with their intervals; None where no episode has the figure.
    """

    name: str
    doses: Sequence[tuple[float, float]]
    means: Sequence[Interval | None]


def dose_response(
    curves: Sequence[Curve], *, label: str, ylabel: str, top: float | None = None
) -> str:
    """Plot means with their intervals over the amount of a perturbation, curves side by side.

    Args:
        curves: One, or one for each stack. The severities are spaced evenly, and the amounts are
            written at them.
        label: Label of the amounts.
        ylabel: Label of the mean.
        top: Upper end of the axis; none if None. An interval that goes on beyond the axis, or has
            no end, ends in an arrow.
    """
    doses = sorted({dose for curve in curves for dose in curve.doses})
    apart = ASIDE * (doses[-1][0] - doses[0][0])
    with mpl.rc_context(STYLE):
        named = any(curve.name for curve in curves)
        figure = Figure(figsize=(3.6, 2.8 if named else 2.2), layout="constrained")
        axes = figure.add_subplot()
        limits = _limits(curves, top)
        for place, curve in enumerate(curves):
            offset = apart * (place - 0.5 * (len(curves) - 1))
            _draw_curve(axes, curve, offset, place, limits)
        axes.set(xlabel=label, ylabel=ylabel)
        ticks = [severity for severity, _ in doses]
        axes.set_xticks(ticks, [f"{amount:g}\n{severity:g}" for severity, amount in doses])
        axes.set_ylim(*limits)
        if named:
            figure.legend(loc="outside upper left", ncols=2, fontsize=8)
        return _svg(figure)


def _limits(curves: Sequence[Curve], top: float | None) -> tuple[float, float]:
    """Return the ends of the axis: all means lie on it, and the parts of intervals near them."""
    if top is not None:
        return -0.03, top + 0.03
    known = [one for curve in curves for one in curve.means if one]
    if not known:
        return 0.0, 1.0
    least, most = (end(one.estimate for one in known) for end in (min, max))
    near = REACH * max(most - least, abs(most), 1e-9)
    low = max(least - near, min(one.low for one in known))
    high = min(most + near, max(one.high for one in known))
    margin = 0.05 * max(high - low, 1e-9)
    return min(0.0, low - margin), high + margin


def _draw_curve(
    axes: Axes, curve: Curve, offset: float, place: int, limits: tuple[float, float]
) -> None:
    known = [(dose, one) for dose, one in zip(curve.doses, curve.means, strict=True) if one]
    low, high = limits
    colour = COLOURS[place % len(COLOURS)]
    for (severity, _), one in known:
        for beyond, end, arrow in ((one.low < low, low, DOWN), (one.high > high, high, UP)):
            if beyond:
                axes.plot(
                    severity + offset, end, marker=arrow, ls="none", color=colour, clip_on=False
                )
    axes.errorbar(
        [severity + offset for (severity, _), _ in known],
        [one.estimate for _, one in known],
        yerr=[
            [one.estimate - max(one.low, low) for _, one in known],
            [min(one.high, high) - one.estimate for _, one in known],
        ],
        fmt=f"{MARKERS[place % len(MARKERS)]}-",
        ms=4,
        capsize=3,
        color=colour,
        label=curve.name,
    )


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
