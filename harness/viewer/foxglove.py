"""Conversion of a log to a file for Foxglove: its decisions, and views of them.

The schemas are those of Foxglove, by name and number; see `harness/schema/foxglove.proto`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from google.protobuf.descriptor import Descriptor
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError
from wayproof.harness.explain.stack_costmap import shades
from wayproof.harness.goals import mission_towards
from wayproof.harness.interface.types import Grid
from wayproof.harness.log.codec.container import is_log, origin_of
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.writer import check_folder, file_descriptor_set
from wayproof.harness.outputs import ENDING, written_whole
from wayproof.harness.schema import foxglove_pb2 as fox
from wayproof.harness.viewer.foxglove_scene import EventMarks, TrueScene, evidence_grids
from wayproof.harness.viewer.foxglove_shapes import (
    BLUE,
    GREEN,
    PINK,
    PURPLE,
    RED,
    ROBOT,
    TRUTH,
    WORLD,
    ball,
    coloured_grid,
    label,
    line_through,
    packed_fields,
    pose_at,
)
from wayproof.harness.viewer.layer import COLOURS, kinds, layer_at
from wayproof.harness.viewer.moments import Moment, moments, standing_low
from wayproof.harness.viewer.tiles import Tiles
from wayproof.harness.viewer.words import is_warning
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

MOST_HITS = 3000
SWEEP_PERIOD_NS = 200_000_000
CELLS_PERIOD_NS = EVIDENCE_PERIOD_NS = 1_000_000_000
"""Most hits drawn and simulated times between two updates, ns, as in the view by Rerun."""

LIBRARY = "wayproof convert"
"""Name of the writing program in the head of a file, by which it may be overwritten."""

EDGE_M = 1.0
"""Width of the unknown space drawn around the map, m."""

OPACITY = 230
"""Opacity of grids on the floor, 0 to 255."""

View = tuple[str, Message]
"""A topic and a message on it."""


def convert(path: Path, out: Path, allow_plugins: bool = False) -> int:
    """Write a log for Foxglove; return the number of decisions.

    Raises:
        InputError: The log cannot be read, or the file cannot be written.
    """
    _refuse_others(out)
    log = open_log(path, allow_plugins)
    check_folder(out.parent)
    count = 0
    with written_whole(out, "--foxglove") as partial:
        with partial.open("wb") as file:
            output = _Output(Writer(file, compression=CompressionType.ZSTD))
            artist = _Artist(log)
            for moment in moments(log):
                for topic, message in (*_logged(moment), *artist.views(moment)):
                    output.write(topic, message, moment.time_ns)
                count += 1
            output.finish()
    return count


def _refuse_others(out: Path) -> None:
    """Refuse the name of a file that was not converted, or of an unfinished log."""
    if out.is_file() and out.stat().st_size and origin_of(out) != (b"", LIBRARY.encode()):
        raise InputError(f"--foxglove '{out}': a file of another kind, expected another name")
    partial = out.with_name(out.name + ENDING)
    if partial.is_file() and is_log(partial):
        raise InputError(f"--foxglove '{out}': '{partial}' is a log, expected another name")


class _Output:
    """An MCAP file with a channel for each topic."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._count = 0
        writer.start(profile="", library=LIBRARY)

    def write(self, topic: str, message: Message, time_ns: int) -> None:
        if topic not in self._channels:
            schema = self._schema(type(message))
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        data = message.SerializeToString(deterministic=True)
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns, self._count)
        self._count += 1

    def finish(self) -> None:
        self._writer.finish()

    def _schema(self, kind: type[Message]) -> int:
        descriptor: Descriptor = kind.DESCRIPTOR  # type: ignore[assignment]
        name = descriptor.full_name
        if name not in self._schemas:
            described = file_descriptor_set(descriptor)
            self._schemas[name] = self._writer.register_schema(name, "protobuf", described)
        return self._schemas[name]


def _logged(moment: Moment) -> Iterator[View]:
    yield "/decision", moment.decision
    motion = moment.record.motion
    yield ("/truth", moment.truth) if motion is None else ("/recorded", motion)
    yield "/latency", moment.record.latency


class _Artist:
    """Views of each moment; unchanged ones are not repeated."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._tiles = Tiles(standing_low(log.mission), log.mission.high, log.config.map.resolution)
        self._cells: dict[str, NDArray[np.float64]] = {}
        self._layer: NDArray[np.uint8] | None = None
        self._scene, self._events = TrueScene(log), EventMarks(log)
        self._swept_ns = self._cells_ns = self._evidence_ns = -(10**12)
        self._last = int(log.result.get("decisions", "0")) - 1

    def views(self, moment: Moment) -> Iterator[View]:
        """Yield the views that change at a moment."""
        now, stamp = moment.time_ns, moment.decision.timestamp
        yield "/tf", _transforms(moment)
        yield "/viz/plan", self._plan(moment)
        for topic, update in (
            ("/viz/scene", self._scene.update(moment.truth, stamp)),
            ("/viz/events", self._events.update(moment)),
        ):
            if update is not None:
                yield topic, update
        yield "/viz/reasons", _reason(moment)
        grid = self._changed_layer(moment)
        if grid is not None:
            yield "/viz/layer", grid
        if now - self._evidence_ns >= EVIDENCE_PERIOD_NS:
            self._evidence_ns = now
            yield from evidence_grids(moment, self._log.mission)
        own = moment.stack_costmap
        if own is not None:
            yield "/viz/stack_costmap", _stack_costmap(own.grid, stamp)
        if now - self._swept_ns >= SWEEP_PERIOD_NS:
            self._swept_ns = now
            yield "/viz/sweep", _cloud(moment.hits(MOST_HITS), stamp)
        if now - self._cells_ns >= CELLS_PERIOD_NS:
            self._cells_ns = now
            tiles = self._tiles.changed(moment.map)
            if tiles:
                self._cells |= {tile.name: self._tiles.centres(tile) for tile in tiles}
                yield "/viz/cells", _cloud(np.concatenate(list(self._cells.values())), stamp)

    def _changed_layer(self, moment: Moment) -> fox.Grid | None:
        costmap = moment.costmap
        layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
        layer_kinds = kinds(costmap, layer, moment.record.decision.collision_distance_sq)
        if self._layer is not None and np.array_equal(layer_kinds, self._layer):
            return None
        self._layer = layer_kinds
        palette = np.zeros((max(COLOURS) + 1, 4), np.uint8)
        for kind, colour in COLOURS.items():
            palette[kind] = (*colour, OPACITY)
        side = costmap.resolution
        edge = round(EDGE_M / side)
        layer_kinds = np.pad(layer_kinds, edge, constant_values=UNKNOWN)
        x, y = (float(value) - edge * side for value in costmap.origin[:2])
        return coloured_grid(palette[layer_kinds.T], x, y, side, moment.decision.timestamp)

    def _plan(self, moment: Moment) -> fox.SceneUpdate:
        decision = moment.decision
        mission = mission_towards(self._log.mission, moment.record.inputs.goal)
        stamp = decision.timestamp
        plan = fox.SceneEntity(timestamp=stamp, frame_id=WORLD, id="plan")
        command = moment.commanded
        if command is None:
            plan.lines.append(line_through(path_of(decision.global_path), 0.04, BLUE))
        else:
            plan.lines.append(line_through(command.planned_path, 0.04, PURPLE))
            plan.lines.append(line_through(command.refused, 0.1, PINK))
        plan.lines.append(line_through(path_of(decision.trajectory.path), 0.08, GREEN))
        plan.spheres.append(ball(mission.goal, 0.25, GREEN, 1.0))
        both = np.array([moment.truth.position, decision.position])
        plan.lines.append(line_through(both, 0.02, RED))  # the error of the pose
        for place, colour in ((decision.position, BLUE), (moment.truth.position, RED)):
            plan.spheres.append(ball(tuple(place), 2.0 * mission.radius, colour, 0.4))
        update = fox.SceneUpdate(entities=[plan])
        outcome = self._log.result["outcome"]
        if decision.sequence == self._last and outcome != "success":
            words = f"{outcome}: {self._log.result.get('reason', '')}"
            update.entities.append(_failure(moment, words))
        return update


def _stack_costmap(grid: Grid, stamp: Timestamp) -> fox.Grid:
    """Return a stack's own costmap as a grid."""
    colours = shades(
        grid.cells, unknown=COLOURS[UNKNOWN], free=COLOURS[FREE], occupied=COLOURS[OCCUPIED]
    )
    opaque = np.full((*grid.cells.shape, 1), OPACITY, np.uint8)
    x, y = grid.origin.tolist()
    return coloured_grid(
        np.concatenate([colours, opaque], axis=2), x, y, side=grid.resolution, stamp=stamp
    )


def _failure(moment: Moment, words: str) -> fox.SceneEntity:
    """Return a mark at the place of a failure, with its reason."""
    stamp, place = moment.decision.timestamp, tuple(moment.truth.position)
    mark = fox.SceneEntity(timestamp=stamp, frame_id=WORLD, id="failure")
    mark.spheres.append(ball(place, 0.5, RED, 1.0))
    mark.texts.append(label(place, words, RED, above=0.6))
    return mark


def _transforms(moment: Moment) -> fox.FrameTransforms:
    believed, truth = moment.decision, moment.truth
    frames = fox.FrameTransforms()
    for name, pose in ((ROBOT, believed), (TRUTH, truth)):
        x, y, z = pose.position
        w, i, j, k = pose.quaternion
        frames.transforms.add(
            timestamp=believed.timestamp,
            parent_frame_id=WORLD,
            child_frame_id=name,
            translation=fox.Vector3(x=x, y=y, z=z),
            rotation=fox.Quaternion(x=i, y=j, z=k, w=w),
        )
    return frames


def _reason(moment: Moment) -> fox.Log:
    decision = moment.decision
    return fox.Log(
        timestamp=decision.timestamp,
        level=fox.Log.WARNING if is_warning(decision) else fox.Log.INFO,
        message=f"{decision.action}: {decision.reason}",
        name=decision.label,
    )


def _cloud(points: NDArray[np.float64], stamp: Timestamp) -> fox.PointCloud:
    return fox.PointCloud(
        timestamp=stamp,
        frame_id=WORLD,
        pose=pose_at(0.0, 0.0, 0.0),
        point_stride=12,
        fields=packed_fields(("x", "y", "z"), fox.PackedElementField.FLOAT32, 4),
        data=points.astype("<f4").tobytes(),
    )
