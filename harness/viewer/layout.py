"""Initial layout of the Rerun viewer: 3D view, top view, decision and curves."""

from __future__ import annotations

from collections.abc import Mapping

import rerun.blueprint as rrb

from wayproof.harness.config import BUILTIN
from wayproof.harness.log.reader import Log
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.viewer.snapshots import layer_period_ns

UNKNOWN_SPACE = (112, 137, 134)
"""Colour of unknown cells in RViz, red, green and blue; also of space outside the map."""

ALL_BUT_COSTMAP = ["+ $origin/**", "- $origin/stack_costmap"]


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
    beside = []
    if gives_costmap(log):
        beside = [_space(f"{root}: the stack's own costmap", world, above, _flat("layer"))]
    return rrb.Vertical(
        rrb.Horizontal(
            _space(f"{root}: space", world, aside, ALL_BUT_COSTMAP),
            _space(
                f"{root}: the map about the robot, each {period:g} s",
                world,
                above,
                _flat("stack_costmap"),
            ),
            *beside,
        ),
        rrb.Horizontal(
            rrb.TextDocumentView(origin=f"/{root}/decision", name="decision"),
            rrb.TextLogView(origin=f"/{root}/reasons", name="reasons"),
        ),
        rrb.Horizontal(
            rrb.TimeSeriesView(origin=f"/{root}/plots/motion", name="speed and clearance"),
            rrb.TimeSeriesView(origin=f"/{root}/plots/latency", name="latency by stage"),
        ),
        rrb.StateTimelineView(
            origin=f"/{root}",
            contents=[f"/{root}/action", f"/{root}/label", f"/{root}/verdict"],
            name="action, label, verdict",
        ),
        row_shares=[10, 6, 4, 3],
        name=f"{root}: {log.path.name}, {log.result['outcome']}",
    )


def gives_costmap(log: Log) -> bool:
    """Return whether a stack on trial gave a costmap of its own with any of its commands."""
    if log.config.stack.name == BUILTIN:
        return False
    return any(
        record.answer is not None
        and sb.Command.FromString(record.answer.command).HasField("costmap")
        for record in log.records()
    )


def _flat(hidden: str) -> list[str]:
    """Return the entities of a top view, without cells, which would hide the grid on the floor.

    Args:
        hidden: The other grid on the floor.
    """
    return ["+ $origin/**", "- $origin/occupied/**", "- $origin/sweep", f"- $origin/{hidden}"]


def _space(
    name: str, world: str, eye: rrb.EyeControls3D, contents: str | list[str]
) -> rrb.Spatial3DView:
    so_far = rrb.VisibleTimeRanges(
        timeline="time",
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin=world,
        contents=contents,
        name=name,
        eye_controls=eye,
        line_grid=False,
        background=list(UNKNOWN_SPACE),
        overrides={f"{world}/trail": [so_far]},
    )
