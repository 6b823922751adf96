"""Picture of a decision from above: the map at the height of the robot, the truth, the plans."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from numpy.typing import NDArray
from PIL import Image

from wayproof.harness.attribution import Case
from wayproof.harness.attribution.case import true_space
from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError
from wayproof.harness.explain.card import Card
from wayproof.harness.explain.commanded import Newest, commanded, costmap_at
from wayproof.harness.log.reader import Log, Record, open_log
from wayproof.harness.outputs import written_whole
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.viewer.colours import (
    BELIEVED,
    COMMITTED,
    GLOBAL_PATH,
    MARK,
    PLANNED,
    REFUSED,
    ROBOT,
    TRUE,
)
from wayproof.harness.viewer.colours import shares as ink
from wayproof.harness.viewer.layer import (
    CHEAP,
    COLOURS,
    DEAR,
    FRONTIER,
    INFLATED,
    kinds,
    layer_at,
    palette,
    shades,
)
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.harness.viewer.words import head
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]

REACH = 4.0
"""Distance around the robot that is shown to each side, m."""

FINE = 0.05
"""Cell size of the drawn true geometry, m."""

SIDE, HEIGHT, DPI = 7.0, 8.4, 100
"""Width of a panel and height of a picture, inches, and pixels per inch."""

LEFT, BOTTOM, MAP_SIDE = 0.6, 1.65, 5.95
"""Place and side of the map in its panel, inches; the legend is below, the words are above."""

MOST_LINES = 5
"""Lines above the map for which there is room at the size of all text; more are smaller."""

BODY: dict[str, Any] = dict(facecolor=(*ink(ROBOT), 0.8), edgecolor=ink(TRUE), lw=1.5)
BELIEVED_BODY: dict[str, Any] = dict(fill=False, edgecolor=ink(BELIEVED), lw=1.5, ls="--")
"""Styles of the body where it was and where it was believed to be."""

STYLE: Any = {"font.size": 8.0, "text.parse_math": False}

CELLS = {
    FREE: "free",
    UNKNOWN: "unknown, or outside the map",
    INFLATED: "inflated",
    FRONTIER: "frontier",
    OCCUPIED: "occupied",
}
"""Legend of the cells."""


class Mark(NamedTuple):
    """A red mark at a place (3,), m, with its name in the legend."""

    place: Sequence[float]
    name: str
    style: str


class Place(NamedTuple):
    """Place of the base at one decision.

    Attributes:
        time_ns: Simulated time, ns.
        true: (3,) true or recorded position, m.
        believed: (3,) estimated position, m.
    """

    time_ns: int
    true: Array
    believed: Array


class TopView:
    """Pictures of the decisions of one log."""

    def __init__(self, log: Log, space: TrueSpace | None = None) -> None:
        """Compile the true scene of a log, unless it is given.

        Raises:
            InputError: The scene in the log cannot be compiled.
        """
        self._log = log
        self._space = true_space(log) if space is None else space
        self.track: list[Place] = []

    def follow(self, moment: Moment) -> None:
        """Add the place of a moment to the track."""
        true, believed = np.array(moment.truth.position), moment.record.inputs.pose.position
        self.track.append(Place(moment.time_ns, true, np.array(believed)))

    @mpl.rc_context(STYLE)
    def draw(
        self, moment: Moment, own: Newest | None = None, marks: Sequence[Mark] = ()
    ) -> Image.Image:
        """Draw a moment, with a stack's own costmap beside it if one is given."""
        canvas: Any = FigureCanvasAgg(self.figure(moment, own, marks))
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])

    @mpl.rc_context(STYLE)
    def figure(self, moment: Moment, own: Newest | None, marks: Sequence[Mark]) -> Figure:
        """Return the figure of a moment; its arguments are those of `draw`."""
        panels = 1 if own is None else 2
        figure = Figure(figsize=(SIDE * panels, HEIGHT), dpi=DPI)
        each = [_panel(figure, number, panels, moment) for number in range(panels)]
        _draw_layer(each[0], moment)
        if own is not None:
            _draw_costmap(each[1], own)
        for axes in each:
            self._draw_truth(axes, moment)
            self._draw_tracks(axes, moment)
            _draw_plans(axes, moment)
        for mark in marks:
            _draw_mark(each[0], mark)
        self._add_words(figure, moment)
        _add_legend(figure, each[0], has_costmap=own is not None)
        return figure

    def _draw_truth(self, axes: Axes, moment: Moment) -> None:
        """Draw the outlines of the true geometry in the layer, movers as placed."""
        mission, here = self._log.mission, np.array(moment.truth.position)
        self._space.place_movers(moment.truth)
        bottom, layers = here[2] - 0.5 * FINE, 1
        if mission.planar:
            bottom, top = mission.step_height, mission.height
            layers = max(1, round((top - bottom) / FINE))
        count = round(2.0 * REACH / FINE)
        corner = np.array([here[0] - REACH, here[1] - REACH, bottom])
        solid = self._space.occupied(corner, (count, count, layers), FINE).any(axis=2)
        if solid.any():
            centres = [corner[axis] + (np.arange(count) + 0.5) * FINE for axis in range(2)]
            axes.contour(*centres, solid.T.astype(float), [0.5], colors=[ink(TRUE)], linewidths=1.2)

    def _draw_tracks(self, axes: Axes, moment: Moment) -> None:
        now = bisect_right(self.track, moment.time_ns, key=lambda place: place.time_ns)
        true, believed = [one.true for one in self.track], [one.believed for one in self.track]
        way = "true track" if self._log.config.recording is None else "recorded track"
        _line(axes, true[:now], color=ink(TRUE), ls=":", label=f"{way} so far")
        _line(axes, true[now - 1 :], color="#e0a0a0", ls=":", label=f"{way} after")
        _line(axes, believed[:now], color=ink(BELIEVED), ls=":", label="believed track so far")
        radius, goal = self._log.mission.radius, self._log.mission.goal
        (x, y), at = moment.truth.position[:2], moment.record.inputs.pose.position[:2]
        axes.add_patch(Circle((x, y), radius, zorder=3, **BODY))
        axes.add_patch(Circle((float(at[0]), float(at[1])), radius, zorder=3, **BELIEVED_BODY))
        axes.plot(*goal[:2], "o", color=ink(COMMITTED), ms=7, mfc="none", ls="none", label="goal")

    def _add_words(self, figure: Figure, moment: Moment) -> None:
        lines = head(moment, self._log.config.costmap.cost_range, self._log.mission.axes)
        size = mpl.rcParams["font.size"] * min(1.0, MOST_LINES / len(lines))
        place = 0.15 / figure.get_figwidth(), 0.985
        figure.text(*place, "\n".join(lines), va="top", fontsize=size)


def _panel(figure: Figure, number: int, panels: int, moment: Moment) -> Axes:
    """Return the axes of a panel, which show the surroundings of the robot."""
    width = SIDE * panels
    place = (number * SIDE + LEFT) / width, BOTTOM / HEIGHT, MAP_SIDE / width, MAP_SIDE / HEIGHT
    axes = figure.add_axes(place)
    x, y = moment.truth.position[:2]
    axes.set(xlim=(x - REACH, x + REACH), ylim=(y - REACH, y + REACH), xlabel="x, m", ylabel="y, m")
    axes.set_facecolor(ink(COLOURS[UNKNOWN]))  # what lies beyond a map is unknown, too
    return axes


def _draw_layer(axes: Axes, moment: Moment) -> None:
    costmap = moment.costmap
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    found = kinds(costmap, layer, moment.decision.collision_distance_sq)
    _draw_cells(axes, palette()[found.T], costmap.origin, costmap.resolution)


def _draw_costmap(axes: Axes, own: Newest) -> None:
    """Draw a stack's own costmap in the colours of the referee's."""
    _draw_cells(axes, shades(own.grid.cells), own.grid.origin, own.grid.resolution)
    axes.set_title(f"the stack's own costmap, as of decision {own.sequence}", loc="left")


def _draw_cells(axes: Axes, colours: NDArray[np.uint8], corner: Array, side: float) -> None:
    """Draw colours (ny, nx, 3) of cells, least y first, from a corner (2,), m."""
    (rows, columns, _), (x, y) = colours.shape, corner[:2]
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(
        colours, origin="lower", interpolation="nearest", aspect="equal",
        extent=(x, x + columns * side, y, y + rows * side),
    )  # fmt: skip
    axes.set(xlim=limits[0], ylim=limits[1])


def _draw_plans(axes: Axes, moment: Moment) -> None:
    """Draw the paths of a decision, and of a command its plan and what was not admitted."""
    decision, command = moment.decision, moment.commanded
    if command is None:
        path = path_of(decision.global_path)
        _line(axes, path, color=ink(GLOBAL_PATH), ls="--", label="path to the goal")
    committed = path_of(decision.trajectory.path)
    _line(axes, committed, color=ink(COMMITTED), lw=2.5, label="committed trajectory")
    if command is None:
        return
    plan: dict[str, Any] = dict(color=ink(PLANNED), ls="--", zorder=1.9)
    _line(axes, command.planned_path, **plan, label="path planned by the stack")
    label = f"command, {command.verdict} part"
    _line(axes, command.refused, color=ink(REFUSED), lw=2.5, zorder=4, label=label)


def _line(axes: Axes, points: Sequence[Array] | Array, **style: Any) -> None:
    if len(points) >= 2:
        through = np.asarray(points)
        axes.plot(through[:, 0], through[:, 1], **style)


def _draw_mark(axes: Axes, mark: Mark) -> None:
    """Draw a mark; the first of its name appears in the legend."""
    known = axes.get_legend_handles_labels()[1]
    label = "_" if mark.name in known else mark.name
    style: dict[str, Any] = dict(color=ink(MARK), ms=7.0, zorder=7, ls="none", label=label)
    axes.plot(mark.place[0], mark.place[1], marker=mark.style, **style)


def _add_legend(figure: Figure, axes: Axes, has_costmap: bool) -> None:
    shown = {name: COLOURS[kind] for kind, name in CELLS.items()}
    if has_costmap:
        shown |= {"cost 1 of the stack": CHEAP, "cost 99 of the stack": DEAR}
    cells = [
        Patch(facecolor=ink(colour), edgecolor="#888888", label=name)
        for name, colour in shown.items()
    ]
    bodies = [
        Line2D([], [], color=ink(TRUE), lw=1.2, label="true obstacles"),
        Circle((0, 0), label="robot, where it was (solid circle)", **BODY),
        Circle((0, 0), label="robot, where it believed it was (dashed circle)", **BELIEVED_BODY),
    ]
    handles, _ = axes.get_legend_handles_labels()
    figure.legend(
        handles=[*cells, *bodies, *handles],
        loc="lower left", ncols=6 if has_costmap else 3, fontsize=7, frameon=False,
    )  # fmt: skip


def draw_picture(path: Path, sequence: int, out: Path, allow_plugins: bool = False) -> None:
    """Draw one decision, with a stack's own costmap beside it if it gave one.

    Raises:
        InputError: The log cannot be read or has no such decision, or nothing can be written.
    """
    log = open_log(path, allow_plugins)
    view, count, own = TopView(log), 0, None
    for moment in moments(log, shown=sequence):
        view.follow(moment)
        count += 1
        own = moment.stack_costmap or own
        if moment.decision.sequence == sequence:
            _write(out, view.draw(moment, own))
            return
    if not count:
        raise InputError(f"log '{path}': no decisions in it")
    raise InputError(f"log '{path}': no decision {sequence}, expected 0 to {count - 1}")


def draw_card(log: Log, case: Case, card: Card, navigator: Navigator, out: Path) -> None:
    """Draw the decision of a card, with what blocked it and the contact as marks.

    Args:
        log: The log.
        case: The episode, as of the decision.
        card: Card of the decision.
        navigator: Stack with the map of the decision.
        out: PNG file.

    Raises:
        InputError: The file cannot be written.
    """
    view = TopView(log, case.space)
    for one in case.moments:
        position = np.array(one.truth.position)
        view.track.append(Place(one.time_ns, position, np.array(one.pose.position)))
    number = card.decision.sequence
    here = case.moments[number]
    command = commanded(here.answer, here.decision)
    record = Record(here.inputs, here.latency, here.decision, answer=here.answer)
    moment = Moment(record, here.truth, case.beams_at(number), navigator, command)
    marks = [Mark(cell.place, "blocking cell", "x") for cell in card.blocking]
    if case.contact is not None:
        marks.append(Mark(case.contact.position, "contact", "*"))
    _write(out, view.draw(moment, costmap_at(case, number), marks))


def _write(out: Path, picture: Image.Image) -> None:
    with written_whole(out, "picture") as partial:
        picture.save(partial, format="png", optimize=True)
