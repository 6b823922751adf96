"""Messages of the stack interface: to and from the protobuf of `harness/schema/stack.proto`."""

from __future__ import annotations

import math
from typing import get_args

import numpy as np

from wayproof.harness.errors import printable
from wayproof.harness.inputs import SweepInput
from wayproof.harness.interface.types import (
    INTERFACE_VERSION,
    Array,
    Command,
    Fate,
    Motion,
    Observation,
    Reference,
    Samples,
    Sensor,
    Task,
    Velocity,
    Waypoints,
)
from wayproof.harness.mission import Mission
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import Action, Label
from wayproof.models.poses import Trail
from wayproof.planners import Trajectory
from wayproof.planners.jerk_limited import Profile

MAX_TEXT = 400
"""Most characters of a text of a command that the log keeps."""

MAX_SCALARS = 64
"""Most named numbers of a command."""

MAX_PATH = 20_000
"""Most points of a planned path."""

ACTIONS = ("", *get_args(Action))
LABELS = ("", *get_args(Label))


class CommandError(ValueError):
    """A command that is none, in one line: what was got and expected."""


def hello(name: str) -> sb.Hello:
    """The first message of each side."""
    return sb.Hello(version=INTERFACE_VERSION, name=name)


def command_message(command: Command, sequence: int) -> sb.Command:
    """A command as it is sent and logged.

    Raises:
        CommandError: It is not what the interface asks for.
    """
    if not isinstance(command, Command):
        raise CommandError(f"got {type(command).__name__}, expected a Command")
    message = sb.Command(sequence=sequence, map_version=_line("map_version", command.map_version))
    message.action = _one_of("action", command.action, ACTIONS)
    message.label = _one_of("label", command.label, LABELS)
    message.reason = _line("reason", command.reason)
    if command.motion is not None:
        _put_motion(message, command.motion)
    if command.planned_path is not None:
        message.planned_path.extend(_flat("planned_path", command.planned_path, 3))
    for name, value in command.scalars.items():
        message.scalars[_line("scalars", name)] = float(value)
    check_command(message)
    return message


def check_command(message: sb.Command) -> None:
    """Refuse a command of another process that is none.

    Raises:
        CommandError: Naming what is wrong.
    """
    _one_of("action", message.action, ACTIONS)
    _one_of("label", message.label, LABELS)
    for name in ("reason", "map_version"):
        _line(name, getattr(message, name))
    if len(message.planned_path) % 3 or len(message.planned_path) > 3 * MAX_PATH:
        raise CommandError(
            f"planned_path: got {len(message.planned_path)} numbers, expected 3 for each of at "
            f"most {MAX_PATH} points"
        )
    if not all(map(math.isfinite, message.planned_path)):
        raise CommandError("planned_path: expected finite numbers")
    if len(message.scalars) > MAX_SCALARS:
        raise CommandError(f"scalars: got {len(message.scalars)}, expected at most {MAX_SCALARS}")
    for name in message.scalars:
        _line("scalars", name)


def motion_of(message: sb.Command) -> Motion | None:
    """The motion of a logged command.

    Raises:
        CommandError: Its numbers do not fit together.
    """
    kind = message.WhichOneof("motion")
    if kind is None:
        return None
    if kind == "velocity":
        one = message.velocity
        return Velocity(one.forward, one.left, one.up, one.yaw_rate, one.duration_s)
    if kind == "waypoints":
        points = _points("waypoints.points", message.waypoints.points)
        return Waypoints(points, message.waypoints.speed)
    if kind == "sampled":
        positions = _points("sampled.positions", message.sampled.positions)
        return Samples(message.sampled.period_s, positions, np.array(message.sampled.headings))
    exact = message.profiled
    return Trajectory(
        exact.start_ns,
        _points("profiled.path", exact.path),
        _profile(exact.motion),
        _profile(exact.turning),
        exact.overshoot_m,
    )


def planned_path_of(message: sb.Command) -> Array | None:
    """The stack's own plan (k, 3), m; none if it gave none."""
    return np.array(message.planned_path).reshape(-1, 3) if message.planned_path else None


def _put_motion(message: sb.Command, motion: Motion) -> None:
    if isinstance(motion, Velocity):
        message.velocity.CopyFrom(
            sb.Velocity(
                forward=float(motion.forward),
                left=float(motion.left),
                up=float(motion.up),
                yaw_rate=float(motion.yaw_rate),
                duration_s=float(motion.duration_s),
            )
        )
    elif isinstance(motion, Waypoints):
        points = _flat("waypoints.points", motion.points, 3)
        message.waypoints.CopyFrom(sb.Waypoints(points=points, speed=float(motion.speed)))
    elif isinstance(motion, Samples):
        message.sampled.CopyFrom(
            sb.SampledTrajectory(
                period_s=float(motion.period_s),
                positions=_flat("samples.positions", motion.positions, 3),
                headings=_flat("samples.headings", motion.headings, 1),
            )
        )
    elif isinstance(motion, Trajectory):
        message.profiled.CopyFrom(
            sb.ProfiledTrajectory(
                start_ns=motion.start_ns,
                path=_flat("trajectory.path", motion.path, 3),
                motion=_profile_message(motion.motion),
                turning=_profile_message(motion.turning),
                overshoot_m=motion.overshoot_m,
            )
        )
    else:
        got = type(motion).__name__
        raise CommandError(
            f"motion: got {got}, expected Velocity, Waypoints, Samples, Trajectory or None"
        )


def _profile_message(profile: Profile) -> sb.Profile:
    return sb.Profile(
        times=profile.times.tolist(),
        states=profile.states.ravel().tolist(),
        jerks=profile.jerks.tolist(),
        duration=profile.duration,
        end=profile.end,
    )


def _profile(message: sb.Profile) -> Profile:
    states = np.array(message.states)
    if len(states) % 3:
        raise CommandError(f"profile: got {len(states)} numbers of states, expected 3 each")
    return Profile(
        np.array(message.times),
        states.reshape(-1, 3),
        np.array(message.jerks),
        message.duration,
        message.end,
    )


def _flat(name: str, values: object, width: int) -> list[float]:
    """Rows of numbers as one list.

    Raises:
        CommandError: They are none of this width.
    """
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise CommandError(f"{name}: got {type(values).__name__}, expected numbers") from None
    fits = array.ndim == 1 if width == 1 else array.ndim == 2 and array.shape[1] == width
    if not fits:
        expected = "(k,)" if width == 1 else f"(k, {width})"
        raise CommandError(f"{name}: got shape {array.shape}, expected {expected}")
    flat: list[float] = array.ravel().tolist()
    return flat


def _points(name: str, values: object) -> Array:
    flat = np.array(values, np.float64)
    if len(flat) % 3:
        raise CommandError(f"{name}: got {len(flat)} numbers, expected 3 for each point")
    return flat.reshape(-1, 3)


def _one_of(name: str, value: object, available: tuple[str, ...]) -> str:
    if value not in available:
        known = ", ".join(one for one in available if one)
        raise CommandError(f"{name}: got {printable(str(value))[:40]!r}, expected one of {known}")
    return str(value)


def _line(name: str, value: object) -> str:
    text = str(value)
    if not text.isprintable() or len(text) > MAX_TEXT:
        raise CommandError(f"{name}: expected one printable line of at most {MAX_TEXT} characters")
    return text


def task_message(task: Task) -> sb.Task:
    """The task, as another process gets it."""
    mission = task.mission
    message = sb.Task(
        robot=task.robot,
        seed=task.seed,
        motion=mission.motion,
        radius=mission.radius,
        height=mission.height,
        step_height=mission.step_height,
        max_speed=mission.max_speed,
        max_acceleration=mission.max_acceleration,
        max_jerk=mission.max_jerk,
        max_yaw_rate=mission.max_yaw_rate,
        discs=[sb.Disc(offset=offset, radius=radius) for offset, radius in mission.discs],
        low=_vector(mission.low),
        high=_vector(mission.high),
        start=_vector(mission.start),
        start_heading=mission.start_heading,
        goal=_vector(mission.goal),
        goal_tolerance=task.goal_tolerance,
        period_s=task.period_s,
        delay_s=task.delay_s,
        deadline_s=task.deadline_s,
        settings=task.settings,
    )
    for sensor in task.sensors.values():
        info = sensor.info
        message.sensors.add(
            name=info.name,
            kind=info.kind,
            range_m=info.range_m,
            rate_hz=info.rate_hz,
            position_base_sensor=info.position_base_sensor,
            rotation_base_sensor=info.rotation_base_sensor,
            directions=b"" if _varies(sensor) else _directions(sensor, 0),
            beams=info.beams,
            info=info.SerializeToString(deterministic=True),
            measures=info.measures,
        )
    return message


def task_from(message: sb.Task) -> Task:
    """The task, in another process."""
    mission = Mission(
        motion=message.motion,  # type: ignore[arg-type]
        radius=message.radius,
        height=message.height,
        step_height=message.step_height,
        max_speed=message.max_speed,
        max_acceleration=message.max_acceleration,
        max_jerk=message.max_jerk,
        max_yaw_rate=message.max_yaw_rate,
        low=_triple(message.low),
        high=_triple(message.high),
        start=_triple(message.start),
        start_heading=message.start_heading,
        goal=_triple(message.goal),
        discs=tuple((disc.offset, disc.radius) for disc in message.discs),
    )
    sensors = [Sensor(pb.SensorInfo.FromString(sensor.info)) for sensor in message.sensors]
    return Task(
        robot=message.robot,
        seed=message.seed,
        mission=mission,
        goal_tolerance=message.goal_tolerance,
        period_s=message.period_s,
        delay_s=message.delay_s,
        deadline_s=message.deadline_s,
        sensors={sensor.info.name: sensor for sensor in sensors},
        settings=message.settings,
    )


def observation_message(observation: Observation, task: Task) -> sb.Observation:
    """An observation, as another process gets it."""
    reference, last, trail = observation.reference, observation.last, observation.trail
    message = sb.Observation(
        time_ns=observation.time_ns,
        sequence=observation.sequence,
        position=_vector(observation.position),
        quaternion=observation.quaternion.tolist(),
        position_sigma=observation.position_sigma,
        heading_sigma=observation.heading_sigma,
        velocity=_vector(observation.velocity),
        yaw_rate=observation.yaw_rate,
        effect_ns=observation.effect_ns,
        reference_position=_vector(reference.position),
        reference_velocity=_vector(reference.velocity),
        reference_heading=reference.heading,
        reference_yaw_rate=reference.yaw_rate,
        at_rest=reference.at_rest,
    )
    if last is not None:
        message.last.CopyFrom(sb.Fate(sequence=last.sequence, fate=last.fate, verdict=last.verdict))
    if trail is not None:
        message.trail_positions.extend(trail.positions.ravel().tolist())
        message.trail_quaternions.extend(trail.quaternions.ravel().tolist())
        message.trail_period_s = trail.period
    for sweep in observation.sweeps:
        sensor = task.sensors[sweep.sensor]
        message.sweeps.add(
            sensor=sweep.sensor,
            ranges_mm=sweep.ranges_mm.astype("<u2").tobytes(),
            classes=b"" if sweep.classes is None else sweep.classes.tobytes(),
            directions=_directions(sensor, observation.sequence) if _varies(sensor) else b"",
        )
    return message


def sweep_inputs(message: sb.Observation) -> list[SweepInput]:
    """The sweeps of an observation, in another process."""
    return [
        SweepInput(
            sweep.sensor,
            np.frombuffer(sweep.ranges_mm, "<u2").astype(np.uint16),
            np.frombuffer(sweep.classes, np.uint8) if sweep.classes else None,
        )
        for sweep in message.sweeps
    ]


def trail_from(message: sb.Observation) -> Trail | None:
    """Estimated poses while the sweeps were taken, in another process."""
    if not message.trail_period_s:
        return None
    return Trail(
        np.array(message.trail_positions).reshape(-1, 3),
        np.array(message.trail_quaternions).reshape(-1, 4),
        message.trail_period_s,
    )


def reference_from(message: sb.Observation) -> Reference:
    """The commanded state at the time of effect, in another process."""
    return Reference(
        np.array(_triple(message.reference_position)),
        np.array(_triple(message.reference_velocity)),
        message.reference_heading,
        message.reference_yaw_rate,
        message.at_rest,
    )


def fate_from(message: sb.Observation) -> Fate | None:
    """What became of the previous command, in another process."""
    if not message.HasField("last"):
        return None
    last = message.last
    return Fate(last.sequence, last.fate, last.verdict)  # type: ignore[arg-type]


def _varies(sensor: Sensor) -> bool:
    """Whether the beams differ from sweep to sweep."""
    return sensor.beams.table.order == "pairs"


def _directions(sensor: Sensor, sequence: int) -> bytes:
    return sensor.directions(sequence).astype("<f4").tobytes()


def _vector(values: Array | tuple[float, ...]) -> sb.Vector:
    x, y, z = (float(value) for value in values)
    return sb.Vector(x=x, y=y, z=z)


def _triple(message: sb.Vector) -> tuple[float, float, float]:
    return message.x, message.y, message.z
