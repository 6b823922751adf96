"""Log as a file for Foxglove: its decisions, and views of them in Foxglove's own messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid as GridMessage
from foxglove_schemas_protobuf.Log_pb2 import Log as Words
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor import Descriptor
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import is_log, origin_of
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import check_folder, file_descriptor_set
from wayproof.harness.outputs import ENDING, written_whole
from wayproof.harness.viewer import scene
from wayproof.harness.viewer.colours import SURFACES, Colour, shares
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.scene import CELLS, EVENTS, FRAMES
from wayproof.harness.viewer.snapshots import snapshots
from wayproof.harness.viewer.words import is_warning

LIBRARY = "wayproof export"
"""Name of the writing program in the head of a file, by which it may be overwritten."""

OPACITY = 230
"""Opacity of grids on the floor, 0 to 255."""

ORIGIN, MARK_M = (0.0, 0.0, 0.0), 0.2
"""The origin, and the size of a mark, m."""

WORLD = "world"
"""Name of the frame that all is in but the bodies."""

Array = NDArray[np.float64]


def write_foxglove(path: Path, out: Path, allow_plugins: bool = False) -> int:
    """Write a log for Foxglove; return the number of decisions.

    Raises:
        InputError: The log cannot be read, or the file cannot be written.
    """
    _refuse_others(out)
    log = open_log(path, allow_plugins)
    check_folder(out.parent)
    last: Moment | None = None
    with written_whole(out, "--foxglove") as partial, partial.open("wb") as file:
        output, artist = _Output(file), scene.Artist(log)
        for snapshot in snapshots(log):
            moment = snapshot.moment
            output.now = moment.decision.timestamp
            if last is None:
                output.show(artist.still())
            if last is None or moment.decision.sequence != last.decision.sequence:
                output.decide(moment)
            output.show(artist.shapes(snapshot))
            last = moment
        if last is not None:
            output.show(artist.ending(last, log.result))
        output.finish()
    return 0 if last is None else last.decision.sequence + 1


def _refuse_others(out: Path) -> None:
    """Refuse the name of a file that was not converted, or of an unfinished log."""
    if out.is_file() and out.stat().st_size and origin_of(out) != (b"", LIBRARY.encode()):
        raise InputError(f"--foxglove '{out}': a file of another kind, expected another name")
    partial = out.with_name(out.name + ENDING)
    if partial.is_file() and is_log(partial):
        raise InputError(f"--foxglove '{out}': '{partial}' is a log, expected another name")


class _Output:
    """An MCAP file with a channel for each topic.

    Attributes:
        now: Time of what is written next.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._writer = Writer(file, compression=CompressionType.ZSTD)
        self._channels: dict[str, int] = {}
        self._count = self._events = 0
        self._cells: dict[str, Array] = {}
        self._writer.start(profile="", library=LIBRARY)
        self.now = Timestamp()

    def decide(self, moment: Moment) -> None:
        """Write the messages of a decision."""
        decision, motion = moment.decision, moment.record.motion
        self._write("/decision", decision)
        self._write("/truth" if motion is None else "/recorded", motion or moment.truth)
        self._write("/latency", moment.record.latency)
        level = Words.WARNING if is_warning(decision) else Words.INFO
        words = f"{decision.action}: {decision.reason}"
        line = Words(timestamp=self.now, level=level, message=words, name=decision.label)
        self._write("/viz/reasons", line)

    def show(self, shapes: Iterable[scene.Named]) -> None:
        """Write shapes, those of one topic in one message."""
        frames, updates = FrameTransforms(), dict[str, SceneUpdate]()
        cells = dict(self._cells)
        for name, shape in shapes:
            if isinstance(shape, scene.Frame):
                pose = _pose(shape.position, shape.quaternion)
                frames.transforms.add(
                    timestamp=self.now, parent_frame_id=WORLD, child_frame_id=name,
                    translation=pose.position, rotation=pose.orientation,
                )  # fmt: skip
            elif isinstance(shape, scene.Grid):
                self._write(f"/viz/{name}", _grid(shape, self.now))
            elif isinstance(shape, scene.Cloud) and name.startswith(CELLS):
                cells[name] = shape.points
            elif isinstance(shape, scene.Cloud):
                self._write(f"/viz/{name}", _cloud(shape.points, self.now))
            else:
                topic = name.partition("/")[0]
                topic = topic if topic in ("scene", "events") else "plan"
                if name.startswith(EVENTS):
                    name = f"event {self._events}"
                    self._events += 1
                update = updates.setdefault(f"/viz/{topic}", SceneUpdate())
                update.entities.append(_entity(name, shape, self.now))
        if frames.transforms:
            self._write("/tf", frames)
        for topic, update in updates.items():
            self._write(topic, update)
        if cells.keys() != self._cells.keys() or any(
            cells[name] is not self._cells[name] for name in cells
        ):
            self._cells = cells
            self._write("/viz/cells", _cloud(np.concatenate(list(cells.values())), self.now))

    def finish(self) -> None:
        self._writer.finish()

    def _write(self, topic: str, message: Message) -> None:
        if topic not in self._channels:
            descriptor: Descriptor = message.DESCRIPTOR  # type: ignore[assignment]
            data = file_descriptor_set(descriptor)
            schema = self._writer.register_schema(descriptor.full_name, "protobuf", data)
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        data, time_ns = message.SerializeToString(deterministic=True), self.now.ToNanoseconds()
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns, self._count)
        self._count += 1


def _entity(name: str, shape: scene.Shape, now: Timestamp) -> SceneEntity:
    """Return a shape as an entity that stays until another of its name comes."""
    before = name.partition("/")[0]
    frame = before if "/" in name and before in FRAMES else WORLD
    entity = SceneEntity(timestamp=now, frame_id=frame, id=name, frame_locked=True)
    if isinstance(shape, scene.Line):
        shade = _colour(shape.colour)
        line = entity.lines.add(pose=_pose(ORIGIN), thickness=shape.width, color=shade)
        line.points.extend(_points(shape.points))
    elif isinstance(shape, scene.Balls):
        shade, size = _colour(shape.colour), shape.diameter or MARK_M
        diameters = Vector3(x=size, y=size, z=size)
        for place in shape.places.tolist():
            entity.spheres.add(pose=_pose(place), size=diameters, color=shade)
        for (x, y, z), text in zip(shape.places.tolist(), shape.words, strict=False):
            above = _pose((x, y, z + size + 0.2))  # facing the camera
            entity.texts.add(pose=above, billboard=True, font_size=0.3, text=text, color=shade)
    elif isinstance(shape, scene.Body):
        x, y, z = shape.size
        diameters, shade = Vector3(x=x, y=y, z=z), _colour(shape.colour, 0.4)
        entity.spheres.add(pose=_pose(ORIGIN), size=diameters, color=shade)
    elif isinstance(shape, scene.Surface) and shape.present:  # else it replaces what was there
        red, green, blue, opacity = SURFACES[shape.part]
        pose = _pose(ORIGIN) if shape.pose is None else _pose(*shape.pose)
        shade = _colour((red, green, blue), opacity / 255.0)
        surface = entity.triangles.add(pose=pose, color=shade)
        surface.points.extend(_points(shape.triangles.reshape(-1, 3)))
    return entity


def _points(points: Array) -> Iterator[Point3]:
    return (Point3(x=x, y=y, z=z) for x, y, z in points.tolist())


def _grid(grid: scene.Grid, now: Timestamp) -> GridMessage:
    rows, columns, _ = grid.cells.shape
    opaque = np.concatenate([grid.cells, np.full((rows, columns, 1), OPACITY, np.uint8)], axis=2)
    x, y = np.asarray(grid.corner)[:2].tolist()
    return GridMessage(
        timestamp=now,
        frame_id=WORLD,
        pose=_pose((x, y, 0.0)),
        column_count=columns,
        cell_size=Vector2(x=grid.side, y=grid.side),
        row_stride=4 * columns,
        cell_stride=4,
        fields=_fields(("red", "green", "blue", "alpha"), PackedElementField.UINT8, 1),
        data=opaque.tobytes(),
    )


def _cloud(points: Array, now: Timestamp) -> PointCloud:
    return PointCloud(
        timestamp=now,
        frame_id=WORLD,
        pose=_pose(ORIGIN),
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


def _colour(colour: Colour, opacity: float = 1.0) -> Color:
    r, g, b = shares(colour)
    return Color(r=r, g=g, b=b, a=opacity)


def _pose(place: Sequence[float], turn: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Pose:
    """Return a pose at a place (3,), m, with a quaternion w x y z."""
    (x, y, z), (w, i, j, k) = place, turn
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
