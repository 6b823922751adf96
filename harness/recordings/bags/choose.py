"""The sensors, the poses and the body of a bag: those that options name, or the only ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.interface.ros2.options import RANGES
from wayproof.harness.recordings.bags.frames import Edge, FramePath, along, namespace_of
from wayproof.harness.recordings.bags.messages import IMAGE, ODOMETRY, Camera, decode
from wayproof.harness.recordings.bags.parts import frame_name
from wayproof.harness.recordings.bags.sensors import Topic
from wayproof.harness.recordings.bags.survey import PoseTopic, SensorTopic, Survey
from wayproof.harness.recordings.bags.vendors import px4
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.transform import OPTICAL, compose
from wayproof.harness.schema import wayproof_pb2 as pb

SILENT, UNSURE, LIMITS = "/no_return", "/no_return_unsure", "/limits"
"""Ends of the topics beside a sensor's points that `wayproof export` writes: the directions of its
beams without return, where these are known to have been free or not, and a Range with its limits.
"""

FOOTPRINT = "base_footprint"
"""Name of the body's projection on the floor, REP 120."""

BODIES = ("base_link", FOOTPRINT)
"""Usual names of the body's frame, REP 105 and REP 120."""

HIGHEST_BODY = 100.0
"""Height above the floor beyond which a projection on it is not believed, m."""

NO_POSES = ("goal", "initialpose", "target", "waypoint")
"""Parts of names of topics with poses that are not the robot's."""


class Motion(NamedTuple):
    """Poses of the body.

    Attributes:
        poses: T_world_body.
        body: Frame of the body; empty if the recording does not name it.
        source: Topic or frames, in words.
        world: Frame in which they are given.
    """

    poses: StampedPoses
    body: str
    source: str
    world: str


def choose_sensors(found: Survey, options: RecordingOptions) -> list[str]:
    """Return the topics of the sensors.

    Raises:
        InputError: None, several and none was chosen, or unknown ones.
    """
    usable = {name: one for name, one in found.sensors.items() if one.first is not None}
    main = {name: one for name, one in usable.items() if not _is_beside(name, found)}
    exact = {name for name in usable if declared(name, found) is not None}
    named = [name if name in usable else f"/{name}" for name in options.sensors]
    if not main:
        others = ", ".join(f"{name} ({type_})" for name, type_ in sorted(found.others.items())[:20])
        raise InputError(
            f"no LaserScan, PointCloud2, depth Image, CustomMsg, VelodyneScan"
            f" or DistanceSensor that can be read (topics: {others or 'none'}){found.lost}"
        )
    for name, given in zip(named, options.sensors, strict=True):
        if name not in main and name not in exact:
            raise unknown_name("sensor of the recording", given, main)
    if named:
        return sorted({measured_topic(name, found) for name in named})
    if len(main) > 1:
        listed = ", ".join(_described(name, one) for name, one in sorted(main.items()))
        raise InputError(f"several sensors, choose: {listed}")
    return [measured_topic(name, found) for name in main]


def _is_beside(name: str, found: Survey) -> bool:
    """Return whether a topic belongs to the sensor of another."""
    if name.endswith(RANGES):
        return name.removesuffix(RANGES) in found.sensors or declared(name, found) is None
    return name.endswith((SILENT, UNSURE))


def declared(name: str, found: Survey) -> pb.SensorInfo | None:
    """Return the declaration of the sensor whose ranges a topic has as they were measured.

    None where the task of no episode was recorded, or names no such sensor.
    """
    topic = found.sensors.get(name)
    if found.task is None or topic is None or topic.first is None or topic.first.type != IMAGE:
        return None
    if not name.endswith(RANGES):
        return None
    sensor = found.task.sensors.get(frame_name(decode(topic.first).header.frame_id))
    if sensor is None or sensor.beams.table.order != "grid":
        return None
    return sensor.info


def order_in_task(name: str, found: Survey) -> int:
    """Return the place of a topic's sensor in the task of an episode; 0 without one."""
    info = declared(name, found)
    return 0 if info is None or found.task is None else list(found.task.sensors).index(info.name)


def measured_topic(name: str, found: Survey) -> str:
    """Return the topic to read of a sensor: that with its ranges as measured, if it can be read."""
    ranges = name + RANGES
    return ranges if declared(ranges, found) is not None else name


def _described(name: str, topic: SensorTopic) -> str:
    assert topic.first is not None
    return f"{name} ({topic.first.type.rsplit('/', 1)[-1]}, {len(topic.series.stamps)})"


def choose_cameras(
    topic: str, found: Survey, options: RecordingOptions
) -> tuple[tuple[int, Camera], ...]:
    """Return the cameras of depth images, from stamps on, ns, in order.

    They are those of the images' namespace, of the only CameraInfo, or of the options.

    Raises:
        InputError: There is none, or there are several.
    """
    if options.intrinsics is not None:
        return ((0, Camera(0, 0, options.intrinsics, False)),)
    beside = topic.rsplit("/", 1)[0] + "/camera_info"
    known = found.cameras.get(beside)
    if known is None and len(found.cameras) == 1:
        known = next(iter(found.cameras.values()))
    if known is not None:
        made = {one: _of_image(topic, one) for _, one in known}
        return tuple(sorted((stamp, made[one]) for stamp, one in known))
    listed = ", ".join(sorted(found.cameras)) or "none"
    raise InputError(
        f"no '{beside}' for '{topic}' (CameraInfo: {listed}), expected intrinsics fx,fy,cx,cy"
    )


def _of_image(topic: str, camera: Camera) -> Camera:
    """Return the camera of an image: a pinhole.

    Raises:
        InputError: The image is not rectified, and the lens has a distortion.
    """
    if "rect" in topic.rsplit("/", 2)[-1] or "rect" in topic.rsplit("/", 2)[-2]:
        return camera._replace(intrinsics=camera.rectified or camera.intrinsics, distorted=False)
    if camera.distorted:
        raise InputError(
            f"the lens of '{topic}' distorts (D of its CameraInfo), expected"
            " rectified images (image_rect), or intrinsics fx,fy,cx,cy to take it for a pinhole"
        )
    return camera


def choose_motion(found: Survey, topics: Sequence[Topic], options: RecordingOptions) -> Motion:
    """Return the poses of the body: from the transforms, else from the only topic of poses.

    Raises:
        InputError: There are none, or several choices.
    """
    frame = topics[0].frame
    if options.pose is not None:
        for name in (options.pose, f"/{options.pose}"):
            if name in found.poses:
                return _from_topic(found, name, frame, options)
        body = _body(found, frame, options)
        if any(edge.parent == options.pose for edge in _moving_chain(found, body)):
            return _from_frames(found, options.pose, body)
        roots = [edge.parent for edge in _moving_chain(found, body)]
        raise unknown_name("poses of the recording", options.pose, [*found.poses, *roots])
    body = _body(found, frame, options)
    chain = _moving_chain(found, body)
    for edge in chain:
        if edge.child in found.tree.rivals:
            listed = ", ".join(f"frame {name}" for name in found.tree.rivals[edge.child])
            raise InputError(f"poses from several sources, choose: {listed}")
    if chain:
        rivals = [name for name, one in found.poses.items() if _is_rival(one, chain)]
        if not rivals:
            return _from_frames(found, chain[0].parent, body)
        listed = ", ".join([f"frame {chain[0].parent}", *(f"topic {name}" for name in rivals)])
        raise InputError(f"poses from several sources, choose: {listed}")
    names = [name for name, one in found.poses.items() if one.type in (ODOMETRY, px4.ODOMETRY)]
    names = names or [name for name, one in found.poses.items() if _may_be_body(name, one)]
    if len(names) == 1:
        return _from_topic(found, names[0], frame, options)
    if names:
        listed = ", ".join(sorted(names))
        raise InputError(f"several topics of poses, choose: {listed}")
    raise InputError(
        f"no poses: no transform moves above '{body}' (frames: "
        f"{found.tree.listed}),"
        f" and there is no Odometry, PoseStamped or VehicleOdometry{found.lost}"
    )


def choose_mount(found: Survey, body: str, topic: Topic, options: RecordingOptions) -> FramePath:
    """Return how a sensor's frame is mounted on the body.

    Raises:
        InputError: No transforms connect them, or the body moves in the sensor's frame, and the
            options give none.
    """
    if (given := options.T_body_sensor) is not None:
        mount = compose(given, OPTICAL) if topic.kind == "depth" else given
        return FramePath((), (Edge(body, topic.frame, mount, None),))
    if _moves_in(found, body, topic.frame):
        raise InputError(
            f"got sweeps in frame '{topic.frame}', in which '{body}' moves,"
            " expected a frame on the body: clouds registered in a world are no sweeps"
        )
    between = found.tree.between(body, topic.frame)
    for edge in () if between is None else (*between.up, *between.down):
        if edge.child in found.tree.rivals:
            raise InputError(
                f"frame '{edge.child}' has several parents:"
                f" {', '.join(found.tree.rivals[edge.child])}, expected a mount"
            )
    if between is None:
        raise InputError(
            f"no transform from '{body}' to '{topic.frame}' (frames: "
            f"{found.tree.listed}),"
            " expected a mount"
        )
    return between


def _moves_in(found: Survey, body: str, frame: str) -> bool:
    """Return whether a body moves in a frame: by the transforms, or by a topic of poses."""
    if frame in BODIES:  # the footprint of a walking robot moves below its body
        return False
    if any((one.parent, one.child) == (frame, body) for one in found.poses.values()):
        return True
    between = found.tree.between(body, frame)
    if between is None or between.down:
        return False
    return any(edge.moving is not None for edge in between.up)


def body_height(found: Survey, body: str, stamp_ns: int) -> float | None:
    """Return the height of the body above its projection on the floor at a stamp, m.

    None without a projection, or where it is not known at that time or lies beyond belief.
    """
    below = found.tree.between(body, FOOTPRINT)
    if below is None:
        return None
    transform, known = below.at(np.array([stamp_ns]))
    offset = transform.position[0].tolist()
    height = -math.copysign(math.hypot(*offset), offset[2])  # the body may be tilted
    return height if known[0] and abs(height) <= HIGHEST_BODY else None


def _body(found: Survey, frame: str, options: RecordingOptions) -> str:
    """Return the body above a sensor's frame: `base_link`, or the first frame that moves."""
    if options.body is not None:
        return options.body
    chain = found.tree.chain(frame)
    names = {edge.child for edge in chain} | {edge.parent for edge in chain}
    for usual in BODIES:
        if usual in names:
            return usual
    if not chain:  # the sensor's own transform is missing; a body may be known
        for usual in BODIES:
            if usual in found.tree.frames:
                return usual
    moving = [edge.child for edge in chain if edge.moving is not None]
    if moving:
        return moving[-1]
    return chain[0].parent if chain else frame


def _moving_chain(found: Survey, body: str) -> list[Edge]:
    """Return the transforms from the root down to the body; none if nothing moves in them."""
    chain = found.tree.chain(body)
    return chain if any(edge.moving is not None for edge in chain) else []


def _may_be_body(name: str, topic: PoseTopic) -> bool:
    return topic.type != px4.ATTITUDE and not any(no in name for no in NO_POSES)


def _is_rival(topic: PoseTopic, chain: list[Edge]) -> bool:
    """Return whether an Odometry is of other frames than the transforms."""
    if topic.type != ODOMETRY:
        return False
    names = [chain[0].parent, *(edge.child for edge in chain)]
    return topic.parent not in names or topic.child not in names


def _from_topic(found: Survey, name: str, frame: str, options: RecordingOptions) -> Motion:
    topic = found.poses[name]
    body = options.body or topic.child or _body(found, frame, options)
    poses, source = topic.series.poses, f"topic {name}, body '{body}'"
    if topic.type == px4.LOCAL:  # has no roll and pitch
        beside = [
            (one, turns)
            for one, turns in found.poses.items()
            if turns.type == px4.ATTITUDE and namespace_of(one) == namespace_of(name)
        ]
        if len(beside) != 1:
            source += ", taken to be level: no VehicleAttitude beside it"
            return Motion(poses, body, source, topic.parent)
        poses = px4.turned(poses, beside[0][1].series.poses)
        source += f", turned as {beside[0][0]}"
    return Motion(poses, body, source, topic.parent)


def _from_frames(found: Survey, root: str, body: str) -> Motion:
    """Compose the transforms from a root to the body, at the stamps of the most frequent one."""
    chain = found.tree.chain(body)
    while chain and chain[0].parent != root:
        chain = chain[1:]
    moving = [edge.moving.times_ns for edge in chain if edge.moving is not None]
    stamps = max(moving, key=len, default=np.empty(0, np.int64))
    whole, known = along(chain, stamps)
    poses = StampedPoses(stamps, whole.position, whole.quaternion).at(known)
    return Motion(poses, body, f"frames {root} -> {body}", root)
