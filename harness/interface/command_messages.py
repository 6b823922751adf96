"""Commands of the stack interface, to and from protobuf, with every value checked."""

from __future__ import annotations

from dataclasses import asdict
from typing import get_args

import numpy as np

from wayproof.harness.decision import Action, Label
from wayproof.harness.errors import printable
from wayproof.harness.interface.message_values import values_for, values_of
from wayproof.harness.interface.motion_checks import MAX_DISTANCE_M
from wayproof.harness.interface.types import (
    Array,
    Command,
    Grid,
    Motion,
    Samples,
    Velocity,
    Waypoints,
)
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.planners import Trajectory
from wayproof.planners.jerk_limited import Profile

MAX_TEXT = 400
"""Most characters of a text of a command that the log keeps."""

MAX_SCALARS = 64
"""Most named numbers of a command."""

MAX_PATH = 20_000
"""Most points of a planned path."""

MAX_CELLS = 4_000_000
"""Most cells of a costmap."""

ACTIONS = ("", *get_args(Action))
LABELS = ("", *get_args(Label))


class CommandError(ValueError):
    """Invalid command, in one line: what was got and expected."""


def command_message(command: Command, sequence: int) -> sb.Command:
    """Return a command as it is sent and logged.

    Raises:
        CommandError: It is not what the interface expects.
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
        message.scalars[_line("scalars", name)] = _number(f"scalars[{name!r}]", value)
    if command.costmap is not None:
        message.costmap.CopyFrom(_grid_message(command.costmap))
    check_command(message)
    return message


def check_command(message: sb.Command) -> None:
    """Refuse an invalid command of another process.

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
    if not all(abs(number) <= MAX_DISTANCE_M for number in message.planned_path):  # nor NaN
        raise CommandError(f"planned_path: expected finite coordinates within {MAX_DISTANCE_M:g} m")
    if len(message.scalars) > MAX_SCALARS:
        raise CommandError(f"scalars: got {len(message.scalars)}, expected at most {MAX_SCALARS}")
    for name in message.scalars:
        _line("scalars", name)
    if message.HasField("costmap"):
        _check_costmap(message.costmap)


def motion_of(message: sb.Command) -> Motion | None:
    """Return the motion of a logged command.

    Raises:
        CommandError: Its numbers do not fit together.
    """
    kind = message.WhichOneof("motion")
    if kind is None:
        return None
    if kind == "velocity":
        return Velocity(**values_of(message.velocity, Velocity))
    if kind == "waypoints":
        points = _points("waypoints.points", message.waypoints.points)
        return Waypoints(points, message.waypoints.speed)
    if kind == "sampled":
        positions = _points("sampled.positions", message.sampled.positions)
        return Samples(message.sampled.period_s, positions, np.array(message.sampled.headings))
    exact = message.profiled
    return Trajectory(
        exact.start_ns,
        path=_points("profiled.path", exact.path),
        motion=_profile(exact.motion),
        turning=_profile(exact.turning),
        overshoot_m=exact.overshoot_m,
    )


def planned_path_of(message: sb.Command) -> Array | None:
    """Return the stack's own plan (k, 3), m; None if it gave none."""
    return np.array(message.planned_path).reshape(-1, 3) if message.planned_path else None


def costmap_of(message: sb.Command) -> Grid | None:
    """Return the stack's own costmap; None if it gave none."""
    if not message.HasField("costmap"):
        return None
    grid = message.costmap
    cells = np.frombuffer(grid.cells, np.int8).reshape(grid.height, grid.width)
    return Grid(np.array([grid.x, grid.y]), grid.resolution, cells)


def _grid_message(grid: Grid) -> sb.Grid:
    cells = np.asarray(grid.cells)
    if cells.ndim != 2 or cells.dtype != np.int8:
        raise CommandError(
            f"costmap: got cells of shape {cells.shape}, {cells.dtype}, expected (ny, nx) int8"
        )
    origin = _flat("costmap.origin", grid.origin, 1)
    if len(origin) != 2:
        raise CommandError(f"costmap.origin: got {len(origin)} numbers, expected 2")
    x, y = origin
    height, width = cells.shape
    return sb.Grid(
        x=x,
        y=y,
        resolution=_number("costmap.resolution", grid.resolution),
        width=width,
        height=height,
        cells=cells.tobytes(),
    )


def _check_costmap(grid: sb.Grid) -> None:
    if grid.width * grid.height != len(grid.cells) or len(grid.cells) > MAX_CELLS:
        raise CommandError(
            f"costmap: got {len(grid.cells)} cells for {grid.width} x {grid.height}, expected one "
            f"each, at most {MAX_CELLS}"
        )
    near = all(abs(number) <= MAX_DISTANCE_M for number in (grid.x, grid.y))  # nor NaN
    if not (near and 0.0 < grid.resolution <= MAX_DISTANCE_M):
        raise CommandError(
            f"costmap: expected an origin within {MAX_DISTANCE_M:g} m and a resolution above 0 m"
        )


def _put_motion(message: sb.Command, motion: Motion) -> None:
    if isinstance(motion, Velocity):
        values = {
            name: _number(f"velocity.{name}", value) for name, value in asdict(motion).items()
        }
        message.velocity.CopyFrom(sb.Velocity(**values))
    elif isinstance(motion, Waypoints):
        points = _flat("waypoints.points", motion.points, 3)
        message.waypoints.CopyFrom(
            sb.Waypoints(points=points, speed=_number("waypoints.speed", motion.speed))
        )
    elif isinstance(motion, Samples):
        message.sampled.CopyFrom(
            sb.SampledTrajectory(
                period_s=_number("samples.period_s", motion.period_s),
                positions=_flat("samples.positions", motion.positions, 3),
                headings=_flat("samples.headings", motion.headings, 1),
            )
        )
    elif isinstance(motion, Trajectory):
        message.profiled.CopyFrom(
            sb.ProfiledTrajectory(
                start_ns=motion.start_ns,
                path=_flat("trajectory.path", motion.path, 3),
                motion=sb.Profile(**values_for(sb.Profile, motion.motion)),
                turning=sb.Profile(**values_for(sb.Profile, motion.turning)),
                overshoot_m=motion.overshoot_m,
            )
        )
    else:
        got = type(motion).__name__
        raise CommandError(
            f"motion: got {got}, expected Velocity, Waypoints, Samples, Trajectory or None"
        )


def _profile(message: sb.Profile) -> Profile:
    states = np.array(message.states)
    if len(states) % 3:
        raise CommandError(f"profile: got {len(states)} numbers of states, expected 3 each")
    return Profile(
        np.array(message.times),
        states=states.reshape(-1, 3),
        jerks=np.array(message.jerks),
        duration=message.duration,
        end=message.end,
    )


def _number(name: str, value: object) -> float:
    """Return a value that is one number.

    Raises:
        CommandError: It is none, as an array of one element is not.
    """
    if isinstance(value, np.ndarray) and value.ndim > 0:
        raise CommandError(f"{name}: got an array of shape {value.shape}, expected a number")
    try:
        return float(value)  # type: ignore[arg-type]  # whatever a stack gave
    except (TypeError, ValueError, OverflowError):
        raise CommandError(f"{name}: got {type(value).__name__}, expected a number") from None


def _flat(name: str, values: object, width: int) -> list[float]:
    """Return rows of numbers as one list.

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
