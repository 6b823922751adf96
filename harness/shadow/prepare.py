"""Settings, mission and sensors of a log, from a recording and a body."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.config_document import with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.mission import Mission
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.recording_config import RecordingConfig
from wayproof.harness.recordings.recording import NO_POSE, Recording
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import OwnMap, RecordedSensor, RecordedSweep
from wayproof.harness.scenario.prior_maps import with_prior
from wayproof.harness.scenario.worlds import bare_world
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.body import Body
from wayproof.harness.shadow.level import level_lasers
from wayproof.harness.shadow.recording_settings import (
    is_planar,
    settings_of,
    with_stack,
    within_altitudes,
)
from wayproof.harness.shadow.sweeps import SweepWriter, TableWriter, sensor_message, topic_name
from wayproof.harness.shadow.way import Way
from wayproof.maps.kernels.beams import MAX_BEAM_CELLS
from wayproof.models.sensors.beams import LONGEST_LISTED_RANGE

Array = NDArray[np.float64]

BELOW, ABOVE = 0.5, 0.5
"""Room of the operating area below the floor and above the body of a ground robot, m."""

AIR_MARGIN = 2.0
"""Room of the operating area above and below the way of a robot that flies, m."""

LEAST_STEP_CELLS = 0.3
"""Least step height, cells: the floor's layer of a map reaches up to a quarter of a cell."""

FIRST_SWEEPS = 50
"""Number of sweeps that are looked at for the rate and the mount of each sensor."""


@dataclass(frozen=True)
class Prepared:
    """All that a recording is stepped through with.

    Attributes:
        config: Resolved.
        mission: Mission of the stack.
        infos: Declarations of the sensors.
        writers: Writers of their sweeps, by the name in the recording.
        lift: Height that is added to the mounts of level lasers, m.
        way: Way of the robot.
        planar: Names in the log of the sensors whose beams lie in one level plane.
        assumes_height: Whether nothing says how high the body is above a floor that its sensors
            see.
        own_maps: Maps of the robot itself, in the log's frame.
    """

    config: Config
    mission: Mission
    infos: tuple[pb.SensorInfo, ...]
    writers: dict[str, SweepWriter | TableWriter]
    lift: float
    way: Way
    planar: frozenset[str] = frozenset()
    assumes_height: bool = False
    own_maps: tuple[OwnMap, ...] = ()

    @property
    def recorded(self) -> RecordingConfig:
        """Settings of the section `recording`."""
        assert self.config.recording is not None
        return self.config.recording


def prepare(
    recording: Recording,
    body: Body,
    settings: Iterable[str] = (),
    *,
    seed: int = 0,
    stack: str | None = None,
    perturbation: AnyPerturbation | None = None,
    prior: str | None = None,
) -> Prepared:
    """Resolve the settings, and declare mission and sensors.

    Args:
        recording: Open.
        body: Body of its robot.
        settings: `section.field=value` of the user.
        seed: Seed of the stack's searches and of a perturbation.
        stack: Stack in place of the built-in one; its goal is the end of the recording.
        perturbation: The one assumption that is off.
        prior: File of a prior map.

    Raises:
        InputError: A setting is refused, or the recording has no sweep.
    """
    settings = list(settings)
    if prior is not None:
        settings.append(f"prior.source={prior}")
    first = _first_sweeps(recording)
    level = level_lasers(recording, first)
    planar = is_planar(recording, level, body)
    config = settings_of(recording, level, body, settings, seed)
    config = with_stack(with_perturbation(config, perturbation), stack)
    recorded = config.recording
    assert recorded is not None
    way = Way(_read_part(recording), recorded, flat=planar)
    start_ns = min(sweeps[0].time_ns for sweeps in first.values())
    mission = _mission(way, body, config, start_ns, of_episode=recording.mission)
    if body.motion == "air" and recording.mission is None:
        config = within_altitudes(config, mission, settings)
    config = with_prior(config, bare_world(config, mission))
    lift = _lift(config, recorded, first) if planar else 0.0
    writers = _writers(recording, first, lift, config)
    return Prepared(
        config=config,
        mission=mission,
        infos=tuple(writer.info for writer in writers.values()),
        writers=writers,
        lift=lift,
        way=way,
        planar=frozenset(map(topic_name, level)),
        assumes_height=not planar and _assumes_height(recording, body, settings),
        own_maps=_own_maps(recording, recorded.origin),
    )


def _assumes_height(recording: Recording, body: Body, settings: Iterable[str]) -> bool:
    """Return whether the height of a ground robot's body above the floor is not given."""
    named = any(one.partition("=")[0].strip() == "recording.body_height" for one in settings)
    stated = named or recording.body_height is not None or bool(recording.options.mount)
    return body.motion == "ground" and not stated


def _writers(
    recording: Recording,
    first: Mapping[str, list[RecordedSweep]],
    lift: float,
    config: Config,
) -> dict[str, SweepWriter | TableWriter]:
    """Return the writers of the sweeps of all sensors that have any, by name in the recording.

    Raises:
        InputError: Two sensors have one name in the log.
    """
    writers: dict[str, SweepWriter | TableWriter] = {}
    names: set[str] = set()
    for sensor in recording.sensors:
        if sensor.name not in first:
            continue
        writer = _writer(
            sensor, sweeps=first[sensor.name], lift=lift, recording=recording, config=config
        )
        if (name := writer.info.name) in names:
            raise InputError(f"recording '{recording.name}': two sensors of the name {name}")
        names.add(name)
        writers[sensor.name] = writer
    return writers


def _writer(
    sensor: RecordedSensor,
    sweeps: list[RecordedSweep],
    lift: float,
    recording: Recording,
    config: Config,
) -> SweepWriter | TableWriter:
    """Make the writer of a sensor's sweeps: lists of beams, or tables if recorded.

    Where a mount is given, it is that of the list.
    """
    if sensor.declared is not None and not recording.options.mount:
        return TableWriter(sensor, sensor.declared)
    mount = lifted(sweeps[0].T_body_sensor, lift)
    longest = min(LONGEST_LISTED_RANGE, (MAX_BEAM_CELLS - 1) * config.map.resolution)
    info = sensor_message(sensor, mount, min(sensor.range_max, longest), _rate(sweeps))
    return SweepWriter(sensor, info, mount)


def _own_maps(recording: Recording, origin: Sequence[float]) -> tuple[OwnMap, ...]:
    """Return the maps of the robot itself, moved to the log's origin."""
    moved = []
    for one in recording.own_maps:
        x, y, heading = one.corner
        moved.append(one._replace(corner=(x - origin[0], y - origin[1], heading)))
    return tuple(moved)


def _read_part(recording: Recording) -> RecordedTrack:
    """Return the part of the track that is read, with the pose before it and the one after it."""
    track, begin_s, end_s = recording.track, recording.options.begin, recording.options.end
    first = int(np.searchsorted(track.times_ns, round(begin_s * 1e9), side="right")) - 1
    last = len(track.times_ns)
    if end_s is not None:
        last = int(np.searchsorted(track.times_ns, round(end_s * 1e9))) + 1
    part = slice(min(max(first, 0), last - 1), last)
    return replace(
        track,
        times_ns=track.times_ns[part],
        positions=track.positions[part],
        quaternions=track.quaternions[part],
    )


def lifted(mount: Transform, lift: float) -> Transform:
    """Return a mount at a greater height, m."""
    return Transform(mount.position + np.array([0.0, 0.0, lift]), mount.quaternion)


def _first_sweeps(recording: Recording) -> dict[str, list[RecordedSweep]]:
    """Return the first sweeps of each sensor."""
    found: dict[str, list[RecordedSweep]] = {}
    for count, sweep in enumerate(recording.sweeps()):
        found.setdefault(sweep.sensor, []).append(sweep)
        enough = len(found) == len(recording.sensors) and all(len(s) > 1 for s in found.values())
        if enough or count >= FIRST_SWEEPS:
            break
    if not found:
        raise InputError(f"recording '{recording.name}': no sweep with a pose ({_why(recording)})")
    return found


def _why(recording: Recording) -> str:
    """Return why no sweep of a recording could be read, in words."""
    met = dict(recording.faults)
    faults = ", ".join(f"{count} {what}" for what, count in met.items())
    if NO_POSE in met:
        seconds = recording.track.times_ns[-1] * 1e-9
        return f"{faults}; poses from {recording.start_ns * 1e-9:.3f} s on, for {seconds:.3f} s"
    chosen = recording.options.begin != 0.0 or recording.options.end is not None
    return faults or ("none between the times chosen" if chosen else "no sweep at all")


def _rate(sweeps: list[RecordedSweep]) -> float:
    """Return the sweeps per second, by the first two; 1 if there is only one."""
    if len(sweeps) < 2 or sweeps[1].time_ns <= sweeps[0].time_ns:
        return 1.0
    return 1e9 / (sweeps[1].time_ns - sweeps[0].time_ns)


def _mission(
    way: Way, body: Body, config: Config, start_ns: int, of_episode: Mission | None
) -> Mission:
    """Return the mission: area and start are those of the episode that was recorded, if one was."""
    assert config.recording is not None
    margin = config.recording.area_margin
    low, high = way.positions.min(axis=0) - margin, way.positions.max(axis=0) + margin
    if body.motion == "ground":
        low[2], high[2] = -BELOW, body.height + ABOVE
    else:
        low[2], high[2] = low[2] + margin - AIR_MARGIN, high[2] - margin + AIR_MARGIN
    first = way.pose(start_ns)
    start, heading = first.position, float(first.row[3])
    if of_episode is not None:
        low, high = np.array(of_episode.low), np.array(of_episode.high)
        start, heading = np.array(of_episode.start), of_episode.start_heading
    try:
        return Mission(
            motion=body.motion,
            radius=body.radius,
            height=body.height,
            step_height=max(body.step_height, LEAST_STEP_CELLS * config.map.resolution),
            max_speed=body.max_speed,
            max_acceleration=body.max_acceleration,
            max_jerk=body.max_jerk,
            max_yaw_rate=body.max_yaw_rate,
            low=_triple(low),
            high=_triple(high),
            start=_triple(start),
            start_heading=heading,
            goal=_triple(way.positions[-1]),
            discs=body.discs,
        )
    except ValueError as error:
        raise InputError(f"recording with robot '{body.identity}': {error}") from None


def _lift(
    config: Config, recorded: RecordingConfig, first: dict[str, list[RecordedSweep]]
) -> float:
    """Return the height added to lasers that the recording has on the floor, m: a scan has none."""
    lowest = min(float(sweeps[0].T_body_sensor.position[2]) for sweeps in first.values())
    if recorded.body_height + lowest > config.map.min_obstacle_height:
        return 0.0
    return recorded.sensor_height - recorded.body_height - lowest


def _triple(point: Array) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
