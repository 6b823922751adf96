"""Log as a file for Foxglove: its decisions, and views of them in Foxglove's own messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Log_pb2 import Log as Line
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor import Descriptor
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError
from wayproof.harness.goals import mission_towards
from wayproof.harness.log.codec.container import is_log, origin_of
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.writer import check_folder, file_descriptor_set
from wayproof.harness.outputs import ENDING, written_whole
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer import colours
from wayproof.harness.viewer.colours import Colour, shares
from wayproof.harness.viewer.events import COLOURS, STOP, Events
from wayproof.harness.viewer.layer import palette, shades
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.snapshots import MOST_HITS, Layer, Snapshot, snapshots, tiles_of
from wayproof.harness.viewer.true_scene import true_scene
from wayproof.harness.viewer.words import is_warning
from wayproof.maps import UNKNOWN

LIBRARY = "wayproof export"
"""Name of the writing program in the head of a file, by which it may be overwritten."""

EDGE_M = 1.0
"""Width of the unknown space drawn around the map, m."""

OPACITY = 230
"""Opacity of grids on the floor, 0 to 255."""

WORLD = "world"
"""Name of the frame that all is in."""

Array = NDArray[np.float64]
View = tuple[str, Message]
"""A topic and a message on it."""


def write_foxglove(path: Path, out: Path, allow_plugins: bool = False) -> int:
    """Write a log for Foxglove; return the number of decisions.

    Raises:
        InputError: The log cannot be read, or the file cannot be written.
    """
    _refuse_others(out)
    log = open_log(path, allow_plugins)
    check_folder(out.parent)
    count = -1  # the last moment comes twice
    with written_whole(out, "--foxglove") as partial, partial.open("wb") as file:
        output, artist = _Output(file), _Artist(log)
        for snapshot in snapshots(log):
            for topic, message in artist.views(snapshot):
                output.write(topic, message, snapshot.moment.time_ns)
            count += 1
        output.finish()
    return max(count, 0)


def _refuse_others(out: Path) -> None:
    """Refuse the name of a file that was not converted, or of an unfinished log."""
    if out.is_file() and out.stat().st_size and origin_of(out) != (b"", LIBRARY.encode()):
        raise InputError(f"--foxglove '{out}': a file of another kind, expected another name")
    partial = out.with_name(out.name + ENDING)
    if partial.is_file() and is_log(partial):
        raise InputError(f"--foxglove '{out}': '{partial}' is a log, expected another name")


class _Output:
    """An MCAP file with a channel for each topic."""

    def __init__(self, file: IO[bytes]) -> None:
        self._writer = Writer(file, compression=CompressionType.ZSTD)
        self._channels: dict[str, int] = {}
        self._count = 0
        self._writer.start(profile="", library=LIBRARY)

    def write(self, topic: str, message: Message, time_ns: int) -> None:
        if topic not in self._channels:
            descriptor: Descriptor = message.DESCRIPTOR  # type: ignore[assignment]
            data = file_descriptor_set(descriptor)
            schema = self._writer.register_schema(descriptor.full_name, "protobuf", data)
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        data = message.SerializeToString(deterministic=True)
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns, self._count)
        self._count += 1

    def finish(self) -> None:
        self._writer.finish()


class _Artist:
    """Views of each moment; unchanged ones are not repeated."""

    def __init__(self, log: Log) -> None:
        self._log, self._tiles = log, tiles_of(log)
        self._cells: dict[str, Array] = {}
        self._layer: NDArray[np.uint8] | None = None
        self._scene = true_scene(log)
        self._events, self._marks = Events(log), 0
        self._last = -1
        self._end = int(log.result.get("decisions", "0")) - 1

    def views(self, snapshot: Snapshot) -> Iterator[View]:
        """Yield the views that change at a moment."""
        moment = snapshot.moment
        stamp = moment.decision.timestamp
        if moment.decision.sequence != self._last:
            yield from self._moment(moment, stamp, first=self._last < 0)
            self._last = moment.decision.sequence
        if snapshot.layer is not None:
            yield from self._grids(snapshot.layer, stamp)
        if snapshot.with_costmap and moment.stack_costmap is not None:
            own = moment.stack_costmap.grid
            yield "/viz/stack_costmap", _grid(shades(own.cells), own.origin, own.resolution, stamp)
        if snapshot.with_hits:
            yield "/viz/sweep", _cloud(moment.hits(MOST_HITS), stamp)
        if snapshot.tiles:
            self._cells |= {tile.name: self._tiles.centres(tile) for tile in snapshot.tiles}
            yield "/viz/cells", _cloud(np.concatenate(list(self._cells.values())), stamp)

    def _moment(self, moment: Moment, stamp: Timestamp, first: bool) -> Iterator[View]:
        decision, motion = moment.decision, moment.record.motion
        yield "/decision", decision
        yield ("/truth", moment.truth) if motion is None else ("/recorded", motion)
        yield "/latency", moment.record.latency
        frames = FrameTransforms()
        for name, body in (("robot", decision), ("truth", moment.truth)):
            pose = _pose(body.position, body.quaternion)
            frames.transforms.add(
                timestamp=stamp, parent_frame_id=WORLD, child_frame_id=name,
                translation=pose.position, rotation=pose.orientation,
            )  # fmt: skip
        yield "/tf", frames
        for topic, entities in (
            ("/viz/plan", self._plan(moment)),
            ("/viz/scene", self._surfaces(moment.truth, first)),
            ("/viz/events", self._event_marks(moment)),
        ):
            if found := list(entities):
                for entity in found:
                    entity.timestamp.CopyFrom(stamp)
                yield topic, SceneUpdate(entities=found)
        level = Line.WARNING if is_warning(decision) else Line.INFO
        words = f"{decision.action}: {decision.reason}"
        yield "/viz/reasons", Line(timestamp=stamp, level=level, message=words, name=decision.label)

    def _grids(self, layer: Layer, stamp: Timestamp) -> Iterator[View]:
        side = layer.resolution
        if self._layer is None or not np.array_equal(layer.kinds, self._layer):
            self._layer = layer.kinds
            edge = round(EDGE_M / side)
            cells = np.pad(layer.kinds, edge, constant_values=UNKNOWN)
            yield "/viz/layer", _grid(palette()[cells.T], layer.corner - edge * side, side, stamp)
        if layer.evidence is not None:
            for name, image in layer.evidence.images().items():
                yield f"/viz/{name}", _grid(image, layer.corner, side, stamp)

    def _plan(self, moment: Moment) -> Iterator[SceneEntity]:
        decision, truth, command = moment.decision, moment.truth, moment.commanded
        mission = mission_towards(self._log.mission, moment.record.inputs.goal)
        plan = SceneEntity(frame_id=WORLD, id="plan")
        if command is None:
            plan.lines.append(_line(path_of(decision.global_path), 0.04, colours.GLOBAL_PATH))
        else:
            plan.lines.append(_line(command.planned_path, 0.04, colours.PLANNED))
            plan.lines.append(_line(command.refused, 0.1, colours.REFUSED))
        plan.lines.append(_line(path_of(decision.trajectory.path), 0.08, colours.COMMITTED))
        error = np.array([truth.position, decision.position])
        plan.lines.append(_line(error, 0.02, colours.TRUE))
        plan.spheres.append(_ball(mission.goal, 0.25, colours.COMMITTED))
        for place, colour in (
            (decision.position, colours.BELIEVED),
            (truth.position, colours.TRUE),
        ):
            plan.spheres.append(_ball(place, 2.0 * mission.radius, colour, opacity=0.4))
        yield plan
        outcome = self._log.result["outcome"]
        if decision.sequence == self._end and outcome != "success":
            words = f"{outcome}: {self._log.result.get('reason', '')}"
            yield _mark("failure", truth.position, 0.5, colours.TRUE, words)

    def _surfaces(self, truth: pb.Truth, first: bool) -> Iterator[SceneEntity]:
        """Yield the static geometry at first, and the movers always."""
        if self._scene is None:
            return
        if first:
            for part, triangles in self._scene.still.items():
                yield _surface(part, triangles, _pose((0.0, 0.0, 0.0)), part)
        for mover in truth.movers:
            triangles = self._scene.movers.get(mover.name, np.empty((0, 3, 3)))
            if not mover.present:
                triangles = triangles[:0]  # replaces what was shown under its name
            pose = _pose(mover.position, mover.quaternion)
            yield _surface(f"mover {mover.name}", triangles, pose, colours.MOVERS)

    def _event_marks(self, moment: Moment) -> Iterator[SceneEntity]:
        """Yield the marks of a decision's events; each stays where it is."""
        for event in self._events.at(moment.decision, moment.truth):
            words = "" if event.kind == STOP else event.mark  # of stops there are many
            colour = COLOURS[event.kind]
            yield _mark(f"event {self._marks}", moment.truth.position, 0.2, colour, words)
            self._marks += 1


def _mark(
    name: str, place: Sequence[float], size: float, colour: Colour, words: str
) -> SceneEntity:
    """Return a ball with words above it that face the camera."""
    mark = SceneEntity(frame_id=WORLD, id=name, spheres=[_ball(place, size, colour)])
    if words:
        x, y, z = place
        above = _pose((x, y, z + size + 0.2))
        shade = _colour(colour, 1.0)
        text = TextPrimitive(pose=above, billboard=True, font_size=0.3, text=words, color=shade)
        mark.texts.append(text)
    return mark


def _surface(name: str, triangles: Array, pose: Pose, part: str) -> SceneEntity:
    """Return triangles (n, 3, 3), m, in the frame of a pose."""
    entity = SceneEntity(frame_id=WORLD, id=name)
    if len(triangles):
        *colour, opacity = colours.SURFACES[part]
        shade = _colour((colour[0], colour[1], colour[2]), opacity / 255.0)
        surface = TriangleListPrimitive(pose=pose, color=shade)
        for x, y, z in triangles.reshape(-1, 3).tolist():
            surface.points.add(x=x, y=y, z=z)
        entity.triangles.append(surface)
    return entity


def _grid(cells: NDArray[np.uint8], corner: Array, side: float, stamp: Timestamp) -> Grid:
    """Return colours (ny, nx, 3) of cells, least y first, as a grid on the floor."""
    rows, columns, _ = cells.shape
    opaque = np.concatenate([cells, np.full((rows, columns, 1), OPACITY, np.uint8)], axis=2)
    x, y = corner.tolist()
    return Grid(
        timestamp=stamp,
        frame_id=WORLD,
        pose=_pose((x, y, 0.0)),
        column_count=columns,
        cell_size=Vector2(x=side, y=side),
        row_stride=4 * columns,
        cell_stride=4,
        fields=_fields(("red", "green", "blue", "alpha"), PackedElementField.UINT8, 1),
        data=opaque.tobytes(),
    )


def _cloud(points: Array, stamp: Timestamp) -> PointCloud:
    return PointCloud(
        timestamp=stamp,
        frame_id=WORLD,
        pose=_pose((0.0, 0.0, 0.0)),
        point_stride=12,
        fields=_fields(("x", "y", "z"), PackedElementField.FLOAT32, 4),
        data=points.astype("<f4").tobytes(),
    )


def _fields(
    names: Sequence[str], kind: PackedElementField.NumericType.ValueType, size: int
) -> list[PackedElementField]:
    """Return fields of one kind, `size` bytes each, that follow one another."""
    return [
        PackedElementField(name=name, offset=size * place, type=kind)
        for place, name in enumerate(names)
    ]


def _line(points: Array, thickness: float, colour: Colour) -> LinePrimitive:
    """Return a line through points (n, 3), m, of a thickness, m."""
    shade = _colour(colour, 1.0)
    line = LinePrimitive(pose=_pose((0.0, 0.0, 0.0)), thickness=thickness, color=shade)
    for x, y, z in points.tolist():
        line.points.add(x=x, y=y, z=z)
    return line


def _ball(
    place: Sequence[float], size: float, colour: Colour, opacity: float = 1.0
) -> SpherePrimitive:
    """Return a ball with a diameter, m, at a place (3,), m."""
    diameters = Vector3(x=size, y=size, z=size)
    return SpherePrimitive(pose=_pose(place), size=diameters, color=_colour(colour, opacity))


def _colour(colour: Colour, opacity: float) -> Color:
    r, g, b = shares(colour)
    return Color(r=r, g=g, b=b, a=opacity)


def _pose(place: Sequence[float], turn: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Pose:
    """Return a pose at a place (3,), m, with a quaternion w x y z."""
    (x, y, z), (w, i, j, k) = place, turn
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
