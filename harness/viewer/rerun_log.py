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

from wayproof.harness.decision import path_of
from wayproof.harness.explain.commanded import Commanded
from wayproof.harness.log.follow import FollowedLog
from wayproof.harness.log.reader import Log
from wayproof.harness.result import RECORDED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.legs import Leg
from wayproof.harness.viewer.curves import curves
from wayproof.harness.viewer.events import CONTACT, LAST_CHANCE, PLOTS, Events, name_of
from wayproof.harness.viewer.evidence import age_pixels, probability_pixels
from wayproof.harness.viewer.recorded_way import show_way
from wayproof.harness.viewer.rerun_grids import coloured_grid, costmap_grid, grid_map, layer_image
from wayproof.harness.viewer.rerun_static import FAILURE, show_static, words_at
from wayproof.harness.viewer.rows import AT_A_TIME, LIVE_AT_A_TIME, Rows
from wayproof.harness.viewer.snapshots import Layer, Snapshot, tiles_of
from wayproof.harness.viewer.tiles import Tile
from wayproof.harness.viewer.words import describe, is_warning


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
    movers = show_static(stream, log, root)
    if legs:
        show_way(stream, legs, root)
    artist = _Artist(stream, log, root, movers, with_trail=not legs)
    for snapshot in snapshots:
        artist.show(snapshot)
    if isinstance(log, FollowedLog):
        log = log.finished()
        artist.mark_last_chance(log)
    return artist.finish(log)


class _Artist:
    """Views of each moment; unchanged ones are not repeated."""

    def __init__(
        self,
        stream: rr.RecordingStream,
        log: Log,
        root: str,
        movers: frozenset[str],
        with_trail: bool,
    ) -> None:
        self._stream, self._root, self._movers = stream, root, movers
        self._with_trail = with_trail
        self._rows = Rows(stream, root, LIVE_AT_A_TIME if log.under_way else AT_A_TIME)
        self._tiles = tiles_of(log)
        self._top = max(log.mission.high[2], 1.0)
        self._cost_range = log.config.costmap.cost_range
        self._axes = log.mission.axes
        self._half = np.array([0.5 * log.config.map.resolution], np.float32)
        self._events = Events(log)
        self._marked = False  # whether the lane of events shows one
        self._last: Snapshot | None = None
        self._count = 0
        self._shown: list[tuple[int, list[float]]] = []  # time, ns, and true position
        self._frame: object = None
        self._layer: NDArray[np.uint8] | None = None
        self._places: tuple[list[float], list[float]] | None = None  # true, believed

    def show(self, snapshot: Snapshot) -> None:
        """Show one moment."""
        last, self._last = self._last, snapshot
        if last is None or snapshot.decision.sequence != last.decision.sequence:
            self._show_moment(snapshot)
        if snapshot.layer is not None:
            self._show_layer(snapshot.layer)
        if snapshot.stack_costmap is not None:
            self._log_now("world/stack_costmap", costmap_grid(snapshot.stack_costmap))
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

    def mark_last_chance(self, log: Log) -> None:
        """Mark the last chance, which only a finished log names, of one that was followed."""
        number = Events(log).last_chance
        if not 0 <= number < len(self._shown):
            return
        time_ns, place = self._shown[number]
        self._rows.send()
        self._stream.set_time("time", duration=np.timedelta64(time_ns, "ns"))
        self._stream.set_time("decision", sequence=number)
        mark = rr.Points3D.from_fields(positions=[place], labels=[LAST_CHANCE])
        self._stream.log(f"{self._root}/world/events/{name_of(LAST_CHANCE)}", mark)

    def _show_moment(self, moment: Snapshot) -> None:
        self._count += 1
        self._shown.append((moment.time_ns, list(moment.truth.position)))
        self._rows.begin(moment.time_ns, moment.decision.sequence)
        self._show_decision(moment)
        self._show_tracks(moment)
        self._show_movers(moment.truth)
        for name, value in curves(moment, self._axes).items():
            self._rows.put(f"plots/{name}", rr.Scalars, scalars=value)
        self._show_events(moment)

    def _show_decision(self, moment: Snapshot) -> None:
        decision, pose, rows = moment.decision, moment.pose, self._rows
        rows.put("world/robot", rr.Transform3D, **_transform(pose.position, pose.quaternion))
        global_path, path = path_of(decision.global_path), path_of(decision.trajectory.path)
        if moment.commanded is not None:
            global_path = global_path[:0]  # it would be the stack's own, in the colour of ours
            self._show_command(moment.commanded)
        rows.put("world/global_path", rr.LineStrips3D, strips=global_path)
        rows.put("world/trajectory", rr.LineStrips3D, strips=path)
        words = describe(decision, self._cost_range, moment.commanded, moment.pose, moment.truth)
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

    def _show_tracks(self, moment: Snapshot) -> None:
        """Show the true pose, the true and the believed track, and the error between them."""
        truth, rows = moment.truth, self._rows
        true, believed = list(truth.position), moment.pose.position.tolist()
        rows.put("world/truth", rr.Transform3D, **_transform(true, truth.quaternion))
        if self._places is not None and self._with_trail:
            # One piece per time; the layout shows all up to now.
            for name, before, now in zip(
                ("trail", "believed_trail"), self._places, (true, believed), strict=True
            ):
                rows.put(f"world/{name}", rr.LineStrips3D, strips=np.array([before, now]))
        self._places = true, believed
        rows.put("world/pose_error", rr.LineStrips3D, strips=np.array([true, believed]))

    def _show_movers(self, truth: pb.Truth) -> None:
        if not truth.movers:
            return
        present = [mover for mover in truth.movers if mover.present]
        places = np.array([mover.position for mover in present]).reshape(-1, 3)
        names = [mover.name for mover in present]
        self._rows.put_many("world/movers", rr.Points3D, positions=places, labels=names)
        for mover in truth.movers:
            if mover.name in self._movers:
                pose = _transform(mover.position, mover.quaternion)
                size = [1.0 if mover.present else 0.0] * 3
                self._rows.put(
                    f"world/scene/movers/{mover.name}", rr.Transform3D, **pose, scale=size
                )

    def _show_events(self, moment: Snapshot) -> None:
        """Mark the events of a decision in space, on their lane, in the text and on a curve."""
        rows, truth = self._rows, moment.truth
        found = list(self._events.at(moment.decision, truth))
        for event in found:
            name, place = name_of(event.kind), np.array([truth.position], np.float32)
            rows.put_many(f"world/events/{name}", rr.Points3D, positions=place, labels=[event.mark])
            rows.put("reasons", rr.TextLog, text=f"{event.kind}: {event.words}", level="WARN")
            plot = PLOTS[event.kind]
            value = truth.clearance_m if plot == "clearance" else moment.decision.delay_s * 1e3
            if not math.isnan(value):
                rows.put(f"plots/{plot}/{name}", rr.Scalars, scalars=value)
        if found or self._marked:
            rows.put("event", rr.StateChange, state=found[-1].kind if found else "")
        self._marked = bool(found)

    def _show_layer(self, layer: Layer) -> None:
        """Show a layer if it differs from the last one, and its evidence if it has any."""
        self._show_evidence(layer)
        if self._layer is not None and np.array_equal(self._layer, layer.kinds):
            return
        self._layer = layer.kinds
        self._show_frame(layer)
        self._rows.put("world/layer", rr.GridMap, data=layer_image(layer))

    def _show_evidence(self, layer: Layer) -> None:
        if layer.evidence is None:
            return
        images = {
            "age": age_pixels(layer.evidence.age_s),
            "probability": probability_pixels(layer.evidence.probability),
        }
        for name, image in images.items():
            self._log_now(f"world/{name}", coloured_grid(image, layer))

    def _show_frame(self, layer: Layer) -> None:
        """Show the pose of the layer, once and after a fork that changes it."""
        width, height = layer.kinds.shape
        corner = layer.corner.tolist()
        frame = (width, height, layer.resolution, *corner)
        if frame == self._frame or self._last is None:
            return
        self._frame = frame
        self._log_now("world/layer", grid_map(width, height, layer.resolution, corner))

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
    state = CONTACT if outcome == "collision" else ""
    stream.log(f"{root}/event", rr.StateChange(state=state))
    if good:
        return
    place = list(last.truth.position)
    mark = rr.Points3D([place], radii=0.25, colors=FAILURE)
    stream.log(f"{root}/world/failure", mark)
    stream.log(f"{root}/world/failure/words", words_at(place, f"{outcome}: {reason}"))


def _transform(position: Iterable[float], quaternion: Iterable[float]) -> dict[str, Any]:
    w, x, y, z = quaternion
    return {"translation": list(position), "quaternion": rr.Quaternion(xyzw=[x, y, z, w])}
