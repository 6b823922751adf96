"""Addresses of the robot's joints, motors and sensors in a compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco

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

    To look a field up and to slice it anew takes as long as a kernel.

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
