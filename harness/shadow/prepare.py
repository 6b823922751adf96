"""From a recording and a body to the settings, the mission and the sensors of a log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import HASH_SEPARATOR, Config
from wayproof.harness.config_document import override, with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.mission import Mission
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.prior.sources import with_prior
from wayproof.harness.recording_config import RecordingConfig
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep, Transform
from wayproof.harness.scenario.worlds import bare_world
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.body import Body
from wayproof.harness.shadow.sweeps import SweepWriter, TableWriter, sensor_message, topic_name
from wayproof.harness.shadow.way import Way
from wayproof.maps.kernels.beams import MAX_BEAM_CELLS
from wayproof.models.sensors.beams import LONGEST_LISTED_RANGE

Array = NDArray[np.float64]

FAR = 5e3
"""Coordinate beyond which the first pose becomes the origin of the log's frame, m."""

BELOW, ABOVE = 0.5, 0.5
"""Room of the operating area below the floor and above the body of a ground robot, m."""

AIR_MARGIN = 2.0
"""Room of the operating area above and below the way of a robot that flies, m."""

LEAST_STEP_CELLS = 0.3
"""Least step height, cells: the floor's layer of a map reaches up to a quarter of a cell."""

SCANS = {
    "spacing": 0.05,
    "sweep_noise_share": 0.12,
    "map_error_share": 0.05,
    "motion_share": 0.1,
    "turn_share": 0.2,
    "turn_walk": 0.1,
}
"""Defaults of `estimate` for recordings of planar lasers alone. They see few points, of which one
for each beam is taken, and some 70 lie on lines: the error of a mean is that of one by the root of
their number. The error that a registration leaves is that of a sweep by the root of 20, as a scan
has a twentieth of its points. Wheels predict, which are off as GMapping takes them to be by its
defaults (Grisetti, Stachniss and Burgard 2007, T-RO 23)."""

FIRST_SWEEPS = 50
"""Number of sweeps that are looked at for the rate and the mount of each sensor."""

REMOTE = ("exec", "unix", "tcp")
"""Kinds of stacks in another process."""

NAME = 60
"""Longest part of a recording's name in the name of the world."""


@dataclass(frozen=True)
class Prepared:
    """All that a recording is stepped through with.

    Attributes:
        config: Resolved.
        mission: Mission of the stack.
        infos: Declarations of the sensors.
        writers: Writers of their sweeps, by the name in the recording.
        lift: Height that is added to the mounts of planar lasers, m.
        way: Way of the robot.
        planar: Names in the log of the sensors whose beams lie in one level plane.
        assumes_height: Whether nothing says how high the body is above a floor that its sensors
            see.
    """

    config: Config
    mission: Mission
    infos: tuple[pb.SensorInfo, ...]
    writers: dict[str, SweepWriter | TableWriter]
    lift: float
    way: Way
    planar: frozenset[str] = frozenset()
    assumes_height: bool = False

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
    if stack is not None and stack.partition(":")[0] in REMOTE:
        raise InputError(
            f"--stack {stack}: the interface to other processes has no sweeps that list their "
            "beams, expected a name of 'wayproof list', module:Class or file.py:Class"
        )
    lasers = all(sensor.kind == "laser" for sensor in recording.sensors)
    planar = lasers and body.motion == "ground"
    first = _first_sweeps(recording)
    config = _config(recording, body, settings, seed, planar)
    recorded = config.recording
    assert recorded is not None
    config = with_perturbation(config, perturbation)
    if stack is not None:
        recorded = replace(recorded, goal="end")  # a stack on trial gets one goal, in its task
        trial = replace(config.stack, name=stack)
        config = replace(config, stack=trial, recording=recorded)
    way = Way(_read_part(recording), recorded, flat=planar)
    start_ns = min(sweeps[0].time_ns for sweeps in first.values())
    mission = _mission(way, body, config, start_ns, recording.mission)
    if body.motion == "air" and recording.mission is None:
        config = _within_altitudes(config, mission, settings)
    config = with_prior(config, bare_world(config, mission))
    lift = _lift(config, recorded, first) if planar else 0.0
    infos: list[pb.SensorInfo] = []
    writers: dict[str, SweepWriter | TableWriter] = {}
    for sensor in recording.sensors:
        sweeps = first.get(sensor.name)
        if sweeps is None:
            continue
        writer = _writer(sensor, sweeps, lift, recording, config)
        if any(writer.info.name == other.name for other in infos):
            name = writer.info.name
            raise InputError(f"recording '{recording.name}': two sensors of the name {name}")
        infos.append(writer.info)
        writers[sensor.name] = writer
    named = any(one.partition("=")[0].strip() == "recording.body_height" for one in settings)
    stated = named or recording.body_height is not None or recording.options.mount is not None
    return Prepared(
        config=config,
        mission=mission,
        infos=tuple(infos),
        writers=writers,
        lift=lift,
        way=way,
        planar=frozenset(topic_name(one.name) for one in recording.sensors if one.kind == "laser"),
        assumes_height=body.motion == "ground" and not planar and not stated,
    )


def _writer(
    sensor: RecordedSensor,
    sweeps: list[RecordedSweep],
    lift: float,
    recording: Recording,
    config: Config,
) -> SweepWriter | TableWriter:
    """The writer of a sensor's sweeps: as lists of beams, or by tables if the recording has them.

    Where a mount is given, it is that of the list.
    """
    if sensor.declared is not None and recording.options.mount is None:
        return TableWriter(sensor, sensor.declared)
    mount = lifted(sweeps[0].T_body_sensor, lift)
    longest = min(LONGEST_LISTED_RANGE, (MAX_BEAM_CELLS - 1) * config.map.resolution)
    info = sensor_message(sensor, mount, min(sensor.range_max, longest), _rate(sweeps))
    return SweepWriter(sensor, info, mount)


def _read_part(recording: Recording) -> RecordedTrack:
    """The part of the track that is read, with the pose before it and the one after it."""
    track, begin_s, end_s = recording.track, recording.options.start_s, recording.options.end_s
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
    """A mount at a greater height, m."""
    return Transform(mount.position + np.array([0.0, 0.0, lift]), mount.quaternion)


def _config(
    recording: Recording, body: Body, settings: list[str], seed: int, planar: bool
) -> Config:
    """The settings: a flat grid for planar lasers on the ground, unless the user says otherwise."""
    name = "".join(c if c.isprintable() else "?" for c in recording.name)[:NAME]
    config = Config(
        world=f"{name}{HASH_SEPARATOR}{recording.sha256[:16]}",
        robot=body.identity,
        seed=seed,
        recording=RecordingConfig(
            format=recording.format,
            sha256=recording.sha256,
            options=recording.options.changed(),
        ),
    )
    defaults = ["motion.limits=cautious"]  # `find_body` knows no others
    if planar:
        defaults.append("map.kind=grid2d")
    if recording.mission is not None:  # the episode's own map had only its start declared free
        defaults.append("recording.footprint_clearing=false")
    lasers = all(sensor.kind == "laser" for sensor in recording.sensors)
    if lasers and override(config, settings).estimate.kind == "lidar":
        defaults.extend(f"estimate.{name}={value}" for name, value in SCANS.items())
    if recording.body_height is not None:
        defaults.append(f"recording.body_height={recording.body_height!r}")
    config = override(config, [*defaults, *settings])
    assert config.recording is not None
    if config.estimate.kind == "truth":
        raise InputError(
            "--set estimate.kind=truth: of a simulated episode; expected 'model', which here is "
            "the recorded pose, or 'lidar'"
        )
    if recording.mission is not None:
        return config
    x, y, z = recording.track.positions[0].tolist()
    if max(abs(x), abs(y)) <= FAR:
        x = y = 0.0
    origin = (float(round(x)), float(round(y)), z - config.recording.body_height)
    return replace(config, recording=replace(config.recording, origin=origin))


def _first_sweeps(recording: Recording) -> dict[str, list[RecordedSweep]]:
    """The first sweeps of each sensor."""
    found: dict[str, list[RecordedSweep]] = {}
    for count, sweep in enumerate(recording.sweeps()):
        found.setdefault(sweep.sensor, []).append(sweep)
        enough = len(found) == len(recording.sensors) and all(len(s) > 1 for s in found.values())
        if enough or count >= FIRST_SWEEPS:
            break
    if not found:
        faults = ", ".join(f"{n} {what}" for what, n in recording.faults.items())
        raise InputError(
            f"recording '{recording.name}': no sweep with a pose ({faults or 'no sweep at all'})"
        )
    return found


def _rate(sweeps: list[RecordedSweep]) -> float:
    """Sweeps a second, by the first two; 1 if there is only one."""
    if len(sweeps) < 2 or sweeps[1].time_ns <= sweeps[0].time_ns:
        return 1.0
    return 1e9 / (sweeps[1].time_ns - sweeps[0].time_ns)


def _mission(
    way: Way, body: Body, config: Config, start_ns: int, of_episode: Mission | None
) -> Mission:
    """The mission: area and start are those of the episode that was recorded, if one was."""
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


def _within_altitudes(config: Config, mission: Mission, settings: list[str]) -> Config:
    """The config with the altitudes of the operating area, unless the user gave some."""
    named = {setting.partition("=")[0] for setting in settings}
    own = {"motion.altitude_low": mission.low[2], "motion.altitude_high": mission.high[2]}
    given = [f"{name}={value!r}" for name, value in own.items() if name not in named]
    given.sort(reverse=own["motion.altitude_low"] < config.motion.altitude_high)
    return override(config, given)


def _lift(
    config: Config, recorded: RecordingConfig, first: dict[str, list[RecordedSweep]]
) -> float:
    """Height added to lasers that the recording has on the floor, m; a scan has no height."""
    lowest = min(float(sweeps[0].T_body_sensor.position[2]) for sweeps in first.values())
    if recorded.body_height + lowest > config.map.min_obstacle_height:
        return 0.0
    return recorded.sensor_height - recorded.body_height - lowest


def _triple(point: Array) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
