"""A log as a Rerun recording: one timeline with the map, the robot, the truth and each decision.

Rerun is imported here and in `layout.py` alone: it is large, and no headless run needs it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from harness.reader import Log
from harness.schema import wayproof_pb2 as pb
from harness.viewer.layer import FRONTIER, INFLATED, kinds, layer_at
from harness.viewer.moments import Moment, moments, points_of, standing_low
from harness.viewer.tiles import Tiles
from harness.viewer.words import describe
from maps import FREE, OCCUPIED, UNKNOWN

MOST_HITS = 3000
"""Ends of beams that are shown of a sweep."""

SWEEP_PERIOD_NS = 200_000_000
CELLS_PERIOD_NS = 1_000_000_000
"""Of simulated time, between sweeps and between looks for changed cells. Layers and decisions are
shown each time."""

RVIZ_MAP = {UNKNOWN: 255, FREE: 0, OCCUPIED: 100, INFLATED: 200, FRONTIER: 110}
"""Values that RViz's colours for maps show grey, white, black, orange and green."""

GUIDE, COMMITTED, BELIEVED, TRUE = (60, 110, 235), (20, 170, 70), (60, 110, 235), (210, 40, 40)
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
"""Colour of each action on its lane."""


@dataclass
class Plots:
    """Curves over simulated time, sent in one go at the end."""

    times: list[float] = field(default_factory=list)
    curves: dict[str, list[float]] = field(default_factory=dict)

    def add(self, moment: Moment) -> None:
        """One more sample of every curve."""
        decision, truth, stages = moment.decision, moment.truth, moment.decision.stages
        self.times.append(moment.time_ns * 1e-9)
        values = {
            "motion/speed_m_s": float(np.linalg.norm(truth.velocity)),
            "motion/true_clearance_m": truth.clearance_m,
            "motion/committed_m": decision.committed_length_m,
            "latency/sense_ms": stages.sense_ms,
            "latency/map_ms": stages.map_ms,
            "latency/costmap_ms": stages.costmap_ms,
            "latency/plan_ms": stages.plan_ms,
            "latency/delay_ms": decision.delay_s * 1e3,
            "latency/deadline_ms": decision.deadline_s * 1e3,
        }
        for name, value in values.items():
            self.curves.setdefault(name, []).append(value)

    def send(self, stream: rr.RecordingStream, root: str) -> None:
        """Every curve, a column each."""
        index = rr.TimeColumn("time", duration=np.array(self.times))
        for name, values in self.curves.items():
            columns = rr.Scalars.columns(scalars=np.array(values))
            stream.send_columns(f"{root}/plots/{name}", [index], columns)


def show_log(stream: rr.RecordingStream, log: Log, root: str) -> int:
    """Send a whole log under one root of entities; returns the number of decisions.

    Raises:
        InputError: The log is damaged, or its sweeps were left out.
    """
    _show_mission(stream, log, root)
    tiles = Tiles(standing_low(log.mission), log.mission.high, log.config.map.resolution)
    plots = Plots()
    layer_before: NDArray[np.uint8] | None = None
    swept_ns = cells_ns = -(10**12)
    place: list[float] | None = None
    moment = None
    for moment in moments(log):
        now = moment.time_ns
        stream.set_time("time", duration=np.timedelta64(now, "ns"))
        stream.set_time("decision", sequence=moment.decision.sequence)
        _show_decision(stream, moment, root)
        _show_truth(stream, moment.truth, place, root)
        place = list(moment.truth.position)
        layer_before = _show_layer(stream, moment, layer_before, root)
        if now - swept_ns >= SWEEP_PERIOD_NS:
            swept_ns = now
            hits = moment.hits(MOST_HITS)
            stream.log(
                f"{root}/world/sweep",
                rr.Points3D(hits.astype(np.float32), radii=HIT_RADIUS, colors=HIT),
            )
        if now - cells_ns >= CELLS_PERIOD_NS:
            cells_ns = now
            _show_cells(stream, log, moment, tiles, root)
        plots.add(moment)
    if moment is None:
        return 0
    _show_cells(stream, log, moment, tiles, root)
    _show_end(stream, log, moment, root)
    plots.send(stream, root)
    return len(plots.times)


def _show_mission(stream: rr.RecordingStream, log: Log, root: str) -> None:
    mission, world = log.mission, f"{root}/world"
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    goal = rr.Points3D([mission.goal], radii=0.12, colors=COMMITTED, labels=["goal"])
    stream.log(f"{world}/goal", goal, static=True)
    ahead = rr.Arrows3D(vectors=[[1.6 * mission.radius, 0.0, 0.0]], radii=0.02, colors=BELIEVED)
    stream.log(f"{world}/robot/ahead", ahead, static=True)
    for name, colour in (("robot", BELIEVED), ("truth", TRUE)):
        if mission.motion == "air":
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


def _show_decision(stream: rr.RecordingStream, moment: Moment, root: str) -> None:
    decision, pose = moment.decision, moment.record.inputs.pose
    world = f"{root}/world"
    stream.log(f"{world}/robot", _transform(pose.position, pose.quaternion))
    guide, path = points_of(decision.guide), points_of(decision.trajectory.path)
    stream.log(f"{world}/guide", rr.LineStrips3D([guide], radii=LINE, colors=GUIDE))
    stream.log(f"{world}/trajectory", rr.LineStrips3D([path], radii=2 * LINE, colors=COMMITTED))
    stream.log(f"{root}/decision", rr.TextDocument(describe(decision), media_type="text/markdown"))
    stream.log(f"{root}/action", rr.StateChange(state=decision.action))
    stream.log(f"{root}/label", rr.StateChange(state=decision.label))
    level = "INFO" if decision.label == "none" else "WARN"
    stream.log(f"{root}/reasons", rr.TextLog(f"{decision.action}: {decision.reason}", level=level))


def _show_truth(
    stream: rr.RecordingStream, truth: pb.Truth, before: list[float] | None, root: str
) -> None:
    world, place = f"{root}/world", list(truth.position)
    stream.log(f"{world}/truth", _transform(np.array(place), np.array(truth.quaternion)))
    if before is not None:  # a piece at each time; the layout shows all up to now
        stream.log(f"{world}/trail", rr.LineStrips3D([[before, place]], radii=LINE, colors=TRUE))
    present = [mover for mover in truth.movers if mover.present]
    if truth.movers:
        places, names = [list(one.position) for one in present], [one.name for one in present]
        shown = rr.Points3D(places, radii=0.25, colors=MOVER, labels=names)
        stream.log(f"{world}/movers", shown)


def _show_layer(
    stream: rr.RecordingStream, moment: Moment, before: NDArray[np.uint8] | None, root: str
) -> NDArray[np.uint8]:
    """The layer that the robot moves in, if it is another than the one shown."""
    costmap = moment.costmap
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    told = kinds(costmap, layer)
    if before is not None and np.array_equal(before, told):
        return told
    codes = np.zeros(256, np.uint8)
    for kind, code in RVIZ_MAP.items():
        codes[kind] = code
    image = codes[told].T[::-1]  # (ny, nx), the greatest y first
    width, height = told.shape
    grid = rr.GridMap(
        data=image.tobytes(),
        format=rr.components.ImageFormat(
            width=width, height=height, color_model="L", channel_datatype="U8"
        ),
        cell_size=costmap.resolution,
        translation=[*costmap.origin[:2], 0.0],
        colormap=rr.components.Colormap.RvizMap,
        opacity=0.9,
    )
    stream.log(f"{root}/world/layer", grid)
    return told


def _show_cells(
    stream: rr.RecordingStream, log: Log, moment: Moment, tiles: Tiles, root: str
) -> None:
    top = max(log.mission.high[2], 1.0)
    half = 0.5 * moment.map.resolution
    for name, centres in tiles.changed(moment.map):
        shade = (50 + 170 * np.clip(centres[:, 2] / top, 0.0, 1.0)).astype(np.uint8)
        colours = np.stack([shade // 2, shade, 255 - shade // 2], axis=1)
        cells = rr.Points3D(centres.astype(np.float32), radii=half, colors=colours)
        stream.log(f"{root}/world/occupied/{name}", cells)


def _show_end(stream: rr.RecordingStream, log: Log, last: Moment, root: str) -> None:
    """How the episode ended, at its end; a failure with its mark."""
    outcome, reason = log.result["outcome"], log.result.get("reason", "")
    end_ns = round(float(log.result.get("sim_time_s", last.time_ns * 1e-9)) * 1e9)
    stream.set_time("time", duration=np.timedelta64(max(end_ns, last.time_ns), "ns"))
    good = outcome == "success"
    text = rr.TextLog(f"{outcome}: {reason}", level="INFO" if good else "ERROR")
    stream.log(f"{root}/reasons", text)
    if end_ns > last.time_ns:  # a lane that goes on would look like a decision that stands
        for lane in ("action", "label"):
            stream.log(f"{root}/{lane}", rr.StateChange(state=""))
    if good:
        return
    mark = rr.Points3D(
        [list(last.truth.position)], radii=0.25, colors=FAILURE, labels=[f"{outcome}: {reason}"]
    )
    stream.log(f"{root}/world/failure", mark)


def _transform(position: NDArray[np.float64], quaternion: NDArray[np.float64]) -> rr.Transform3D:
    w, x, y, z = quaternion
    return rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=[x, y, z, w]))
