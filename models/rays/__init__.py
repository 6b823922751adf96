"""Ray casting against MuJoCo's primitives, a sweep of beams at a time.

MuJoCo's own caster takes every ray alone through every body and geom. A sweep has structure that
it cannot know: neighbouring beams meet the same few geoms. Here beams are grouped in tiles, whole
geoms are ruled out for a tile at a time, and the rest is a loop over beams that vectorises. Beams
form a grid or lie scattered, and leave from one pose or, of a rolling sweep, each from its own.
"""

import mujoco
import numpy as np

from models.rays.caster import TileCaster
from models.rays.kernels import Pattern
from models.rays.tiles import cut_grid, cut_scattered

__all__ = ["Pattern", "TileCaster", "cut_grid", "cut_scattered", "warm_up"]


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pattern = cut_scattered(np.array([[0.0, 0.0, -1.0]]))
    caster = TileCaster(model, group_mask=np.ones(mujoco.mjNGROUP, np.uint8), range=2.0)
    for poses in (1, 2):
        caster.cast(data, pattern, np.array([[0.0, 0.0, 1.0]] * poses), np.eye(3))
