"""Picture of a decision: the layer of the map at the height of the robot, and the truth."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from numpy.typing import NDArray

from wayproof.harness.attribution import Case, Moment
from wayproof.harness.clearance import in_metres, true_in_metres
from wayproof.harness.decision import path_of
from wayproof.harness.explain.card import Card, command_at, moment_of
from wayproof.harness.explain.commanded import Commanded
from wayproof.harness.explain.stack_costmap import (
    CHEAP,
    DEAR,
    Colour,
    Newest,
    costmap_at,
    shades,
)
from wayproof.harness.outputs import written_whole
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED

Array = NDArray[np.float64]

REACH = 4.0
"""Distance around the robot that the picture shows to each side, m."""

TITLE_WIDTH = 100
"""Characters of a line of the title."""

FINE = 0.05
"""Cell size of the drawn true geometry, m."""

TRUE, BELIEVED = "#1f77d0", "#2a9d4a"
"""Colours of the truth, and of estimates and plans."""

ROBOT = "#ffd400"
"""Colour of the robot where it was."""

PLANNED, REFUSED = "#8e44ad", "#e0115f"
"""Colours of a stack's own plan, and of its command beyond what the referee admits."""

KINDS = {
    "free": "#ffffff",
    "unknown": "#c9ced6",
    "inflated": "#f6d9a8",
    "occupied": "#3b4252",
}
"""Colours by kind of cell."""


BODY: dict[str, Any] = dict(facecolor=to_rgba(ROBOT, 0.8), edgecolor=TRUE, lw=1.5)
BELIEVED_BODY: dict[str, Any] = dict(fill=False, edgecolor=BELIEVED, lw=1.0, ls="--")
"""Styles of the body where it was and where it was believed to be."""


def draw(case: Case, card: Card, navigator: Navigator, target: Path) -> None:
    """Write the picture of a card's decision.

    Args:
        case: The episode.
        card: Card of the decision.
        navigator: Stack with the map of the decision.
        target: PNG file.
    """
    moment, own = moment_of(case, card.sequence), costmap_at(case, card.sequence)
    with mpl.rc_context({"font.size": 8.0, "text.parse_math": False}):
        count = 1 if own is None else 2
        figure = Figure(figsize=(7.0 * count, 7.2), layout="constrained", dpi=120)
        axes, *beside = figure.subplots(1, count, squeeze=False)[0]
        _draw_map(axes, navigator, moment)
        for each in (axes, *beside):
            _draw_truth(each, case, moment)
            _draw_motion(each, case, moment)
        for cell in card.blocking:
            _mark(axes, cell.place, marker="x", size=6.0, name="blocking cell")
        if case.contact is not None:
            _mark(axes, place=case.contact.position, marker="*", size=11.0, name="contact")
        if own is not None:
            _draw_costmap(beside[0], own, moment)
        _finish(axes, moment, card, own is not None)
        with written_whole(target, "picture") as partial:
            figure.savefig(partial, format="png", metadata={"Software": None})


def _mark(axes: Axes, place: Sequence[float], marker: str, size: float, name: str) -> None:
    """Draw a red mark; the first of its name appears in the legend."""
    known = axes.get_legend_handles_labels()[1]
    label = "_" if name in known else name
    style: dict[str, Any] = dict(color="#d1232a", ms=size, zorder=7, ls="none", label=label)
    axes.plot(place[0], place[1], marker, **style)


def _draw_map(axes: Axes, navigator: Navigator, moment: Moment) -> None:
    costmap, size = navigator.costmap, navigator.costmap.resolution
    layer = _layer(navigator, moment)
    states = costmap.state[:, :, layer]
    kinds = np.full(states.shape, 1)
    kinds[states == FREE] = 0
    inflated = costmap.field()[:, :, layer] <= moment.decision.collision_distance_sq
    kinds[inflated & (states == FREE)] = 2
    kinds[states == OCCUPIED] = 3
    low, (nx, ny) = costmap.origin, states.shape
    axes.imshow(
        kinds.T,
        origin="lower",
        extent=(low[0], low[0] + nx * size, low[1], low[1] + ny * size),
        cmap=ListedColormap(list(KINDS.values())),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
    )
    axes.set_facecolor(KINDS["unknown"])  # space beyond the map is unknown, too


def _draw_costmap(axes: Axes, own: Newest, moment: Moment) -> None:
    """Draw a stack's own costmap in the colours of the referee's."""
    grid = own.grid
    (x, y), (ny, nx) = grid.origin.tolist(), grid.cells.shape
    axes.imshow(
        shades(
            grid.cells,
            unknown=_bytes(KINDS["unknown"]),
            free=_bytes(KINDS["free"]),
            occupied=_bytes(KINDS["occupied"]),
        ),
        origin="lower",
        extent=(x, x + nx * grid.resolution, y, y + ny * grid.resolution),
        interpolation="nearest",
    )
    axes.set_facecolor(KINDS["unknown"])  # of what lies beyond it the stack says nothing
    axes.set_title(f"the stack's own costmap, as of decision {own.sequence}", loc="left")
    _frame(axes, moment)


def _bytes(colour: str) -> Colour:
    """Return the red, green and blue of a colour, 0 to 255."""
    red, green, blue = (round(255.0 * part) for part in to_rgb(colour))
    return red, green, blue


def _draw_truth(axes: Axes, case: Case, moment: Moment) -> None:
    """Draw the outlines of the true geometry in the layer, movers as placed."""
    case.space.place_movers(moment.truth)
    here = moment.true_position
    bottom, layers = here[2] - 0.5 * FINE, 1
    if case.mission.planar:
        bottom, top = case.mission.step_height, case.mission.height
        layers = max(1, round((top - bottom) / FINE))
    count = round(2.0 * REACH / FINE)
    corner = np.array([here[0] - REACH, here[1] - REACH, bottom])
    solid = case.space.occupied(corner, (count, count, layers), FINE).any(axis=2)
    if solid.any():
        centres = [corner[axis] + (np.arange(count) + 0.5) * FINE for axis in range(2)]
        axes.contour(*centres, solid.T.astype(float), [0.5], colors=TRUE, linewidths=1.2)


def _draw_motion(axes: Axes, case: Case, moment: Moment) -> None:
    before = [one.true_position for one in case.moments if one.time_ns <= moment.time_ns]
    after = [one.true_position for one in case.moments if one.time_ns >= moment.time_ns]
    way = "true track" if case.config.recording is None else "recorded track"
    _line(axes, np.array(before), color=TRUE, ls=":", label=f"{way} so far")
    _line(axes, np.array(after), color="#9bbfe3", ls=":", label=f"{way} after")
    known = [one for one in case.moments if one.time_ns <= moment.time_ns]
    believed_track = np.array([one.true_position + one.error for one in known])
    _line(axes, believed_track, color=BELIEVED, ls=":", label="believed track so far")
    command = command_at(case, moment.decision.sequence)
    if command is None:
        global_path = path_of(moment.decision.global_path)
        _line(axes, global_path, color="#2a9d4a", ls="--", label="path to the goal")
    committed = path_of(moment.decision.trajectory.path)
    _line(axes, committed, color="#2a9d4a", lw=2.5, label="committed trajectory")
    if command is not None:
        _draw_command(axes, command)
    radius, believed = case.mission.radius, moment.true_position + moment.error
    axes.add_patch(Circle(tuple(moment.true_position[:2]), radius, zorder=3, **BODY))
    axes.add_patch(Circle(tuple(believed[:2]), radius, zorder=3, **BELIEVED_BODY))
    goal: dict[str, Any] = dict(color=BELIEVED, ms=7, mfc="none", ls="none", label="goal")
    axes.plot(*case.mission.goal[:2], "o", **goal)


def _draw_command(axes: Axes, command: Commanded) -> None:
    """Draw a stack's own plan, and its command where it is not the committed trajectory."""
    plan: dict[str, Any] = dict(color=PLANNED, ls="--", zorder=1.9)
    _line(axes, command.planned_path, **plan, label="path planned by the stack")
    if command.cut:
        _line(axes, command.admitted, color=BELIEVED, lw=1.2, label="command, admitted part")
    fate = ", cut by the guard" if command.cut else ""
    label = f"command, {command.verdict} part{fate}"
    _line(axes, command.refused, color=REFUSED, lw=2.5, zorder=4, label=label)


def _line(axes: Axes, points: Array, **style: Any) -> None:
    if len(points) >= 2:
        axes.plot(points[:, 0], points[:, 1], **style)


def _frame(axes: Axes, moment: Moment) -> None:
    """Show the surroundings of the robot."""
    x, y, _ = moment.true_position
    axes.set(
        xlim=(x - REACH, x + REACH),
        ylim=(y - REACH, y + REACH),
        xlabel="x, m",
        ylabel="y, m",
        aspect="equal",
    )


def _finish(axes: Axes, moment: Moment, card: Card, has_costmap: bool) -> None:
    _frame(axes, moment)
    label = "" if card.label == "none" else f" [{card.label}]"
    title = f"decision {card.sequence}, {card.time_s:.1f} s: {card.action}{label}\n"
    mapped = in_metres(card.least_clearance_m, card.least_clearance_is_bound)
    now = true_in_metres(card.true_clearance_m)
    known = "" if math.isnan(card.true_clearance_m) else f"{now}, "  # a recording has no truth
    title += f"clearance {known}in the map along the path {mapped}; "
    title += f"pose error {card.pose_error_m:.2f} m\n"
    title += textwrap.fill(card.reason, TITLE_WIDTH)
    if card.stack:
        title += f"\nreferee: {card.verdict}"
    axes.set_title(title, loc="left")
    kinds = [Patch(facecolor=c, edgecolor="#888888", label=name) for name, c in KINDS.items()]
    kinds[list(KINDS).index("unknown")].set_label("unknown, or outside the map")
    if has_costmap:
        ends = ((CHEAP, "cost 1 of the stack"), (DEAR, "cost 99 of the stack"))
        kinds += [
            Patch(facecolor=f"#{bytes(colour).hex()}", edgecolor="#888888", label=name)
            for colour, name in ends
        ]
    others = [
        Line2D([], [], color=TRUE, lw=1.2, label="true obstacles"),
        Circle((0, 0), label="robot, where it was (solid circle)", **BODY),
        Circle((0, 0), label="robot, where it believed it was (dashed circle)", **BELIEVED_BODY),
    ]
    handles, _ = axes.get_legend_handles_labels()
    figure = axes.get_figure()
    assert isinstance(figure, Figure)
    figure.legend(
        handles=[*kinds, *others, *handles],
        loc="outside lower left",
        ncols=6 if has_costmap else 3,
        fontsize=7,
    )


def _layer(navigator: Navigator, moment: Moment) -> int:
    """Return the layer of the costmap at the robot's height; on the ground the only one."""
    costmap = navigator.costmap
    height = (moment.pose.position[2] - costmap.origin[2]) / costmap.resolution
    return int(np.clip(np.floor(height), 0, costmap.shape[2] - 1))
