"""Command of a stack on trial in one decision, with its planned path, for cards and pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.decision import path_of
from wayproof.harness.errors import InputError, printable
from wayproof.harness.interface.command_messages import (
    CommandError,
    check_command,
    costmap_of,
    motion_of,
    planned_path_of,
)
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.motion_checks import MotionError
from wayproof.harness.interface.types import Grid, Reference
from wayproof.harness.log.paths import arc_lengths, densely
from wayproof.harness.mission import Mission
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.planner_input import motion_limits

Array = NDArray[np.float64]

SPACING = 0.02
"""Distance between points of a path that is divided, m."""


class Commanded(NamedTuple):
    """The command of one decision.

    Attributes:
        message: The command as it was sent.
        verdict: Verdict of the referee: `admitted`, `unknown` or `blocked`.
        cut: Whether the guard braked in the stack's place.
        admitted: (m, 3) its path up to the first overlap, m, world; all of an admitted command.
        refused: (k, 3) its path from there to its rest; empty of an admitted command.
        planned_path: (n, 3) the stack's own plan, m, world; empty if it gave none.
        costmap: The stack's own costmap; None if it gave none with this command.
    """

    message: sb.Command
    verdict: str
    cut: bool
    admitted: Array
    refused: Array
    planned_path: Array
    costmap: Grid | None


def commanded(
    answer: pb.StackCommand | None,
    decision: pb.Decision,
    followed: pb.Trajectory | None,
    config: Config,
    mission: Mission,
) -> Commanded | None:
    """Return the command that a decision was made with; None of the built-in stack.

    The path of a command that the guard cut is not in the log. It is worked out from the logged
    samples of the trajectory before, to some centimetres.

    Args:
        answer: Logged answer of the stack.
        decision: Logged decision.
        followed: Trajectory that the robot follows when the decision takes effect; None at rest.
        config: Settings of the decision.
        mission: Mission of the decision.

    Raises:
        InputError: The answer is no command.
    """
    if answer is None:
        return None
    try:
        message = sb.Command.FromString(answer.command)
        check_command(message)
        path = path_of(decision.trajectory.path)
        if decision.verdict.cut:
            path = _path_of_motion(message, decision, followed, config, mission)
        planned = planned_path_of(message)
    except (DecodeError, CommandError, MotionError):
        raise InputError(f"decision {answer.sequence}: its answer is no command") from None
    verdict = decision.verdict
    length = np.inf if verdict.verdict == "admitted" else verdict.free_m
    admitted, refused = _divided(path, length)
    return Commanded(
        message=message,
        verdict=verdict.verdict,
        cut=verdict.cut,
        admitted=admitted,
        refused=refused,
        planned_path=np.zeros((0, 3)) if planned is None else planned,
        costmap=costmap_of(message),
    )


def _path_of_motion(
    message: sb.Command,
    decision: pb.Decision,
    followed: pb.Trajectory | None,
    config: Config,
    mission: Mission,
) -> Array:
    """Return the path (n, 3) of a command's motion, m; its start alone without a motion."""
    effect_ns = decision.timestamp.ToNanoseconds() + config.latency.expected_ns
    reference, acceleration = _reference(decision, followed, effect_ns, mission)
    motion = motion_of(message)
    if motion is None:
        return reference.position[None]
    believed = replace(reference, position=np.array(decision.position))
    return trajectory_of(
        motion,
        (reference, believed),
        effect_ns,
        motion_limits(config, mission),
        planar=mission.planar,
        acceleration=acceleration,
        sideways_speed=mission.sideways_speed,
    ).trajectory.path


def _reference(
    decision: pb.Decision, followed: pb.Trajectory | None, effect_ns: int, mission: Mission
) -> tuple[Reference, float]:
    """Return the commanded state at the time of effect, and the acceleration along the path, m/s^2.

    From samples of the trajectory before.
    """
    if followed is None:
        start = np.array(decision.position)
        return Reference(start, np.zeros(3), mission.start_heading, 0.0, at_rest=True), 0.0
    period = followed.sample_period_s
    elapsed = (effect_ns - followed.start.ToNanoseconds()) * 1e-9
    along, speed, acceleration = _value_and_rates(np.array(followed.arc_length), period, elapsed)
    heading, yaw_rate, _ = _value_and_rates(np.array(followed.heading), period, elapsed)
    path = path_of(followed.path)
    lengths = arc_lengths(path)
    here, ahead = (
        np.array([np.interp(arc, lengths, path[:, axis]) for axis in range(3)])
        for arc in (along, along + SPACING)
    )
    size = float(np.linalg.norm(ahead - here))
    velocity = (ahead - here) * (max(speed, 0.0) / size) if size > 0.0 else np.zeros(3)
    reference = Reference(here, velocity, heading, yaw_rate, at_rest=not velocity.any())
    return reference, acceleration


def _value_and_rates(samples: Array, period: float, elapsed: float) -> tuple[float, float, float]:
    """Return the value of even samples (n,) at a time, s, and its first and second derivative.

    At rest after the last sample.
    """
    times = np.arange(len(samples)) * period
    value = float(np.interp(elapsed, times, samples))
    if len(samples) < 3 or elapsed >= times[-1]:
        return value, 0.0, 0.0
    rates = np.gradient(samples, period, edge_order=2)  # exact at an even acceleration
    changes = np.gradient(rates, period, edge_order=2)
    rate, change = (float(np.interp(elapsed, times, one)) for one in (rates, changes))
    return value, rate, change


def _divided(path: Array, length: float) -> tuple[Array, Array]:
    """Return a path (n, 3) up to a length, m, and its rest; the rest is empty at its end."""
    if length >= float(arc_lengths(path)[-1]):
        return path, path[:0]
    points = densely(path, SPACING)
    count = int(np.searchsorted(arc_lengths(points), length)) + 1
    return points[:count], points[count - 1 :]


def command_in_words(command: sb.Command) -> str:
    """Return the motion, the reason and the scalars of a stack's command in one line."""
    parts = [command.WhichOneof("motion") or "no motion"]
    if command.WhichOneof("motion") == "velocity":
        one = command.velocity
        parts = [
            f"velocity ({one.forward:.2f}, {one.left:.2f}, {one.up:.2f}) m/s, "
            f"{one.yaw_rate:.2f} rad/s for {one.duration_s:.1f} s"
        ]
    if command.reason:
        parts.append(printable(command.reason)[:200])
    parts += [
        f"{printable(name)[:40]} {command.scalars[name]:g}" for name in sorted(command.scalars)
    ]
    return "; ".join(parts)
