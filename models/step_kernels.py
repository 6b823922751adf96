"""What is due between two physics steps, as one compiled call.

What the robot touches, whether its base is where it may be, how the error of its pose estimate
moves on, and what the controller is asked for next: in Python that took longer than MuJoCo's step.

Plans are made in the believed frame, so the controller has to track the believed pose. It holds the
true state, so the setpoint is moved instead. With the believed position b = p + e and heading
psi_b = psi + a, a setpoint s asks a controller that believed b for the offset s - b, which it would
turn into the body by R_z(a)' too much. The setpoint

    s' = s - e - (I - R_z(a)') (s - b),   v' = R_z(a)' v,   psi' = psi_s - a

asks the same of a controller that knows p: s' - p = R_z(a)' (s - b). The stack gets each estimate
as it is. Controllers get it smoothed, as an inertial sensor would carry them from one estimate to
the next: e and a pass a critically damped filter, so that setpoints have neither steps nor kinks.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array

BANDWIDTH = 10.0
"""Of the filter between estimate and controller, rad/s: half that of the quadrotor's reference.

Unsmoothed, 1 cm of white error at 100 Hz drove its snap feed-forward into the rotors' limits.
"""


@kernel
def look_and_ask(
    pairs: NDArray[np.int32],
    step: int,
    row: int,
    planned: Array,
    asked: Array,
    is_robot: NDArray[np.bool_],
    is_obstacle: NDArray[np.bool_],
    position: Array,
    rotation: Array,
    limits: Array,
    places: Array,
    error: Array,
    tracked: Array,
    timestep: float,
    pose: Array,
) -> tuple[int, bool]:
    """Look at a physics step, and ask for the next one.

    Args:
        pairs: (n, 2) geoms in contact.
        step: Number of the step.
        row: Of the next setpoint; from the planned ones' number on nothing is asked for.
        planned: (m, 8) setpoints' rows by the trajectory, in the believed frame.
        asked: (m, 8) what the controller is asked for, world frame; its row is written.
        is_robot: (geoms,) the robot's.
        is_obstacle: (geoms,) those that it should not touch.
        position: (3,) of the base at the step's begin, world, m.
        rotation: (9,) R_world_body at the step's begin, row by row.
        limits: (7,) the base's least and greatest x, y, z, m, and least cosine of its tilt.
        places: (k, 3) latest positions of the base, written round and round, m.
        error: (4,) believed less true pose: x, y, z, m, and heading, rad.
        tracked: (2, 4) the error as the controller feels it, and its rate; moved on by a step.
        timestep: s.
        pose: (7,) position and quaternion of the base after the step.

    Returns:
        The first geom in contact that the robot should not touch, -1 if there is none; and whether
        the base is outside its limits.
    """
    for axis in range(3):
        places[step % len(places), axis] = position[axis]
    smooth(error, tracked, timestep)
    if row < len(planned):
        ask(planned[row], tracked[0], pose, asked[row])
    return touched(pairs, is_robot, is_obstacle), _outside(position, rotation, limits)


@kernel
def ask(planned: Array, error: Array, pose: Array, asked: Array) -> None:
    """Move a setpoint by the error, see the head of this file.

    Args:
        planned: (8,) the setpoint's row by the trajectory, in the believed frame.
        error: (4,) as the controller feels it.
        pose: (7,) where the body truly is.
        asked: (8,) the setpoint's row in the world's frame; output.
    """
    turn = error[3]
    c, s = cos(turn), sin(turn)
    to_x, to_y = planned[0] - pose[0] - error[0], planned[1] - pose[1] - error[1]
    asked[0] = planned[0] - error[0] - ((1.0 - c) * to_x - s * to_y)
    asked[1] = planned[1] - error[1] - (s * to_x + (1.0 - c) * to_y)
    asked[2] = planned[2] - error[2]
    asked[3] = c * planned[3] + s * planned[4]
    asked[4] = c * planned[4] - s * planned[3]
    asked[5] = planned[5]
    asked[6] = planned[6] - turn
    asked[7] = planned[7]


@kernel
def smooth(error: Array, tracked: Array, timestep: float) -> None:
    """Move the tracked error (2, 4), and its rate, by a step after the error (4,)."""
    for i in range(4):
        behind, rate = error[i] - tracked[0, i], tracked[1, i]
        rate += timestep * (BANDWIDTH * (BANDWIDTH * behind - 2.0 * rate))
        tracked[1, i] = rate
        tracked[0, i] += timestep * rate


@kernel
def touched(
    pairs: NDArray[np.int32], is_robot: NDArray[np.bool_], is_obstacle: NDArray[np.bool_]
) -> int:
    """The first geom among pairs (n, 2) in contact that the robot should not touch; -1 if none."""
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        if is_robot[a] and is_obstacle[b]:
            return int(b)
        if is_robot[b] and is_obstacle[a]:
            return int(a)
    return -1


@kernel
def _outside(position: Array, rotation: Array, limits: Array) -> bool:
    """True for what is not a number, too."""
    for axis in range(3):
        if not limits[axis] <= position[axis] <= limits[3 + axis]:
            return True
    return not rotation[8] > limits[6]  # the body's z axis along the world's


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    pairs, neither = np.zeros((1, 4), np.int32)[:, ::2], np.zeros(1, np.bool_)  # as MuJoCo's lie
    rows, pose = np.zeros((1, 8)), np.zeros(7)
    base = pose[:3], np.zeros(9), np.zeros(7)
    believed: Any = np.zeros(4), np.zeros((2, 4)), 0.0, pose
    ask(rows[0], pose[:4], pose, rows[0])
    look_and_ask(pairs, 0, 0, rows, rows, neither, neither, *base, np.zeros((1, 3)), *believed)
