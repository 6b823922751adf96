"""The robot in a compiled model: addresses, mass properties, and the records of its controller.

The records are numpy's, because numba reads and writes their fields by name, and because the bytes
of `MEMORY` are the whole state of the controller. Kernels that are called at every physics step
take them, and the parameters, as arrays of one record: numba unpacks such an array in 0.3 us, a
record in 3.6 us and a named tuple in 1 to 2 us, which was half the cost of control.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import JOINTS, LEGS


class Wiring(NamedTuple):
    """Slices of MuJoCo's arrays; nothing is assumed to start at zero.

    Attributes:
        qpos: Free joint (7) and joint angles (12).
        dofs: Free joint (6) and joint rates (12).
        controls: Motors (12).
        touch: Touch sensors (4).
    """

    qpos: slice
    dofs: slice
    controls: slice
    touch: slice


class Views(NamedTuple):
    """Views of one `MjData` that the robot reads and writes at every physics step.

    To look a field up and to slice it again takes as long as a kernel.

    Attributes:
        qpos: (19,) free joint and joint angles.
        qvel: (18,) free joint and joint rates.
        rates: (12,) joint rates, rad/s.
        bias: (12,) MuJoCo's `qfrc_bias` of the joints, Nm.
        passive: (12,) its `qfrc_passive`, Nm.
        touch: (4,) normal forces on the feet, N.
        torques: (12,) controls, Nm, to be written.
    """

    qpos: Array
    qvel: Array
    rates: Array
    bias: Array
    passive: Array
    touch: Array
    torques: Array


def views_of(data: mujoco.MjData, wiring: Wiring) -> Views:
    """Return the robot's parts of the arrays of a simulation."""
    joints = slice(wiring.dofs.start + 6, wiring.dofs.stop)
    return Views(
        qpos=data.qpos[wiring.qpos],
        qvel=data.qvel[wiring.dofs],
        rates=data.qvel[joints],
        bias=data.qfrc_bias[joints],
        passive=data.qfrc_passive[joints],
        touch=data.sensordata[wiring.touch],
        torques=data.ctrl[wiring.controls],
    )


def wire(model: mujoco.MjModel, prefix: str) -> Wiring:
    """Look every name up.

    Raises:
        KeyError: The model lacks one of the robot's names.
        ValueError: The model holds them in another order than the robot's MJCF.
    """
    names = [f"{prefix}{leg}_{joint}" for leg in LEGS for joint in JOINTS]
    joints = [model.joint(name) for name in names]
    root = model.joint(f"{prefix}root")
    qpos = [int(root.qposadr[0]) + i for i in range(7)] + [int(j.qposadr[0]) for j in joints]
    dofs = [int(root.dofadr[0]) + i for i in range(6)] + [int(j.dofadr[0]) for j in joints]
    touch = [int(model.sensor(f"{prefix}{leg}_touch").adr[0]) for leg in LEGS]
    return Wiring(
        qpos=_span("qpos addresses", qpos),
        dofs=_span("dof addresses", dofs),
        controls=_span("actuators", [model.actuator(name).id for name in names]),
        touch=_span("touch sensors", touch),
    )


def _span(what: str, addresses: Sequence[int]) -> slice:
    start = addresses[0]
    if list(addresses) != list(range(start, start + len(addresses))):
        raise ValueError(f"{what}: got {list(addresses)}, expected consecutive ones")
    return slice(start, start + len(addresses))


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


OBSERVATION = np.dtype(
    [
        ("position", "f8", 3),  # base origin, world, m
        ("rotation", "f8", (3, 3)),  # R_world_body
        ("angles", "f8", 3),  # roll, pitch, yaw (z-y-x), rad
        ("angular_velocity", "f8", 3),  # world, rad/s
        ("lever", "f8", 3),  # base origin to centre of mass, world, m
        ("com", "f8", 3),  # centre of mass, world, m
        ("com_velocity", "f8", 3),  # world, m/s
        ("foot", "f8", (4, 3)),  # foot centres, world, m
        ("foot_velocity", "f8", (4, 3)),  # world, m/s
        ("jacobian", "f8", (4, 3, 3)),  # d foot / d joint, world axes, m/rad
    ],
    align=True,
)
"""Record of the observed state, rewritten every tick from the joints."""

MEMORY = np.dtype(
    [
        ("command", "f8", 3),  # slewed: forward m/s, left m/s, yaw rate rad/s
        ("walking", "?"),  # trots, else stands on four feet
        ("arrived", "?"),  # at a setpoint that rests
        ("phase", "f8"),  # of the cycle, [0, 1)
        ("calm_time", "f8"),  # since a command or imbalance last called for a step, s
        ("waited", "f8"),  # for a late foot, s
        ("reference", "f8", 3),  # base x, y (m) and yaw (rad), world
        ("ground_height", "f8"),  # under the base, from the standing feet, world, m
        ("ground_pitch", "f8"),  # nose down positive, rad
        ("ground_roll", "f8"),  # left side up positive, rad
        ("leg_phase", "f8", 4),  # [0, 1); a foot stands below the duty factor
        ("swinging", "i1", 4),  # 1 or 0, by schedule
        ("touching", "i1", 4),  # 1 or 0: has met the ground in this stance or late swing
        ("lift_off", "f8", (4, 3)),  # where the last swing began, world, m
        ("touch_down", "f8", (4, 3)),  # where the foot last stood, world, m
        ("foothold", "f8", (4, 3)),  # where the swing ends, world, m
        ("force", "f8", (4, 3)),  # ground on foot, world, N
    ],
    align=True,
)
"""Record of the controller's state, kept from tick to tick."""


def record(dtype: np.dtype[Any]) -> tuple[Any, NDArray[Any]]:
    """Return a zeroed record: as attributes for Python, and in an array (1,) for kernels."""
    array = np.zeros(1, dtype)
    return array.view(np.recarray)[0], array
