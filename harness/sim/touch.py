"""The simulated robot's first contact with an obstacle."""

from __future__ import annotations

import mujoco

from wayproof.harness.result import Contact
from wayproof.models.scene import Scene
from wayproof.models.sensors.caster import ROBOT_GROUP


def touched(scene: Scene, data: mujoco.MjData) -> Contact | None:
    """The first contact with anything but the floor; a mover goes by its body's name."""
    model = scene.model
    for pair, position in zip(data.contact.geom, data.contact.pos, strict=True):
        mine = [int(model.geom_group[geom]) == ROBOT_GROUP for geom in pair]
        if mine[0] == mine[1]:
            continue
        other = int(pair[1] if mine[0] else pair[0])
        if other in scene.floor:
            continue
        x, y, z = position.tolist()
        body = int(model.geom_bodyid[other])
        moves = model.body_mocapid[body] >= 0
        name = model.body(body).name if moves else model.geom(other).name
        return Contact(name or f"geom {other}", (x, y, z))
    return None
