"""What other settings would have decided on the inputs of a log, decision by decision."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config, override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recompute.side_by_side import SideBySide
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import differences, path_of

Array = NDArray[np.float64]

SAME_PLACE = 0.01
"""Trajectories that stay within this of one another at all times are the same to the robot, m."""

SPACING = 0.1
"""Of the points at which two routes are compared, m."""

SENSED = ("world", "robot", "start", "sensors")
"""Settings that change what is sensed, which a log's inputs cannot answer for."""


@dataclass(frozen=True)
class Answer:
    """One decision in short.

    Attributes:
        action: What the robot does.
        label: What stood in the way.
        reason: Why, in words.
        path_length_m: To the goal, 0 if there is no way.
    """

    action: str
    label: str
    reason: str
    path_length_m: float


@dataclass(frozen=True)
class Change:
    """One decision that the changed settings make otherwise.

    Attributes:
        sequence: Its number.
        time_s: Simulated time.
        recorded: What was decided.
        changed: What is decided now.
        departure_m: How far apart the two committed trajectories are, at most, at equal times.
        route_difference_m: How far the new route to the goal leads from the old one, at most; none
            if there is only one of them.
    """

    sequence: int
    time_s: float
    recorded: Answer
    changed: Answer
    departure_m: float
    route_difference_m: float | None


@dataclass(frozen=True)
class WhatIf:
    """What changed settings decide on a log's inputs.

    Attributes:
        log: The log's path.
        settings: What was changed.
        decisions: In the log.
        faithful: The recorded settings still decide what is recorded, bit by bit.
        changes: The decisions that change, in order.
        actions: How many of them change the action.
        first_action: Number of the first that does, if any.
        wall_time_s: Time that it took.
    """

    log: str
    settings: tuple[str, ...]
    decisions: int
    faithful: bool
    changes: tuple[Change, ...]
    actions: int
    first_action: int | None
    wall_time_s: float


def what_if(path: Path, settings: Sequence[str], allow_plugins: bool = False) -> WhatIf:
    """Decide again with other settings on each decision's recorded inputs and past.

    Args:
        path: The log.
        settings: As `section.field=value`.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No such log or setting, or one that changes what is sensed.
    """
    log = open_log(path, allow_plugins)
    changed = changed_config(log, settings)
    refuse_sensed(log.config, changed, "these need the simulator: --from N forks the episode")
    began = time.perf_counter()
    twin = SideBySide(log, log.config, changed)
    changes = []
    decisions, faithful = 0, True
    for record in log.records():
        recorded, other = twin.step(record)
        faithful = faithful and not differences(record.decision, recorded, log.not_compared)
        change = compare(recorded, other, log.mission.planar)
        if change is not None:
            changes.append(change)
        decisions += 1
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    acts = [one.sequence for one in changes if one.recorded.action != one.changed.action]
    return WhatIf(
        log=str(path),
        settings=tuple(settings),
        decisions=decisions,
        faithful=faithful,
        changes=tuple(changes),
        actions=len(acts),
        first_action=acts[0] if acts else None,
        wall_time_s=time.perf_counter() - began,
    )


def changed_config(log: Log, settings: Sequence[str]) -> Config:
    """A log's config with other settings.

    Raises:
        InputError: Unknown or refused, or the log's settings already changed on the way.
    """
    if log.fork is not None:
        raise InputError(
            f"log '{log.path}': forked at {log.fork.at}, so it has no settings of its own to "
            "change; expected the log forked from, or --from N"
        )
    return override(log.config, settings)


def refuse_sensed(old: Config, new: Config, advice: str, names: Sequence[str] = SENSED) -> None:
    """Refuse changes that the inputs of a log cannot answer for.

    Raises:
        InputError: One of the settings named differs.
    """
    for name in names:
        if getattr(old, name) != getattr(new, name):
            raise InputError(f"--set {name}: changes what is sensed; {advice}")


def compare(old: pb.Decision, new: pb.Decision, flat: bool) -> Change | None:
    """How a decision changes; none if the robot could not tell.

    Args:
        old: As recorded.
        new: By other settings.
        flat: Whether the robot walks, so that heights mean nothing.
    """
    axes = 2 if flat else 3
    departure = _departure(old.trajectory, new.trajectory, axes)
    first, second = path_of(old.global_path)[:, :axes], path_of(new.global_path)[:, :axes]
    route = None if min(len(first), len(second)) == 0 else _route_difference(first, second)
    same_route = len(first) == len(second) == 0 or (route is not None and route <= SAME_PLACE)
    if (old.action, old.label) == (new.action, new.label) and departure <= SAME_PLACE:
        if same_route:
            return None
    return Change(
        sequence=old.sequence,
        time_s=old.timestamp.ToNanoseconds() * 1e-9,
        recorded=_answer(old),
        changed=_answer(new),
        departure_m=departure,
        route_difference_m=route,
    )


def _answer(decision: pb.Decision) -> Answer:
    return Answer(decision.action, decision.label, decision.reason, decision.path_length_m)


def _departure(old: pb.Trajectory, new: pb.Trajectory, axes: int) -> float:
    """Greatest distance between two trajectories at equal times, m."""
    begin = min(old.start.ToNanoseconds(), new.start.ToNanoseconds())
    ends = [one.start.ToNanoseconds() + one.duration_s * 1e9 for one in (old, new)]
    times = np.arange(begin, max(ends) + 1e8, 1e8)
    places = [_places(one, times, axes) for one in (old, new)]
    return float(np.linalg.norm(places[0] - places[1], axis=1).max())


def _places(trajectory: pb.Trajectory, times: Array, axes: int) -> Array:
    """Where a trajectory is at simulated times (n,), ns: (n, axes) m."""
    path = path_of(trajectory.path)[:, :axes]
    samples = np.arange(len(trajectory.arc_length)) * trajectory.sample_period_s
    elapsed = (times - trajectory.start.ToNanoseconds()) * 1e-9
    arcs = np.interp(elapsed, samples, np.array(trajectory.arc_length))
    return _along(path, arcs)


def _along(path: Array, arcs: Array) -> Array:
    lengths = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    return np.stack([np.interp(arcs, lengths, path[:, axis]) for axis in range(path.shape[1])], 1)


def _route_difference(old: Array, new: Array) -> float:
    """Greatest distance of a point of either route from the other one, m."""
    dense = [_densely(route) for route in (old, new)]
    gaps = np.linalg.norm(dense[0][:, None] - dense[1][None], axis=2)
    between = max(gaps.min(axis=0).max(), gaps.min(axis=1).max())
    # Two samplings of one line are up to half a spacing apart.
    return max(0.0, float(between) - 0.5 * SPACING)


def _densely(route: Array) -> Array:
    total = float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())
    return _along(route, np.arange(0.0, total + SPACING, SPACING))
