"""Ray casting against MuJoCo's geoms, a sweep of beams at a time.

MuJoCo's own caster takes every ray alone through every body and geom. A sweep has structure that
it cannot know: neighbouring beams meet the same few geoms. Here beams are grouped in tiles, whole
geoms are ruled out for a tile at a time, and the rest is a loop over beams that vectorises. Beams
form a grid or lie scattered, and leave from one pose or, of a rolling sweep, each from its own.
Against what is made of triangles, each beam that is left walks down a tree of boxes.
"""

import mujoco
import numpy as np

from wayproof.models.rays.caster import TileCaster
from wayproof.models.rays.records import Pattern
from wayproof.models.rays.tiles import cut_grid, cut_scattered
from wayproof.models.sensors.beams import rotate

__all__ = ["Pattern", "TileCaster", "cut_grid", "cut_scattered", "warm_up"]


def warm_up() -> None:
    """Compile the kernels of primitives; a caster of triangles compiles its own."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    down, above = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    rotate(np.eye(3), down)
    pattern, groups = cut_scattered(down), np.ones(mujoco.mjNGROUP, np.uint8)
    caster = TileCaster(model, groups, range=2.0)
    for poses in (1, 2):
        caster.cast(data, pattern, np.repeat(above, poses, axis=0), np.eye(3))
