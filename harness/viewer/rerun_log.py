"""One log in Rerun: shapes in space, texts, lanes of states, and curves.

Rerun is large and headless runs do not need it, so `rerun_view.py` imports this late.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.log.follow import FollowedLog
from wayproof.harness.log.reader import Log
from wayproof.harness.result import RECORDED
from wayproof.harness.shadow.legs import Leg
from wayproof.harness.shadow.picture import COLOURS_OF_WAY
from wayproof.harness.viewer import colours, events, scene
from wayproof.harness.viewer.curves import curves, styles
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.snapshots import Snapshot
from wayproof.harness.viewer.words import describe, is_warning

LANES = {
    "action": {
        "follow": 0x2E9E4FFF,
        "slow": 0xE0B000FF,
        "stop_and_wait": 0xD2691EFF,
        "explore": 0x3C6EEBFF,
        "recover": 0x9650C8FF,
        "goal": 0x1E8C8CFF,
        "abort": 0xD22828FF,
    },
    "verdict": {
        "admitted": 0x2E9E4FFF,
        "stale": 0x8A6FD1FF,
        "unknown": 0xE0A000FF,
        "blocked": 0xD22828FF,
    },
    "event": {kind: colours.packed(colour) for kind, colour in events.COLOURS.items()},
}
"""Colours of the states of the lanes."""

WAY_LINE, WAY_ABOVE = rr.Radius.ui_points(2.0), 0.05
"""Radius of the way of a recorded robot, which is seen as a whole, and its height above the body's
origin, m: the layer of the map lies on the floor."""

PIXELS, MARK = rr.Radius.ui_points(1.5), rr.Radius.ui_points(6.0)


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
    shown = _Shown(stream, log, root, with_trail=not legs)
    if legs:
        shown.show_way(legs)
    for snapshot in snapshots:
        shown.show(snapshot)
    if isinstance(log, FollowedLog):
        log = log.finished()
        shown.mark_last_chance(log)
    return shown.finish(log)


class _Shown:
    """What is shown of one log."""

    def __init__(self, stream: rr.RecordingStream, log: Log, root: str, with_trail: bool) -> None:
        self._stream, self._root, self._with_trail = stream, root, with_trail
        self._artist = scene.Artist(log)
        self._top = max(log.mission.high[2], 1.0)
        self._cost_range, self._axes = log.config.costmap.cost_range, log.mission.axes
        self._marked = False  # whether the lane of events shows one
        self._movers: set[str] = set()  # whose surfaces were sent
        self._places: list[tuple[int, list[float]]] = []  # time, ns, and true position
        self._last: Moment | None = None
        self._log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._draw(self._artist.still(), static=True)
        self._show_lanes(LANES)
        for kind, plot in events.PLOTS.items():
            dots = rr.SeriesPoints(colors=events.COLOURS[kind], marker_sizes=4.0, names=kind)
            self._log(f"plots/{plot}/{events.name_of(kind)}", dots, static=True)
        for curve, (name, line) in styles(log.config).items():
            self._log(f"plots/{curve}", rr.SeriesLines(colors=line, names=name), static=True)

    def show(self, snapshot: Snapshot) -> None:
        """Show one moment."""
        moment = snapshot.moment
        self._set_time(moment.time_ns, moment.decision.sequence)
        self._draw(self._artist.shapes(snapshot))
        if len(self._places) > moment.decision.sequence:
            return
        self._show_decision(moment)
        for name, value in curves(moment, self._axes).items():
            self._log(f"plots/{name}", rr.Scalars(value))
        self._show_events(moment)
        if self._last is not None and self._with_trail:
            self._draw(_trails(self._last, moment))
        self._places.append((moment.time_ns, list(moment.truth.position)))
        self._last = moment

    def show_way(self, legs: Sequence[Leg]) -> None:
        """Show each leg of a recorded way at the time of its end, and its verdicts on a lane."""
        way = {name: int(colour[1:] + "ff", 16) for name, colour in COLOURS_OF_WAY.items()}
        self._show_lanes({"way": way})
        before = ""
        for leg in legs:
            verdict = "admitted" if leg.admitted else leg.why
            if verdict != before:
                self._set_time(leg.begin_ns, leg.sequence)
                self._log("way", rr.StateChange(state=verdict))
                before = verdict
            self._set_time(leg.end_ns, leg.sequence)
            line = leg.poses[:, :3] + np.array([0.0, 0.0, WAY_ABOVE])
            strip = rr.LineStrips3D([line], radii=WAY_LINE, colors=way[verdict])
            self._log(f"world/way/{verdict}", strip)

    def mark_last_chance(self, log: Log) -> None:
        """Mark the last chance, which only a finished log names, of one that was followed."""
        number = events.Events(log).last_chance
        if 0 <= number < len(self._places):
            time_ns, place = self._places[number]
            self._set_time(time_ns, number)
            self._draw([self._artist.mark(events.LAST_CHANCE, place, [events.LAST_CHANCE])])

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
        collided = outcome == "collision"
        self._log("event", rr.StateChange(state=events.CONTACT if collided else ""))
        self._draw(self._artist.ending(last, log.result))
        return len(self._places)

    def _set_time(self, time_ns: int, sequence: int) -> None:
        self._stream.set_time("time", duration=np.timedelta64(time_ns, "ns"))
        self._stream.set_time("decision", sequence=sequence)

    def _log(self, entity: str, content: rr.AsComponents, static: bool = False) -> None:
        self._stream.log(f"{self._root}/{entity}", content, static=static)

    def _show_lanes(self, lanes: Mapping[str, Mapping[str, int]]) -> None:
        """Send the colours of the states of lanes."""
        for lane, states in lanes.items():
            # An array: a list of three would be taken for one colour.
            shown = np.array(list(states.values()), np.uint32)
            look = rr.StateConfiguration(values=list(states), colors=shown)
            self._log(lane, look, static=True)

    def _show_decision(self, moment: Moment) -> None:
        decision, pose, command = moment.decision, moment.record.inputs.pose, moment.commanded
        if command is not None:
            self._log("verdict", rr.StateChange(state=command.verdict))
        words = describe(decision, self._cost_range, command, pose, moment.truth)
        self._log("decision", rr.TextDocument(words, media_type="text/markdown"))
        self._log("action", rr.StateChange(state=decision.action))
        self._log("label", rr.StateChange(state=decision.label))
        level = "WARN" if is_warning(decision) else "INFO"
        self._log("reasons", rr.TextLog(f"{decision.action}: {decision.reason}", level=level))

    def _show_events(self, moment: Moment) -> None:
        """Show the events of a decision on their lane, in the text and on a curve."""
        found = self._artist.found
        for event in found:
            self._log("reasons", rr.TextLog(f"{event.kind}: {event.words}", level="WARN"))
            plot = events.PLOTS[event.kind]
            late = moment.decision.delay_s * 1e3
            value = moment.truth.clearance_m if plot == "clearance" else late
            if not math.isnan(value):
                self._log(f"plots/{plot}/{events.name_of(event.kind)}", rr.Scalars(value))
        if found or self._marked:
            self._log("event", rr.StateChange(state=found[-1].kind if found else ""))
        self._marked = bool(found)

    def _draw(self, shapes: Iterable[scene.Named], static: bool = False) -> None:
        for name, shape in shapes:
            entity = f"world/{name}"
            if isinstance(shape, scene.Surface) and shape.pose is not None:
                if name not in self._movers:
                    self._movers.add(name)
                    self._log(entity, _mesh(shape), static=True)
                scale = 1.0 if shape.present else 0.0
                self._log(entity, _transform(shape.pose, scale))
                continue
            self._log(entity, self._content(shape), static)

    def _content(self, shape: scene.Shape) -> rr.AsComponents:
        """Return a shape as Rerun has it."""
        if isinstance(shape, scene.Frame):
            return _transform(shape)
        if isinstance(shape, scene.Line):
            return rr.LineStrips3D([shape.points], radii=0.5 * shape.width, colors=shape.colour)
        if isinstance(shape, scene.Balls):
            radius = 0.5 * shape.diameter or MARK
            return rr.Points3D(
                shape.places, radii=radius, colors=shape.colour, labels=shape.words or None
            )
        if isinstance(shape, scene.Body):
            half = [0.5 * size for size in shape.size]
            fill = rr.components.FillMode.TransparentFillMajorWireframe
            return rr.Ellipsoids3D(half_sizes=[half], colors=shape.colour, fill_mode=fill)
        if isinstance(shape, scene.Cloud):
            radius = 0.5 * shape.diameter or PIXELS
            points = shape.points.astype(np.float32)
            shade = self._by_height(points) if shape.colour is None else shape.colour
            return rr.Points3D.from_fields(positions=points, colors=shade, radii=radius)
        if isinstance(shape, scene.Grid):
            return _grid(shape)
        return _mesh(shape)

    def _by_height(self, points: NDArray[np.float32]) -> NDArray[np.uint32]:
        """Return colours of points by their heights."""
        shade = (50 + 170 * np.clip(points[:, 2] / self._top, 0.0, 1.0)).astype(np.uint32)
        packed: NDArray[np.uint32] = shade // 2 << 24 | shade << 16 | 255 - shade // 2 << 8 | 255
        return packed


def _trails(before: Moment, now: Moment) -> Iterable[scene.Named]:
    """Yield the true and the believed way since the moment before; the layout shows all so far."""
    true = np.array([one.truth.position for one in (before, now)])
    believed = np.array([one.record.inputs.pose.position for one in (before, now)])
    yield "trail", scene.Line(true, scene.WIDTH, colours.TRUE)
    yield "believed_trail", scene.Line(believed, scene.WIDTH, colours.BELIEVED)


def _grid(grid: scene.Grid) -> rr.GridMap:
    height, width, _ = grid.cells.shape
    return rr.GridMap(
        data=np.ascontiguousarray(grid.cells[::-1]).tobytes(),
        format=rr.components.ImageFormat(
            width=width, height=height, color_model="RGB", channel_datatype="U8"
        ),
        cell_size=grid.side,
        translation=[*np.asarray(grid.corner)[:2].tolist(), 0.0],
    )


def _mesh(surface: scene.Surface) -> rr.Mesh3D:
    """Return triangles as a translucent mesh, lit by their own normals."""
    triangles = surface.triangles
    along, across = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(along, across)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3).astype(np.float32),
        vertex_normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        albedo_factor=colours.SURFACES[surface.part],
    )


def _transform(pose: scene.Frame, scale: float = 1.0) -> rr.Transform3D:
    w, x, y, z = pose.quaternion
    turn = rr.Quaternion(xyzw=[x, y, z, w])
    return rr.Transform3D(translation=list(pose.position), quaternion=turn, scale=scale)
