"""The planner state as a message of a log, exactly, and read back from one."""

from __future__ import annotations

from typing import get_args

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import Label
from wayproof.harness.geometry import polyline_length
from wayproof.harness.input_messages import MAX_COORDINATE
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.closed_gaps import MOST_GAPS
from wayproof.harness.stack.types import (
    ClosedGap,
    Exploration,
    LostWay,
    PathLoss,
    Place,
    PlannerState,
    UnderWay,
)
from wayproof.planners import Trajectory
from wayproof.planners.jerk_limited import Profile

Array = NDArray[np.float64]

MOST_NUMBERS = 1 << 18
"""Maximum number of values in one field; a path has some hundred points."""

MOST_EARLIER = 1000
"""Maximum number of trajectories that are superseded but not yet left."""

LONGEST_PATH = 1e5
"""Maximum length of a path, m: paths are sampled."""

LONGEST_MOTION = 1e5
"""Maximum duration of a motion, s: motions are sampled."""

MOST_NS = 1 << 60
"""Times beyond every episode, ns."""


def state_message(state: PlannerState) -> pb.PlannerState:
    """Encode a planner state."""
    message = pb.PlannerState(
        trajectory=_trajectory_message(state.trajectory),
        earlier=[_trajectory_message(one) for one in state.earlier],
        rest_since_ns=state.rest_since_ns,
        improved_ns=state.improved_ns,
        viewpoints=_points_message(state.viewpoints),
        breadcrumbs=_points_message(state.breadcrumbs),
        backtracks=state.backtracks,
        oriented=state.oriented,
        unheld_trail=_points_message(state.unheld_trail),
        returns=state.returns,
        closed_gaps=[pb.ClosedGap(place=gap.place, tries=gap.tries) for gap in state.closed_gaps],
    )
    if state.global_path is not None:
        message.global_path.CopyFrom(_points_message(state.global_path))
    if (detour := state.exploration) is not None:
        message.exploration.CopyFrom(
            pb.Exploration(
                since=detour.since, backtracking=detour.backtracking, returning=detour.returning
            )
        )
    if (loss := state.path_loss) is not None:
        message.path_loss.CopyFrom(
            pb.PathLoss(sequence=loss.sequence, under_way=loss.under_way, label=loss.label)
        )
    if (lost := state.lost_way) is not None:
        message.lost_way.CopyFrom(
            pb.LostWay(place=lost.place, length_m=lost.length_m, time_ns=lost.time_ns)
        )
    return message


def read_state(message: pb.PlannerState) -> PlannerState:
    """Read a planner state back, bit by bit.

    Raises:
        ValueError: It is none: a field has another size, or numbers out of range.
    """
    if len(message.earlier) > MOST_EARLIER:
        raise ValueError(f"earlier: {len(message.earlier)} trajectories")
    detour, loss = message.exploration, message.path_loss
    return PlannerState(
        trajectory=_trajectory(message.trajectory),
        earlier=tuple(_trajectory(one) for one in message.earlier),
        global_path=_path(message.global_path) if message.HasField("global_path") else None,
        exploration=Exploration(detour.since, detour.backtracking, detour.returning)
        if message.HasField("exploration")
        else None,
        path_loss=_path_loss(loss) if message.HasField("path_loss") else None,
        rest_since_ns=_time(message.rest_since_ns),
        improved_ns=_time(message.improved_ns),
        viewpoints=_points(message.viewpoints),
        breadcrumbs=_points(message.breadcrumbs),
        backtracks=message.backtracks,
        oriented=message.oriented,
        unheld_trail=_points(message.unheld_trail),
        returns=message.returns,
        lost_way=_lost_way(message.lost_way) if message.HasField("lost_way") else None,
        closed_gaps=_closed_gaps(message),
    )


def _trajectory_message(trajectory: Trajectory) -> pb.CommittedTrajectory:
    return pb.CommittedTrajectory(
        start_ns=trajectory.start_ns,
        path=trajectory.path.ravel().tolist(),
        motion=_profile_message(trajectory.motion),
        turning=_profile_message(trajectory.turning),
        overshoot_m=trajectory.overshoot_m,
    )


def _profile_message(profile: Profile) -> pb.Profile:
    return pb.Profile(
        times=profile.times.tolist(),
        states=profile.states.ravel().tolist(),
        jerks=profile.jerks.tolist(),
        duration=profile.duration,
        end=profile.end,
    )


def _points_message(points: Array) -> pb.Points:
    return pb.Points(coordinates=points.ravel().tolist())


def _trajectory(message: pb.CommittedTrajectory) -> Trajectory:
    path = _rows(message.path, 3, "path")
    return Trajectory(
        start_ns=_time(message.start_ns),
        path=_checked_path(path),
        motion=_profile(message.motion),
        turning=_profile(message.turning),
        overshoot_m=float(_finite(np.array([message.overshoot_m]), "overshoot_m")[0]),
    )


def _profile(message: pb.Profile) -> Profile:
    times = _rows(message.times, 1, "times")[:, 0]
    states, jerks = _rows(message.states, 3, "states"), _rows(message.jerks, 1, "jerks")[:, 0]
    if not len(times) == len(states) == len(jerks) or (np.diff(times) < 0.0).any():
        raise ValueError("profile: pieces that do not follow each other")
    bounds = _finite(np.array([message.duration, message.end]), "profile")
    if not 0.0 <= bounds[0] <= LONGEST_MOTION:
        raise ValueError(f"duration: {message.duration} s")
    return Profile(times, states, jerks, message.duration, message.end)


def _path(message: pb.Points) -> Array:
    return _checked_path(_points(message))


def _points(message: pb.Points) -> Array:
    return _rows(message.coordinates, 3, "points")


def _checked_path(path: Array) -> Array:
    if len(path) == 0 or polyline_length(path) > LONGEST_PATH:
        raise ValueError(f"path: {len(path)} points, expected some, and at most {LONGEST_PATH} m")
    return path


def _rows(numbers: object, columns: int, name: str) -> Array:
    """Return numbers of a field in rows (n, columns)."""
    count = len(numbers)  # type: ignore[arg-type]
    if count > MOST_NUMBERS or count % columns:
        raise ValueError(f"{name}: {count} numbers, expected {columns} for each row")
    values = np.array(numbers, np.float64)
    return _finite(values, name).reshape(-1, columns)


def _finite(values: Array, name: str) -> Array:
    if not (np.abs(values) <= MAX_COORDINATE).all():
        raise ValueError(f"{name}: numbers out of range")
    return values


def _time(time_ns: int) -> int:
    if not abs(time_ns) < MOST_NS:
        raise ValueError(f"time: {time_ns} ns")
    return time_ns


def _path_loss(message: pb.PathLoss) -> PathLoss:
    if message.under_way not in get_args(UnderWay) or message.label not in get_args(Label):
        raise ValueError(f"path_loss: {message.under_way[:40]!r}, {message.label[:40]!r}")
    return PathLoss(message.sequence, message.under_way, message.label)  # type: ignore[arg-type]


def _lost_way(message: pb.LostWay) -> LostWay:
    length = float(_finite(np.array([message.length_m]), "lost_way")[0])
    return LostWay(_place(message.place), length, _time(message.time_ns))


def _closed_gaps(message: pb.PlannerState) -> tuple[ClosedGap, ...]:
    gaps = message.closed_gaps
    if len(gaps) > MOST_GAPS or any(gap.tries == 0 for gap in gaps):
        raise ValueError(f"closed_gaps: {len(gaps)} of at most {MOST_GAPS}, or one never tried")
    return tuple(ClosedGap(_place(gap.place), gap.tries) for gap in gaps)


def _place(numbers: object) -> Place:
    rows = _rows(numbers, 3, "place")
    if len(rows) != 1:
        raise ValueError(f"place: {len(rows)} points, expected 1")
    x, y, z = rows[0].tolist()
    return x, y, z
