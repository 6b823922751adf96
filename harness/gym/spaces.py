"""Spaces of the environments: a robot's observations, and motions as actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.inputs import Beams
from wayproof.harness.interface.policy_tensors import (
    ACTION,
    OBSERVATION,
    STILL,
    PolicyObserver,
    velocity_of,
)
from wayproof.harness.interface.returns import in_world
from wayproof.harness.interface.types import Motion, Observation, Task, Velocity, Waypoints

Arrays = dict[str, NDArray[Any]]
"""An observation by name."""

ObservationKind = Literal["scan", "flat", "sweeps"]
"""`scan`: the tensors of a policy. `flat`: the same in one row, in the order of `OBSERVATION`.
`sweeps`: besides, each sensor's ranges and the pose."""

ActionKind = Literal["velocity", "waypoints"]
"""Meaning of an action."""

WAYPOINTS = 3
"""Number of waypoints of an action."""

REACH_M = 3.0
"""Distance along an axis of the body's frame that a coordinate of 1 stands for, m."""

MAX_POSITION_M = 1e5
"""Farthest coordinate of a pose, m."""


def observation_space(
    kind: ObservationKind, beams: Mapping[str, Beams]
) -> spaces.Dict | spaces.Box:
    """Return the space of observations.

    Args:
        kind: Kind of observations.
        beams: Geometry of each sensor by name.
    """
    boxes: dict[str, spaces.Space[Any]] = {
        name: spaces.Box(space.low, space.high, space.shape, np.float32)
        for name, space in OBSERVATION.items()
    }
    if kind == "flat":
        low, high = (
            np.concatenate([np.full(one.shape, one[bound]) for one in OBSERVATION.values()])
            for bound in (1, 2)
        )
        return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
    if kind == "sweeps":
        limits = np.array([MAX_POSITION_M] * 3 + [1.0] * 4)
        boxes["pose"] = spaces.Box(-limits, limits, dtype=np.float64)
        for name, sensor in beams.items():
            shape = _shape(sensor)
            boxes[f"sweep_{name}"] = spaces.Box(0, 65535, shape, np.uint16)
    return spaces.Dict(boxes)


def observed(
    kind: ObservationKind, observer: PolicyObserver, seen: Observation, beams: Mapping[str, Beams]
) -> Arrays:
    """Return an observation as a point of the space of its kind, without sweeps that lack."""
    arrays: Arrays = dict(observer.tensors(seen))
    if kind == "sweeps":
        position = np.clip(seen.position, -MAX_POSITION_M, MAX_POSITION_M)
        arrays["pose"] = np.concatenate([position, np.clip(seen.quaternion, -1.0, 1.0)])
        swept = {sweep.sensor: sweep.ranges_mm for sweep in seen.sweeps}
        for name, sensor in beams.items():
            ranges = swept.get(name, np.zeros(sensor.table.beams, np.uint16))
            arrays[f"sweep_{name}"] = ranges.reshape(_shape(sensor))
    return arrays


def as_given(kind: ObservationKind, arrays: Arrays) -> Arrays | NDArray[np.float32]:
    """Return an observation as a caller gets it, who may keep and change it."""
    if kind == "flat":
        return np.concatenate([arrays[name] for name in OBSERVATION])
    return {name: array.copy() for name, array in arrays.items()}


def action_space(kind: ActionKind) -> spaces.Box:
    """Return the space of actions: shares of the body's limits, or of `REACH_M`."""
    return spaces.Box(ACTION.low, ACTION.high, _action_shape(kind), np.float32)


def _action_shape(kind: ActionKind) -> tuple[int, ...]:
    return ACTION.shape if kind == "velocity" else (WAYPOINTS, 3)


def motion_of(kind: ActionKind, action: NDArray[Any], task: Task, seen: Observation) -> Motion:
    """Return the motion that an action commands.

    Raises:
        InputError: It has another shape.
    """
    values = np.asarray(action, np.float32)
    shape = _action_shape(kind)
    if values.shape != shape:
        raise InputError(f"action: got shape {values.shape}, expected {shape}")
    return MOTIONS[kind](values, task, seen)


def _waypoints(action: NDArray[np.float32], task: Task, seen: Observation) -> Motion:
    """Return points in the body's frame; where all are at the body's own place it comes to rest."""
    shares = np.clip(action.astype(np.float64), ACTION.low, ACTION.high)
    shares = np.where(np.abs(shares) < STILL, 0.0, shares)
    if not shares.any():
        return Velocity(0.0, duration_s=0.0)
    heading = yaw_of_quaternion(seen.quaternion)
    return Waypoints(seen.position + in_world(REACH_M * shares, heading))


MOTIONS: dict[str, Callable[[NDArray[np.float32], Task, Observation], Motion]] = {
    "velocity": lambda action, task, _: velocity_of(action, task.mission),
    "waypoints": _waypoints,
}
"""Kind of action -> the motion of one."""


def check_kinds(observation: str, action: str) -> None:
    """Refuse kinds that there are not.

    Raises:
        InputError: The message lists the ones available.
    """
    for name, got, kinds in (
        ("observation", observation, get_args(ObservationKind)),
        ("action", action, get_args(ActionKind)),
    ):
        if got not in kinds:
            raise InputError(f"{name}: got '{got}', expected one of {', '.join(kinds)}")


def _shape(sensor: Beams) -> tuple[int, int]:
    """Return rows and columns of a sensor's beams."""
    rows = sensor.table.image_rows
    return rows, sensor.table.beams // rows
