"""Where the robot's joints, motors and sensors lie in a compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from models.robots.quadruped.parameters import JOINTS, LEGS


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
