"""Rerun recording of a log: map, robot, truth and decisions on one timeline.

Rerun is large and headless runs do not need it, so `rerun_view.py` imports this late.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.interface.types import Grid
from wayproof.harness.log.follow import FollowedLog
from wayproof.harness.log.reader import Log
from wayproof.harness.result import RECORDED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.legs import Leg
from wayproof.harness.shadow.picture import COLOURS_OF_WAY
from wayproof.harness.viewer.curves import curves
from wayproof.harness.viewer.events import CONTACT, LAST_CHANCE, PLOTS, Events, name_of
from wayproof.harness.viewer.layer import FRONTIER, INFLATED, MOST
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.rerun_static import FAILURE, show_lanes, show_static, words_at
from wayproof.harness.viewer.snapshots import MOST_HITS, Layer, Snapshot, tiles_of
from wayproof.harness.viewer.tiles import Tile
from wayproof.harness.viewer.words import describe, is_warning
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

RVIZ_MAP = {UNKNOWN: 255, FREE: 0, OCCUPIED: 100, INFLATED: 200, FRONTIER: 110}
"""Values that RViz's map colours show as grey, white, black, orange and green."""

_CODES = np.array([RVIZ_MAP[kind] for kind in range(len(RVIZ_MAP))], np.uint8)

_COSTS = np.full(256, RVIZ_MAP[UNKNOWN], np.uint8)
_COSTS[1 : MOST + 1] = np.linspace(254, 128, MOST).round()
_COSTS[0], _COSTS[MOST + 1] = RVIZ_MAP[FREE], RVIZ_MAP[OCCUPIED]
"""Values for a stack's costs, 0 to 100, that RViz's map colours show as white, yellow to red, and
black; whatever is no cost is unknown."""

WAY_LINE, WAY_ABOVE = rr.Radius.ui_points(2.0), 0.05
"""Radius of the way of a recorded robot, which is seen as a whole, and its height above the body's
origin, m: the layer of the map lies on the floor."""


def show_log(
    stream: rr.RecordingStream,
    log: Log,
    snapshots: Iterable[Snapshot],
    root: str,
    legs: Sequence[Leg] = (),
) -> int:
    """Send a whole log under one root entity; return the number of decisions.

    Args:
        stream: Target of the log.
        log: The log; it may still be being written.
        snapshots: Its moments, in order.
        root: The root entity.
        legs: Way of a recorded robot, with its verdicts.

    Raises:
        InputError: The scene in the log cannot be compiled, or the log is damaged.
    """
    artist = _Artist(stream, log, root, with_trail=not legs)
    if legs:
        artist.show_way(legs)
    for snapshot in snapshots:
        artist.show(snapshot)
    if isinstance(log, FollowedLog):
        log = log.finished()
        artist.mark_last_chance(log)
    return artist.finish(log)


class _Artist:
    """Views of each moment; unchanged ones are not repeated."""

    def __init__(self, stream: rr.RecordingStream, log: Log, root: str, with_trail: bool) -> None:
        self._stream, self._root = stream, root
        self._movers = show_static(stream, log, root)
        self._with_trail = with_trail
        self._tiles = tiles_of(log)
        self._top = max(log.mission.high[2], 1.0)
        self._cost_range, self._axes = log.config.costmap.cost_range, log.mission.axes
        self._half = 0.5 * log.config.map.resolution
        self._events = Events(log)
        self._marked = False  # whether the lane of events shows one
        self._shown: list[tuple[int, list[float]]] = []  # time, ns, and true position
        self._last: Moment | None = None
        self._layer: NDArray[np.uint8] | None = None

    def show(self, snapshot: Snapshot) -> None:
        """Show one moment."""
        moment = snapshot.moment
        self._set_time(moment.time_ns, moment.decision.sequence)
        if len(self._shown) <= moment.decision.sequence:
            self._show_decision(moment)
            self._show_tracks(moment)
            self._show_movers(moment.truth)
            for name, value in curves(moment, self._axes).items():
                self._log(f"plots/{name}", rr.Scalars(value))
            self._show_events(moment)
            self._shown.append((moment.time_ns, list(moment.truth.position)))
            self._last = moment
        if snapshot.layer is not None:
            self._show_layer(snapshot.layer)
        if snapshot.with_costmap and moment.stack_costmap is not None:
            self._log("world/stack_costmap", _costs(moment.stack_costmap.grid))
        if snapshot.with_hits:
            hits = moment.hits(MOST_HITS).astype(np.float32)
            self._log("world/sweep", rr.Points3D.from_fields(positions=hits))
        for tile in snapshot.tiles:
            self._show_cells(tile)

    def show_way(self, legs: Sequence[Leg]) -> None:
        """Show each leg of a recorded way at the time of its end, and its verdicts on a lane."""
        colours = {name: int(colour[1:] + "ff", 16) for name, colour in COLOURS_OF_WAY.items()}
        show_lanes(self._stream, self._root, {"way": colours})
        for verdict, colour in colours.items():
            style = rr.LineStrips3D.from_fields(radii=WAY_LINE, colors=colour)
            self._stream.log(f"{self._root}/world/way/{verdict}", style, static=True)
        before = ""
        for leg in legs:
            verdict = "admitted" if leg.admitted else leg.why
            if verdict != before:
                self._set_time(leg.begin_ns, leg.sequence)
                self._log("way", rr.StateChange(state=verdict))
                before = verdict
            self._set_time(leg.end_ns, leg.sequence)
            line = leg.poses[:, :3] + np.array([0.0, 0.0, WAY_ABOVE])
            self._log(f"world/way/{verdict}", rr.LineStrips3D.from_fields(strips=[line]))

    def mark_last_chance(self, log: Log) -> None:
        """Mark the last chance, which only a finished log names, of one that was followed."""
        number = Events(log).last_chance
        if 0 <= number < len(self._shown):
            time_ns, place = self._shown[number]
            self._set_time(time_ns, number)
            mark = rr.Points3D.from_fields(positions=[place], labels=[LAST_CHANCE])
            self._log(f"world/events/{name_of(LAST_CHANCE)}", mark)

    def finish(self, log: Log) -> int:
        """Show the outcome at the end, a failure with a mark; return the number of moments."""
        last = self._last
        if last is None:
            return 0
        outcome, reason = log.result["outcome"], log.result.get("reason", "")
        end_ns = round(float(log.result.get("sim_time_s", last.time_ns * 1e-9)) * 1e9)
        self._set_time(max(end_ns, last.time_ns), last.decision.sequence)
        good = outcome in ("success", RECORDED)
        self._log("reasons", rr.TextLog(f"{outcome}: {reason}", level="INFO" if good else "ERROR"))
        if end_ns > last.time_ns:  # otherwise the last action would seem to go on
            for lane in ("action", "label", *(["verdict"] if last.commanded else [])):
                self._log(lane, rr.StateChange(state=""))
        self._log("event", rr.StateChange(state=CONTACT if outcome == "collision" else ""))
        if not good:
            place = list(last.truth.position)
            self._log("world/failure", rr.Points3D([place], radii=0.25, colors=FAILURE))
            self._log("world/failure/words", words_at(place, f"{outcome}: {reason}"))
        return len(self._shown)

    def _set_time(self, time_ns: int, sequence: int) -> None:
        self._stream.set_time("time", duration=np.timedelta64(time_ns, "ns"))
        self._stream.set_time("decision", sequence=sequence)

    def _log(self, entity: str, content: rr.AsComponents) -> None:
        self._stream.log(f"{self._root}/{entity}", content)

    def _line(self, name: str, points: NDArray[np.float64]) -> None:
        """Show a line through points (n, 3), m, in its static style."""
        self._log(f"world/{name}", rr.LineStrips3D.from_fields(strips=[points]))

    def _show_decision(self, moment: Moment) -> None:
        decision, pose = moment.decision, moment.record.inputs.pose
        self._log("world/robot", _transform(pose.position, pose.quaternion))
        global_path, command = path_of(decision.global_path), moment.commanded
        if command is not None:
            global_path = global_path[:0]  # it would be the stack's own, in the colour of ours
            self._line("planned_path", command.planned_path)
            self._line("not_admitted", command.refused)
            self._log("verdict", rr.StateChange(state=command.verdict))
        self._line("global_path", global_path)
        self._line("trajectory", path_of(decision.trajectory.path))
        words = describe(decision, self._cost_range, command, pose, moment.truth)
        self._log("decision", rr.TextDocument(words, media_type="text/markdown"))
        self._log("action", rr.StateChange(state=decision.action))
        self._log("label", rr.StateChange(state=decision.label))
        level = "WARN" if is_warning(decision) else "INFO"
        self._log("reasons", rr.TextLog(f"{decision.action}: {decision.reason}", level=level))

    def _show_tracks(self, moment: Moment) -> None:
        """Show the true pose, the true and the believed track, and the error between them."""
        truth = moment.truth
        self._log("world/truth", _transform(truth.position, truth.quaternion))
        both = np.array([truth.position, moment.record.inputs.pose.position])
        self._line("pose_error", both)
        if self._last is not None and self._with_trail:
            last = self._last
            before = np.array([last.truth.position, last.record.inputs.pose.position])
            # One piece per time; the layout shows all up to now.
            self._line("trail", np.array([before[0], both[0]]))
            self._line("believed_trail", np.array([before[1], both[1]]))

    def _show_movers(self, truth: pb.Truth) -> None:
        if not truth.movers:
            return
        present = [mover for mover in truth.movers if mover.present]
        places = np.array([mover.position for mover in present]).reshape(-1, 3)
        names = [mover.name for mover in present]
        self._log("world/movers", rr.Points3D.from_fields(positions=places, labels=names))
        for mover in truth.movers:
            if mover.name in self._movers:
                scale = 1.0 if mover.present else 0.0
                pose = _transform(mover.position, mover.quaternion, scale)
                self._log(f"world/scene/movers/{mover.name}", pose)

    def _show_events(self, moment: Moment) -> None:
        """Mark the events of a decision in space, on their lane, in the text and on a curve."""
        truth = moment.truth
        found = list(self._events.at(moment.decision, truth))
        for event in found:
            name, place = name_of(event.kind), [truth.position]
            mark = rr.Points3D.from_fields(positions=place, labels=[event.mark])
            self._log(f"world/events/{name}", mark)
            self._log("reasons", rr.TextLog(f"{event.kind}: {event.words}", level="WARN"))
            plot = PLOTS[event.kind]
            value = truth.clearance_m if plot == "clearance" else moment.decision.delay_s * 1e3
            if not math.isnan(value):
                self._log(f"plots/{plot}/{name}", rr.Scalars(value))
        if found or self._marked:
            self._log("event", rr.StateChange(state=found[-1].kind if found else ""))
        self._marked = bool(found)

    def _show_layer(self, layer: Layer) -> None:
        """Show a layer if it differs from the last one, and its evidence if it has any."""
        if layer.evidence is not None:
            for name, image in layer.evidence.images().items():
                self._log(f"world/{name}", _grid(image, layer.corner, layer.resolution))
        if self._layer is None or not np.array_equal(self._layer, layer.kinds):
            self._layer = layer.kinds
            self._log("world/layer", _grid(_CODES[layer.kinds.T], layer.corner, layer.resolution))

    def _show_cells(self, tile: Tile) -> None:
        """Show the occupied cells of a tile, in colours by height."""
        centres = self._tiles.centres(tile).astype(np.float32)
        shade = (50 + 170 * np.clip(centres[:, 2] / self._top, 0.0, 1.0)).astype(np.uint32)
        colours = (shade // 2) << 24 | shade << 16 | (255 - shade // 2) << 8 | 255
        cells = rr.Points3D.from_fields(positions=centres, colors=colours, radii=self._half)
        self._log(f"world/occupied/{tile.name}", cells)


def _costs(grid: Grid) -> rr.GridMap:
    """Return a stack's own costmap."""
    cells = _COSTS[np.ascontiguousarray(grid.cells).view(np.uint8)]
    return _grid(cells, grid.origin, grid.resolution)


def _grid(image: NDArray[np.uint8], corner: NDArray[np.float64], side: float) -> rr.GridMap:
    """Return cells, least y first, on the floor: (ny, nx) of RViz's map colours, or (ny, nx, 3)."""
    height, width = image.shape[:2]
    flat = image.ndim == 2
    return rr.GridMap(
        data=np.ascontiguousarray(image[::-1]).tobytes(),
        format=rr.components.ImageFormat(
            width=width,
            height=height,
            color_model="L" if flat else "RGB",
            channel_datatype="U8",
        ),
        cell_size=side,
        translation=[*corner.tolist(), 0.0],
        colormap=rr.components.Colormap.RvizMap if flat else None,
        opacity=0.9 if flat else None,
    )


def _transform(
    position: Iterable[float], quaternion: Iterable[float], scale: float = 1.0
) -> rr.Transform3D:
    w, x, y, z = quaternion
    turn = rr.Quaternion(xyzw=[x, y, z, w])
    return rr.Transform3D(translation=list(position), quaternion=turn, scale=scale)
