"""True geometry of a log as triangles: the static one, and each mover in its own frame."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.viewer.triangles import triangles_of
from wayproof.models.classes import CLASSES
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

Array = NDArray[np.float64]

FLOOR = CLASSES.index("floor")

OBSTACLES, GLASS, GROUND = "obstacles", "glass", "floor"
"""Parts of a scene: glass is what no beam meets; the floor is what may be stepped on, unless it is
a plane."""


@dataclass(frozen=True)
class TrueScene:
    """Surfaces of a scene without the robot, (n, 3, 3) m: the corners of triangles.

    Attributes:
        still: Parts that stand still, in the world's frame; one without triangles is left out.
        movers: Each mover in its own frame, by its name in the truth.
    """

    still: dict[str, Array]
    movers: dict[str, Array]


def true_scene(log: Log) -> TrueScene | None:
    """Return the true geometry of the scene in a log; None of a recording, which has none.

    Raises:
        InputError: The scene in the log cannot be compiled.
    """
    if log.config.recording is not None:
        return None
    redirect_mujoco_warnings()
    try:
        model = mujoco.MjModel.from_xml_string(safe_scene(log.scene))
    except NOT_COMPILED as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene: {line}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    still: dict[str, list[Array]] = {OBSTACLES: [], GLASS: [], GROUND: []}
    movers: dict[str, list[Array]] = {}
    for geom in np.flatnonzero(model.geom_group != ROBOT_GROUP).tolist():
        body = int(model.geom_bodyid[geom])
        triangles = triangles_of(model, geom)
        if model.body_mocapid[body] >= 0:
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            placed = _placed(triangles, turn, model.geom_pos[geom])
            movers.setdefault(str(model.body(body).name), []).append(placed)
        else:
            placed = _placed(triangles, data.geom_xmat[geom], data.geom_xpos[geom])
            still[_part(model, geom)].append(placed)
    joined = {part: np.concatenate(pieces) for part, pieces in still.items() if pieces}
    return TrueScene(
        {part: triangles for part, triangles in joined.items() if len(triangles)},
        {name: np.concatenate(pieces) for name, pieces in movers.items()},
    )


def _part(model: mujoco.MjModel, geom: int) -> str:
    if model.nuser_geom and model.geom_user[geom, 0] == FLOOR:
        return GROUND
    material = int(model.geom_matid[geom])
    alpha = model.geom_rgba[geom, 3] if material < 0 else model.mat_rgba[material, 3]
    return OBSTACLES if alpha > 0.0 else GLASS


def _placed(triangles: Array, rotation: Array, position: Array) -> Array:
    """Return triangles (n, 3, 3) turned by a rotation (9,) row by row, and moved by (3,), m."""
    R = rotation.reshape(3, 3)
    return np.asarray(np.einsum("ij,nkj->nki", R, triangles) + position)
