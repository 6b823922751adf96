"""Initial layout of the Rerun viewer: 3D view, top view, decision and curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun.blueprint as rrb

from wayproof.harness.config import BUILTIN
from wayproof.harness.log.reader import Log
from wayproof.harness.shadow.picture import COLOURS_OF_WAY
from wayproof.harness.viewer.curves import PLOTS
from wayproof.harness.viewer.events import COLOURS, name_of
from wayproof.harness.viewer.evidence import WORDS
from wayproof.harness.viewer.layer import COLOURS as CELL_COLOURS
from wayproof.harness.viewer.snapshots import layer_period_ns
from wayproof.maps import UNKNOWN

FLOORS = ("layer", "age", "probability", "stack_costmap")
"""Grids on the floor; a view shows one."""

FROM_ABOVE = ("cells/**", "sweep", "scene/**")
"""Entities that would hide a grid on the floor from above."""

TRACKS = ("trail", "believed_trail", *(f"way/{verdict}" for verdict in COLOURS_OF_WAY))


def layout(logs: Mapping[str, Log]) -> rrb.Blueprint:
    """Return the layout for one log, or for several side by side, by their roots."""
    columns = [_column(root, log) for root, log in logs.items()]
    body = columns[0] if len(columns) == 1 else rrb.Horizontal(*columns)
    return rrb.Blueprint(
        body,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", playback_speed=1.0),
        auto_layout=False,
        auto_views=False,
    )


def _column(root: str, log: Log) -> rrb.Vertical:
    low, high = log.mission.low, log.mission.high
    x, y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    span = max(high[0] - low[0], high[1] - low[1])
    aside = rrb.EyeControls3D(
        position=(x - 0.35 * span, y - 0.6 * span, 0.55 * span), look_target=(x, y, 0.0)
    )
    above = rrb.EyeControls3D(
        position=(x, y - 0.01, 0.85 * span), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0)
    )
    world, period = f"/{root}/world", layer_period_ns(log) * 1e-9
    verdict = "verdict" if log.config.recording is None else "way"
    lanes = ("action", "label", verdict, "event")
    maps = [
        _space(world, f"map, each {period:g} s", above, "layer", FROM_ABOVE),
        _space(world, WORDS["age"], above, "age", FROM_ABOVE),
        _space(world, WORDS["probability"], above, "probability", FROM_ABOVE),
    ]
    if log.config.stack.name != BUILTIN:
        name = "the stack's own costmap"
        maps.insert(1, _space(world, name, above, "stack_costmap", FROM_ABOVE))
    return rrb.Vertical(
        rrb.Horizontal(_space(world, f"{root}: space", aside, "layer"), rrb.Tabs(*maps)),
        rrb.Horizontal(
            rrb.TextDocumentView(origin=f"/{root}/decision", name="decision"),
            rrb.TextLogView(origin=f"/{root}/reasons", name="reasons"),
        ),
        rrb.Horizontal(
            _plot(root, "clearance"),
            _plot(root, "speed"),
            rrb.Tabs(_plot(root, "pose"), _plot(root, "heading")),
        ),
        rrb.Horizontal(
            _plot(root, "path", legend=log.config.has_layers),
            _plot(root, "latency"),
            _plot(root, "delay"),
        ),
        rrb.StateTimelineView(
            origin=f"/{root}",
            contents=[f"/{root}/{lane}" for lane in lanes],
            name=", ".join(lanes),
        ),
        row_shares=[9, 4.5, 3, 3, 4.5],
        name=f"{root}: {log.path.name}, {log.result['outcome']}",
    )


LEGENDS = ("clearance", "pose", "latency", "delay")
"""Plots of more than one curve."""


def _plot(root: str, name: str, legend: bool = False) -> rrb.TimeSeriesView:
    """Return a plot; the legend stands where curves of things above 0 seldom are."""
    visible = legend or name in LEGENDS
    return rrb.TimeSeriesView(
        origin=f"/{root}/plots/{name}",
        name=PLOTS[name],
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=visible),
    )


def _space(
    world: str, name: str, eye: rrb.EyeControls3D, floor: str, hidden: Sequence[str] = ()
) -> rrb.Spatial3DView:
    """Return a view in space with one grid on the floor.

    Args:
        world: Entity of the world.
        name: Title of the view.
        eye: Position of the viewer.
        floor: Entity of the grid.
        hidden: Entities left out besides.
    """
    left_out = [*(one for one in FLOORS if one != floor), *hidden]
    so_far = rrb.VisibleTimeRanges(
        timeline="time",
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    marks = (f"events/{name_of(kind)}" for kind in COLOURS)
    return rrb.Spatial3DView(
        origin=world,
        contents=["+ $origin/**", *(f"- $origin/{one}" for one in left_out)],
        name=name,
        eye_controls=eye,
        line_grid=False,
        background=list(CELL_COLOURS[UNKNOWN]),
        overrides={f"{world}/{one}": [so_far] for one in (*TRACKS, *marks)},
    )
