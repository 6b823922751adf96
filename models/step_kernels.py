"""Work between two physics steps, in one compiled call.

It checks contacts and limits, filters the error of the pose estimate and computes the controller's
next setpoint: in Python that took longer than MuJoCo's step.

Plans are made in the estimated frame, so the controller has to track the estimated pose. It holds
the true state, so the setpoint is moved instead. With the estimated position b = p + e and heading
psi_b = psi + a, a setpoint s commands a controller at b to the offset s - b, which it would turn
into the body by R_z(a)' too much. The setpoint

    s' = s - e - (I - R_z(a)') (s - b),   v' = R_z(a)' v,   psi' = psi_s - a

commands the same to a controller at p: s' - p = R_z(a)' (s - b). The stack gets each estimate as it
is. Controllers get it smoothed, as an inertial sensor would carry them from one estimate to the
next: e and a pass a critically damped filter, so that setpoints have neither steps nor kinks.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.models.arrays import Array

BANDWIDTH = 10.0
"""Bandwidth of the filter between estimate and controller, rad/s: half the quadrotor reference's.

Unsmoothed, 1 cm of white error at 100 Hz drove its snap feed-forward into the rotors' limits.
"""


class StepArrays(NamedTuple):
    """Arrays that a physics step is checked with; they stay the same through an episode.

    Attributes:
        is_robot: (geoms,) whether a geom is the robot's.
        is_obstacle: (geoms,) whether the robot must not touch a geom.
        position: (3,) position of the base at the step's begin, world, m.
        rotation: (9,) R_world_body at the step's begin, row-major.
        limits: (7,) lowest and highest x, y, z of the base, m, and lowest cosine of its tilt.
        places: (k, 3) latest positions of the base, a ring buffer, m; written.
        error: (4,) estimated minus true pose: x, y, z, m, and heading, rad.
        filtered: (2, 4) the error after the filter, and its rate; written.
        pose: (7,) position and quaternion of the base after the step.
        timestep: Physics step, s.
    """

    is_robot: NDArray[np.bool_]
    is_obstacle: NDArray[np.bool_]
    position: Array
    rotation: Array
    limits: Array
    places: Array
    error: Array
    filtered: Array
    pose: Array
    timestep: float


class StepCheck:
    """The compiled check of a physics step, bound to the arrays of one episode."""

    def __init__(self, arrays: StepArrays) -> None:
        """Keep the arrays, as a plain tuple: a kernel takes a named one half as fast."""
        self._arrays = cast(StepArrays, tuple(arrays))

    def __call__(
        self, pairs: NDArray[np.int32], step: int, row: int, planned: Array, commanded: Array
    ) -> tuple[int, bool]:
        """Check a physics step and command the next one; see `check_and_command`."""
        result: tuple[int, bool] = check_and_command(
            pairs, step, row, planned, commanded, self._arrays
        )
        return result


@kernel
def check_and_command(
    pairs: NDArray[np.int32],
    step: int,
    row: int,
    planned: Array,
    commanded: Array,
    arrays: StepArrays,
) -> tuple[int, bool]:
    """Check a physics step, and command the next one.

    Args:
        pairs: (n, 2) geoms in contact.
        step: Number of the step.
        row: Index of the next setpoint; beyond the planned ones nothing is commanded.
        planned: (m, 8) setpoints of the trajectory, in the estimated frame.
        commanded: (m, 8) setpoints of the controller, world frame; the row is written.
        arrays: Arrays of the episode.

    Returns:
        The first geom in contact that the robot must not touch, -1 if there is none; and whether
        the base is outside its limits.
    """
    is_robot, is_obstacle, position, rotation, limits, places, error, filtered, pose, dt = arrays
    for axis in range(3):
        places[step % len(places), axis] = position[axis]
    filter_error(error, filtered, dt)
    if row < len(planned):
        command(planned[row], filtered[0], pose, commanded[row])
    return touched(pairs, is_robot, is_obstacle), _outside(position, rotation, limits)


@kernel
def command(planned: Array, error: Array, pose: Array, commanded: Array) -> None:
    """Move a setpoint by the error; see the head of this file.

    Args:
        planned: (8,) setpoint of the trajectory, in the estimated frame.
        error: (4,) after the filter.
        pose: (7,) true pose of the body.
        commanded: (8,) setpoint in the world frame; is written.
    """
    turn = error[3]
    c, s = cos(turn), sin(turn)
    to_x, to_y = planned[0] - pose[0] - error[0], planned[1] - pose[1] - error[1]
    commanded[0] = planned[0] - error[0] - ((1.0 - c) * to_x - s * to_y)
    commanded[1] = planned[1] - error[1] - (s * to_x + (1.0 - c) * to_y)
    commanded[2] = planned[2] - error[2]
    commanded[3] = c * planned[3] + s * planned[4]
    commanded[4] = c * planned[4] - s * planned[3]
    commanded[5] = planned[5]
    commanded[6] = planned[6] - turn
    commanded[7] = planned[7]


@kernel
def filter_error(error: Array, filtered: Array, timestep: float) -> None:
    """Advance the filtered error and its rate (2, 4) by a step toward the error (4,)."""
    for i in range(4):
        behind, rate = error[i] - filtered[0, i], filtered[1, i]
        rate += timestep * (BANDWIDTH * (BANDWIDTH * behind - 2.0 * rate))
        filtered[1, i] = rate
        filtered[0, i] += timestep * rate


@kernel
def touched(
    pairs: NDArray[np.int32], is_robot: NDArray[np.bool_], is_obstacle: NDArray[np.bool_]
) -> int:
    """Return the first geom in pairs (n, 2) that the robot must not touch, -1 without one."""
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        if is_robot[a] and is_obstacle[b]:
            return int(b)
        if is_robot[b] and is_obstacle[a]:
            return int(a)
    return -1


@kernel
def _outside(position: Array, rotation: Array, limits: Array) -> bool:
    """Return whether the base is outside its limits (7,); it is if a number is NaN."""
    for axis in range(3):
        if not limits[axis] <= position[axis] <= limits[3 + axis]:
            return True
    return not rotation[8] > limits[6]  # cosine between the body's z axis and the world's


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    neither = np.zeros(1, np.bool_)
    rows, pose = np.zeros((1, 8)), np.zeros(7)
    command(rows[0], pose[:4], pose, rows[0])
    arrays = StepArrays(
        is_robot=neither,
        is_obstacle=neither,
        position=pose[:3],
        rotation=np.zeros(9),
        limits=np.zeros(7),
        places=np.zeros((1, 3)),
        error=np.zeros(4),
        filtered=np.zeros((2, 4)),
        pose=pose,
        timestep=0.0,
    )
    for contacts in (0, 1):  # as in MjData, whose array is strided, but for an empty one
        pairs = np.zeros((contacts, 4), np.int32)[:, ::2]
        StepCheck(arrays)(pairs, 0, 0, rows, rows)
