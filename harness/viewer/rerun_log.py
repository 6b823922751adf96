"""Rerun recording of a log: map, robot, truth and decisions on one timeline.

Rerun is large and headless runs do not need it, so `rerun_view.py` imports this late.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.explain.commanded import Commanded
from wayproof.harness.explain.stack_costmap import MOST
from wayproof.harness.interface.types import Grid
from wayproof.harness.log.reader import Log
from wayproof.harness.result import RECORDED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import path_of
from wayproof.harness.viewer.layer import FRONTIER, INFLATED
from wayproof.harness.viewer.rows import Rows
from wayproof.harness.viewer.snapshots import Layer, Snapshot, tiles_of
from wayproof.harness.viewer.tiles import Tile
from wayproof.harness.viewer.words import describe, is_warning
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

RVIZ_MAP = {UNKNOWN: 255, FREE: 0, OCCUPIED: 100, INFLATED: 200, FRONTIER: 110}
"""Values that RViz's map colours show as grey, white, black, orange and green."""

_CODES = np.zeros(256, np.uint8)
_CODES[list(RVIZ_MAP)] = list(RVIZ_MAP.values())

_COSTS = np.full(256, RVIZ_MAP[UNKNOWN], np.uint8)
_COSTS[1 : MOST + 1] = np.linspace(254, 128, MOST).round()
_COSTS[0], _COSTS[MOST + 1] = RVIZ_MAP[FREE], RVIZ_MAP[OCCUPIED]
"""Values for a stack's costs, 0 to 100, that RViz's map colours show as white, yellow to red, and
black; whatever is no cost is unknown."""

GLOBAL_PATH, COMMITTED, BELIEVED, TRUE = (
    (60, 110, 235),
    (20, 170, 70),
    (60, 110, 235),
    (210, 40, 40),
)
PLANNED, REFUSED = (150, 60, 190), (235, 20, 90)
"""Colours of a stack's own plan, and of its command beyond what the referee admits."""

HIT, MOVER, FAILURE = (150, 80, 200), (230, 140, 20), (255, 0, 0)
LINE = 0.02  # m
HIT_RADIUS = rr.Radius.ui_points(1.5)

ACTIONS = {
    "follow": 0x2E9E4FFF,
    "slow": 0xE0B000FF,
    "stop_and_wait": 0xD2691EFF,
    "explore": 0x3C6EEBFF,
    "recover": 0x9650C8FF,
    "goal": 0x1E8C8CFF,
    "abort": 0xD22828FF,
}
"""Colours of actions on their lane."""

VERDICTS = {"admitted": 0x2E9E4FFF, "unknown": 0xE0A000FF, "blocked": 0xD22828FF}
"""Colours of the referee's verdicts on their lane."""


def show_log(stream: rr.RecordingStream, log: Log, snapshots: Iterable[Snapshot], root: str) -> int:
    """Send a whole log under one root entity; return the number of decisions."""
    _show_mission(stream, log, root)
    artist = _Artist(stream, log, root)
    for snapshot in snapshots:
        artist.show(snapshot)
    return artist.finish(log)


class _Artist:
    """Views of each moment; unchanged ones are not repeated."""

    def __init__(self, stream: rr.RecordingStream, log: Log, root: str) -> None:
        self._stream, self._root = stream, root
        self._rows = Rows(stream, root)
        self._tiles = tiles_of(log)
        self._top = max(log.mission.high[2], 1.0)
        self._cost_range = log.config.costmap.cost_range
        self._half = np.array([0.5 * log.config.map.resolution], np.float32)
        self._last: Snapshot | None = None
        self._count = 0
        self._frame: object = None
        self._layer: NDArray[np.uint8] | None = None
        self._place: list[float] | None = None

    def show(self, snapshot: Snapshot) -> None:
        """Show one moment."""
        last, self._last = self._last, snapshot
        if last is None or snapshot.decision.sequence != last.decision.sequence:
            self._show_moment(snapshot)
        if snapshot.layer is not None:
            self._show_layer(snapshot.layer)
        if snapshot.stack_costmap is not None:
            self._show_costmap(snapshot.stack_costmap)
        if snapshot.hits is not None:
            hits = snapshot.hits().astype(np.float32)
            self._rows.put_many("world/sweep", rr.Points3D, positions=hits)
        if snapshot.tiles:
            self._show_cells(snapshot.tiles)

    def finish(self, log: Log) -> int:
        """Send the rest and the outcome; return the number of moments."""
        if self._last is not None:
            self._rows.send()
            _show_end(self._stream, log, self._last, self._root)
        return self._count

    def _show_moment(self, moment: Snapshot) -> None:
        self._count += 1
        self._rows.begin(moment.time_ns, moment.decision.sequence)
        self._show_decision(moment)
        self._show_truth(moment.truth)
        for name, value in curves(moment).items():
            self._rows.put(f"plots/{name}", rr.Scalars, scalars=value)

    def _show_decision(self, moment: Snapshot) -> None:
        decision, pose, rows = moment.decision, moment.pose, self._rows
        rows.put("world/robot", rr.Transform3D, **_transform(pose.position, pose.quaternion))
        global_path, path = path_of(decision.global_path), path_of(decision.trajectory.path)
        if moment.commanded is not None:
            global_path = global_path[:0]  # it would be the stack's own, in the colour of ours
            self._show_command(moment.commanded)
        rows.put("world/global_path", rr.LineStrips3D, strips=global_path)
        rows.put("world/trajectory", rr.LineStrips3D, strips=path)
        words = describe(decision, self._cost_range, moment.commanded)
        rows.put("decision", rr.TextDocument, text=words)
        rows.put("action", rr.StateChange, state=decision.action)
        rows.put("label", rr.StateChange, state=decision.label)
        level = "WARN" if is_warning(decision) else "INFO"
        text = f"{decision.action}: {decision.reason}"
        rows.put("reasons", rr.TextLog, text=text, level=level)

    def _show_command(self, commanded: Commanded) -> None:
        """Show a stack's plan, the part of its command that is not admitted, and the verdict."""
        rows = self._rows
        rows.put("world/planned_path", rr.LineStrips3D, strips=commanded.planned_path)
        rows.put("world/not_admitted", rr.LineStrips3D, strips=commanded.refused)
        rows.put("verdict", rr.StateChange, state=commanded.verdict)

    def _show_truth(self, truth: pb.Truth) -> None:
        place = list(truth.position)
        self._rows.put("world/truth", rr.Transform3D, **_transform(place, truth.quaternion))
        if self._place is not None:  # one piece per time; the layout shows all up to now
            piece = np.array([self._place, place])
            self._rows.put("world/trail", rr.LineStrips3D, strips=piece)
        self._place = place
        if truth.movers:
            present = [mover for mover in truth.movers if mover.present]
            places = np.array([mover.position for mover in present]).reshape(-1, 3)
            names = [mover.name for mover in present]
            self._rows.put_many("world/movers", rr.Points3D, positions=places, labels=names)

    def _show_layer(self, layer: Layer) -> None:
        """Show a layer if it differs from the last one."""
        if self._layer is not None and np.array_equal(self._layer, layer.kinds):
            return
        self._layer = layer.kinds
        self._show_frame(layer)
        image = _CODES[layer.kinds].T[::-1]  # (ny, nx), from the greatest y down
        self._rows.put("world/layer", rr.GridMap, data=image.tobytes())

    def _show_costmap(self, grid: Grid) -> None:
        """Show a stack's own costmap; it may move and change its size."""
        height, width = grid.cells.shape
        image = _COSTS[np.ascontiguousarray(grid.cells[::-1]).view(np.uint8)]
        self._log_now(
            "world/stack_costmap",
            _grid_map(width, height, grid.resolution, grid.origin.tolist(), image.tobytes()),
        )

    def _show_frame(self, layer: Layer) -> None:
        """Show the pose of the layer, once and after a fork that changes it."""
        width, height = layer.kinds.shape
        corner = layer.corner.tolist()
        frame = (width, height, layer.resolution, *corner)
        if frame == self._frame or self._last is None:
            return
        self._frame = frame
        self._log_now("world/layer", _grid_map(width, height, layer.resolution, corner))

    def _log_now(self, entity: str, content: rr.AsComponents) -> None:
        """Send one message of the last moment, out of the columns."""
        assert self._last is not None
        self._stream.set_time("time", duration=np.timedelta64(self._last.time_ns, "ns"))
        self._stream.set_time("decision", sequence=self._last.decision.sequence)
        self._stream.log(f"{self._root}/{entity}", content)

    def _show_cells(self, tiles: list[Tile]) -> None:
        each = [self._tiles.centres(tile).astype(np.float32) for tile in tiles]
        heights = np.concatenate(each)[:, 2]
        shade = (50 + 170 * np.clip(heights / self._top, 0.0, 1.0)).astype(np.uint32)
        colours = (shade // 2) << 24 | shade << 16 | (255 - shade // 2) << 8 | 255
        ends = np.cumsum([len(centres) for centres in each])
        for tile, centres, shades in zip(tiles, each, np.split(colours, ends), strict=False):
            self._rows.put_many(
                f"world/occupied/{tile.name}",
                rr.Points3D,
                positions=centres,
                colors=shades,
                radii=self._half,
            )


def _grid_map(
    width: int, height: int, side: float, corner: list[float], data: bytes | None = None
) -> rr.GridMap:
    """Return a grid on the floor in RViz's map colours.

    Args:
        width: Number of cells along x.
        height: Number of cells along y.
        side: Edge of a cell, m.
        corner: [x, y] of the lower corner of its first cell, m, world.
        data: A byte for each cell, from the greatest y down; None: sent apart.
    """
    return rr.GridMap.from_fields(
        data=data,
        format=rr.components.ImageFormat(
            width=width, height=height, color_model="L", channel_datatype="U8"
        ),
        cell_size=side,
        translation=[*corner, 0.0],
        colormap=rr.components.Colormap.RvizMap,
        opacity=0.9,
    )


def curves(moment: Snapshot) -> dict[str, float]:
    """Return the values of the curves over simulated time, by name."""
    decision, truth, stages = moment.decision, moment.truth, moment.decision.stages
    known = not math.isnan(truth.clearance_m)  # a recording has no truth
    return {
        **({"motion/true_clearance_m": truth.clearance_m} if known else {}),
        "motion/speed_m_s": float(np.linalg.norm(truth.velocity)),
        "motion/committed_m": decision.committed_length_m,
        "latency/sense_ms": stages.sense_ms,
        "latency/map_ms": stages.map_ms,
        "latency/costmap_ms": stages.costmap_ms,
        "latency/plan_ms": stages.plan_ms,
        "latency/delay_ms": decision.delay_s * 1e3,
        "latency/deadline_ms": decision.deadline_s * 1e3,
    }


def _show_mission(stream: rr.RecordingStream, log: Log, root: str) -> None:
    mission, world = log.mission, f"{root}/world"
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    goal = rr.Points3D([mission.goal], radii=0.12, colors=COMMITTED)
    stream.log(f"{world}/goal", goal, static=True)
    stream.log(f"{world}/goal/words", _words(mission.goal, "goal"), static=True)
    ahead = rr.Arrows3D(vectors=[[1.6 * mission.radius, 0.0, 0.0]], radii=0.02, colors=BELIEVED)
    stream.log(f"{world}/robot/ahead", ahead, static=True)
    for name, colour in (("robot", BELIEVED), ("truth", TRUE)):
        if not mission.planar:
            size = [mission.radius, mission.radius, 0.5 * mission.height]
            body = rr.Ellipsoids3D(half_sizes=[size], colors=colour, fill_mode="densewireframe")
            stream.log(f"{world}/{name}/body", body, static=True)
        else:
            disc = rr.Cylinders3D(
                lengths=[0.1], radii=[mission.radius], colors=colour, fill_mode="densewireframe"
            )
            stream.log(f"{world}/{name}/body", disc, static=True)
    lanes = rr.StateConfiguration(values=list(ACTIONS), colors=list(ACTIONS.values()))
    stream.log(f"{root}/action", lanes, static=True)
    colours = np.array(list(VERDICTS.values()), np.uint32)  # of three, a list could be one colour
    verdicts = rr.StateConfiguration(values=list(VERDICTS), colors=colours)
    stream.log(f"{root}/verdict", verdicts, static=True)
    styles = {
        "sweep": rr.Points3D.from_fields(radii=HIT_RADIUS, colors=HIT),
        "movers": rr.Points3D.from_fields(radii=0.25, colors=MOVER),
        "global_path": rr.LineStrips3D.from_fields(radii=LINE, colors=GLOBAL_PATH),
        "trajectory": rr.LineStrips3D.from_fields(radii=2 * LINE, colors=COMMITTED),
        "planned_path": rr.LineStrips3D.from_fields(radii=LINE, colors=PLANNED),
        "not_admitted": rr.LineStrips3D.from_fields(radii=3 * LINE, colors=REFUSED),
        "trail": rr.LineStrips3D.from_fields(radii=LINE, colors=TRUE),
    }
    for name, style in styles.items():
        stream.log(f"{world}/{name}", style, static=True)
    markdown = rr.TextDocument.from_fields(media_type="text/markdown")
    stream.log(f"{root}/decision", markdown, static=True)


def _show_end(stream: rr.RecordingStream, log: Log, last: Snapshot, root: str) -> None:
    """Show the outcome at the end; a failure with a mark."""
    outcome, reason = log.result["outcome"], log.result.get("reason", "")
    end_ns = round(float(log.result.get("sim_time_s", last.time_ns * 1e-9)) * 1e9)
    stream.set_time("time", duration=np.timedelta64(max(end_ns, last.time_ns), "ns"))
    good = outcome in ("success", RECORDED)
    text = rr.TextLog(f"{outcome}: {reason}", level="INFO" if good else "ERROR")
    stream.log(f"{root}/reasons", text)
    if end_ns > last.time_ns:  # otherwise the last action would seem to go on
        lanes = ("action", "label") if last.commanded is None else ("action", "label", "verdict")
        for lane in lanes:
            stream.log(f"{root}/{lane}", rr.StateChange(state=""))
    if good:
        return
    place = list(last.truth.position)
    mark = rr.Points3D([place], radii=0.25, colors=FAILURE)
    stream.log(f"{root}/world/failure", mark)
    stream.log(f"{root}/world/failure/words", _words(place, f"{outcome}: {reason}"))


def _words(place: Sequence[float], words: str) -> rr.Points3D:
    """Return a separate label, which is readable whatever the colour of its object."""
    return rr.Points3D([list(place)], radii=0.02, colors=(255, 255, 255), labels=[words])


def _transform(position: Iterable[float], quaternion: Iterable[float]) -> dict[str, Any]:
    w, x, y, z = quaternion
    return {"translation": list(position), "quaternion": rr.Quaternion(xyzw=[x, y, z, w])}
