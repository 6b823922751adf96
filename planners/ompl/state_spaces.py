"""State spaces: positions, or positions with headings, as OMPL makes them and as poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import segment, sweep
from wayproof.planners.kernels.grid import Floats, Pose


class StateSpace(NamedTuple):
    """One kind of state, in OMPL and as a pose.

    Attributes:
        make: Make OMPL's space within a free space, for a least turning radius, m.
        write: Set a state to a pose.
        read: Read the pose of a state; in a plane with the given z, m.
        oriented: Whether a state has a heading.
        curved: Whether motion between states follows circles and straight lines.
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


def _pose_in_space(space: FreeSpace, _: float) -> ob.StateSpace:
    state_space = ob.CompoundStateSpace()
    state_space.addSubspace(_position(space, 0.0), 1.0)
    state_space.addSubspace(ob.SO2StateSpace(), 0.5)  # the weight that OMPL gives it in SE(2)
    return state_space


def _write_pose_in_space(state: ob.State, pose: Pose) -> None:
    _write_point(state[0], pose)
    state[1].value = pose[3]


def _read_pose_in_space(state: ob.State, _: float) -> Pose:
    return state[0][0], state[0][1], state[0][2], state[1].value


PLANE = StateSpace(_position, _write_plane, _read_plane, oriented=False, curved=False)
POINT = StateSpace(_position, _write_point, _read_point, oriented=False, curved=False)
POSE_IN_SPACE = StateSpace(
    _pose_in_space, _write_pose_in_space, _read_pose_in_space, oriented=True, curved=False
)


def _on_ground(make: Callable[[float], ob.StateSpace], curved: bool) -> StateSpace:
    return StateSpace(
        lambda space, radius: _bounded(make(radius), space),
        _write_pose,
        _read_pose,
        oriented=True,
        curved=curved,
    )


SE2 = _on_ground(lambda _: ob.SE2StateSpace(), curved=False)
STATE_SPACES: dict[str, tuple[StateSpace | None, StateSpace | None]] = {
    "position": (PLANE, POINT),
    "pose": (SE2, POSE_IN_SPACE),
    "reeds_shepp": (_on_ground(ob.ReedsSheppStateSpace, curved=True), None),
    "dubins": (_on_ground(ob.DubinsStateSpace, curved=True), None),
}
"""State spaces of the plane and of space: R2 and R3, SE(2) and R3 x SO(2), and curves of cars.

Reeds and Shepp, "Optimal paths for a car that goes both forwards and backwards", 1990; Dubins, "On
curves of minimal length with a constraint on average curvature", 1957.
"""


def sample_curve(
    state_space: ob.StateSpace, kind: StateSpace, a: ob.State, b: ob.State, radius: float, z: float
) -> Floats:
    """Sample poses along the curve from one state to another, at most a turn step apart, (n, 4).

    The samples are both checked and returned. Where a Reeds-Shepp curve reverses between two of
    them its tip is left out: at most half of a step of `TURN_STEP` times the turning radius.
    """
    count = max(math.ceil(state_space.distance(a, b) / (sweep.TURN_STEP * radius)), 1)
    at = state_space.allocState()
    poses = np.empty((count + 1, 4))
    poses[0], poses[count] = kind.read(a, z), kind.read(b, z)
    for n in range(1, count):
        state_space.interpolate(a, b, n / count, at)
        poses[n] = kind.read(at, z)
    return poses


def query_ends(planner: ob.Planner) -> tuple[Pose, Pose]:
    """Return the start and goal pose of the problem that a planner was given."""
    validity = planner.getSpaceInformation().getStateValidityChecker()
    # Not definition.getStartState: its binding frees the state that it lends.
    start = planner.getPlannerInputStates().nextStart()
    goal = planner.getProblemDefinition().getGoal().getState()
    return validity.kind.read(start, validity.z), validity.kind.read(goal, validity.z)


def add_solution(planner: ob.Planner, poses: Iterable[Pose]) -> None:
    """Add a path through poses to the problem definition of a planner."""
    information = planner.getSpaceInformation()
    write = information.getStateValidityChecker().kind.write
    path, state = og.PathGeometric(information), information.allocState()
    for pose in poses:
        write(state, pose)
        path.append(state)  # copies it
    planner.getProblemDefinition().addSolutionPath(path, False, 0.0, planner.getName())


class BodyValidity(ob.StateValidityChecker):  # type: ignore[misc]
    """Checker of one state; planners that need the free space get it from the space information.

    Attributes:
        space: Free space.
        kind: State space.
        z: Height of all states in a plane, m.
        any_heading: Whether a path may end at any heading.
    """

    def __init__(
        self,
        information: ob.SpaceInformation,
        space: FreeSpace,
        kind: StateSpace,
        z: float,
        any_heading: bool = False,
    ) -> None:
        """Check states of a kind in a space."""
        super().__init__(information)
        self.space = space
        self.kind = kind
        self.z = z
        self.any_heading = any_heading

    def isValid(self, state: ob.State) -> bool:
        """Return whether the body is free there."""
        pose = self.kind.read(state, self.z)
        if self.kind.oriented:
            return bool(sweep.sweep_free(self.space.grid, self.space.shape, pose, pose))
        threshold = self.space.collision_distance_sq
        return bool(segment.edge_free(self.space.grid, threshold, pose[:3], pose[:3]))
