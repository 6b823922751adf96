"""Composite rigid body of the robot, from the compiled model's mass matrix."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray


class RigidBody(NamedTuple):
    """Mass properties of the whole robot in one pose.

    Attributes:
        mass: kg.
        centre: (3,) base origin to centre of mass, body frame, m.
        inertia: (3, 3) about the centre of mass, body frame, kg m^2.
    """

    mass: float
    centre: NDArray[np.float64]
    inertia: NDArray[np.float64]


def composite_rigid_body(
    model: mujoco.MjModel, root_qpos: int, root_dof: int, joints: NDArray[np.float64]
) -> RigidBody:
    """Freeze the joints and take the 6 x 6 corner of the mass matrix that the free joint sees.

    With the base unrotated that corner is [[m 1, -m c^], [m c^, J]], where c^ is the cross
    product matrix of the centre of mass and J the inertia about the base origin; the inertia
    about the centre of mass follows from Steiner's theorem.

    Args:
        model: Compiled model that holds the robot.
        root_qpos: Address of the free joint in qpos.
        root_dof: Address of the free joint in qvel.
        joints: (n,) joint angles, stored right after the free joint, rad.
    """
    data = mujoco.MjData(model)
    data.qpos[root_qpos + 3 : root_qpos + 7] = (1.0, 0.0, 0.0, 0.0)
    data.qpos[root_qpos + 7 : root_qpos + 7 + len(joints)] = joints
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    corner = full[root_dof : root_dof + 6, root_dof : root_dof + 6]  # (6, 6)
    mass = float(corner[0, 0])
    centre = np.array([corner[1, 5], corner[2, 3], corner[0, 4]]) / mass
    inertia = corner[3:, 3:] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return RigidBody(mass, centre, inertia)
