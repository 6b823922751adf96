"""What a state of a plan is: a position, or a position and a heading, and how it moves on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from ompl import base as ob

from wayproof.planners import kernels
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import Floats, Pose


class StateSpace(NamedTuple):
    """One kind of state, as OMPL makes it and as the rest of the package reads it.

    Attributes:
        make: OMPL's space within a free space, for a least turning radius [m].
        write: Set a state to a pose.
        read: The pose of a state; in a plane with the given z [m].
        oriented: Whether a state has a heading.
        curved: Whether it moves on circles and straight lines instead of evenly.
    """

    make: Callable[[FreeSpace, float], ob.StateSpace]
    write: Callable[[ob.State, Pose], None]
    read: Callable[[ob.State, float], Pose]
    oriented: bool
    curved: bool


def _bounds(space: FreeSpace) -> ob.RealVectorBounds:
    dimensions = 2 if space.flat else 3
    bounds = ob.RealVectorBounds(dimensions)
    for axis in range(dimensions):
        bounds.setLow(axis, float(space.origin[axis]))
        high = space.origin[axis] + space.grid.field.shape[axis] * space.resolution
        bounds.setHigh(axis, float(high))
    return bounds


def _bounded(state_space: ob.StateSpace, space: FreeSpace) -> ob.StateSpace:
    state_space.setBounds(_bounds(space))
    return state_space


def _position(space: FreeSpace, _: float) -> ob.StateSpace:
    return _bounded(ob.RealVectorStateSpace(2 if space.flat else 3), space)


def _write_plane(state: ob.State, pose: Pose) -> None:
    state[0], state[1] = pose[0], pose[1]


def _read_plane(state: ob.State, z: float) -> Pose:
    return state[0], state[1], z, 0.0


def _write_point(state: ob.State, pose: Pose) -> None:
    state[0], state[1], state[2] = pose[0], pose[1], pose[2]


def _read_point(state: ob.State, _: float) -> Pose:
    return state[0], state[1], state[2], 0.0


def _write_pose(state: ob.State, pose: Pose) -> None:
    state.setXY(pose[0], pose[1])
    state.setYaw(pose[3])


def _read_pose(state: ob.State, z: float) -> Pose:
    return state.getX(), state.getY(), z, state.getYaw()


def _pose_above_ground(space: FreeSpace, _: float) -> ob.StateSpace:
    state_space = ob.CompoundStateSpace()
    state_space.addSubspace(_position(space, 0.0), 1.0)
    state_space.addSubspace(ob.SO2StateSpace(), 0.5)  # the weight that OMPL gives it in SE(2)
    return state_space


def _write_pose_above_ground(state: ob.State, pose: Pose) -> None:
    _write_point(state[0], pose)
    state[1].value = pose[3]


def _read_pose_above_ground(state: ob.State, _: float) -> Pose:
    return state[0][0], state[0][1], state[0][2], state[1].value


PLANE = StateSpace(_position, _write_plane, _read_plane, oriented=False, curved=False)
POINT = StateSpace(_position, _write_point, _read_point, oriented=False, curved=False)
POSE_ABOVE_GROUND = StateSpace(
    _pose_above_ground, _write_pose_above_ground, _read_pose_above_ground, True, False
)


def _on_ground(make: Callable[[float], ob.StateSpace], curved: bool) -> StateSpace:
    return StateSpace(
        lambda space, radius: _bounded(make(radius), space), _write_pose, _read_pose, True, curved
    )


SE2 = _on_ground(lambda _: ob.SE2StateSpace(), curved=False)
STATE_SPACES: dict[str, tuple[StateSpace | None, StateSpace | None]] = {
    "position": (PLANE, POINT),
    "pose": (SE2, POSE_ABOVE_GROUND),
    "reeds_shepp": (_on_ground(ob.ReedsSheppStateSpace, curved=True), None),
    "dubins": (_on_ground(ob.DubinsStateSpace, curved=True), None),
}
"""For the plane and for space: R2 and R3, SE(2) and R3 x SO(2), and the curves of cars.

Reeds and Shepp, "Optimal paths for a car that goes both forwards and backwards", 1990; Dubins, "On
curves of minimal length with a constraint on average curvature", 1957.
"""


NOT_ABOVE_GROUND = ("informed_rrtstar", "bitstar", "aorrtc", "kpiece1")
"""Planners that OMPL has no means for in R3 x SO(2): informed samples, or a projection."""

NOT_ONE_WAY = ("aorrtc",)
"""Planners that end the process in OMPL 2.0.1 where the way back is another length, as on Dubins
curves: 3 of 4 episodes."""


def state_space_for(name: str, planner: str, *, flat: bool, discs: bool) -> StateSpace:
    """The state space of a name; ``auto`` has a heading where the body is more than one disc.

    Args:
        name: ``auto`` or a key of ``STATE_SPACES``.
        planner: What searches it, a key of ``PLANNERS`` or a user's own.
        flat: Whether the body moves in the plane.
        discs: Whether it is checked at its heading.

    Raises:
        ValueError: If the body needs a heading and this has none, it is for the plane only, or the
            planner cannot search it.
    """
    if name == "auto":
        name = "pose" if discs else "position"
    found = STATE_SPACES[name][0 if flat else 1]
    if found is None:
        raise ValueError(f"planner.state_space: got {name} in space, expected position or pose")
    if discs and not found.oriented:
        raise ValueError(f"planner.state_space: got {name} for a body of discs, expected pose")
    if found is POSE_ABOVE_GROUND and planner in NOT_ABOVE_GROUND:
        without = "" if discs else "position, or "
        raise ValueError(
            f"planner.state_space: got {name} in space for the planner {planner}, expected "
            f"{without}a planner other than {', '.join(NOT_ABOVE_GROUND)}"
        )
    if name == "dubins" and planner in NOT_ONE_WAY:
        raise ValueError(
            f"planner.state_space: got {name} for the planner {planner}, expected reeds_shepp, or "
            f"a planner other than {', '.join(NOT_ONE_WAY)}"
        )
    return found


def sample_curve(
    state_space: ob.StateSpace, kind: StateSpace, a: ob.State, b: ob.State, radius: float, z: float
) -> Floats:
    """Poses along the curve from one state to another, shape (n, 4), a turn step apart at most.

    What is checked is what is handed on. Where a Reeds-Shepp curve turns round between two poses,
    both leave out the tip: at most half of a step, ``TURN_STEP`` times the turning radius.
    """
    count = max(math.ceil(state_space.distance(a, b) / (kernels.TURN_STEP * radius)), 1)
    at = state_space.allocState()
    poses = np.empty((count + 1, 4))
    poses[0], poses[count] = kind.read(a, z), kind.read(b, z)
    for n in range(1, count):
        state_space.interpolate(a, b, n / count, at)
        poses[n] = kind.read(at, z)
    return poses
