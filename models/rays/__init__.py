"""Ray casting against MuJoCo's primitives, for sweeps whose beams all leave one point.

MuJoCo's own caster takes every ray alone through every body and geom. A sweep has structure that
it cannot know: neighbouring beams meet the same few geoms. Here beams are grouped in tiles, whole
geoms are ruled out for a tile at a time, and the rest is a loop over beams that vectorises.
"""

import mujoco
import numpy as np

from models.beams import DepthCamera
from models.rays.caster import TileCaster

__all__ = ["TileCaster", "warm_up"]


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    beams = DepthCamera("", "", 2, 2, 1.0, 1.0, range=2.0, rate=1.0, source="").beam_tables()
    caster = TileCaster(model, *beams, group_mask=np.ones(mujoco.mjNGROUP, np.uint8), range=2.0)
    caster.cast(data, np.array([0.0, 0.0, 1.0]), np.eye(3))
