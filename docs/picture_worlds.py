"""Render every world, seed 4 at difficulty 0.5, from obliquely above.

Usage: python docs/picture_worlds.py FOLDER
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from wayproof.models.worlds import WORLDS

SEED = 4
SIZE = (640, 440)
COLOURS = 128
START, GOAL = (30, 150, 60), (200, 30, 30)


def main(folder: Path) -> None:
    """Write one PNG for each world."""
    for name, make in WORLDS.items():
        render(make(SEED)).save(folder / f"world-{name}.png", optimize=True)


def render(world):
    """Render a world at its start time; start green, goal red."""
    spec = mujoco.MjSpec.from_string(world.mjcf())
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE
    for name, place, colour in (("start", world.start, START), ("goal", world.goal, GOAL)):
        spec.worldbody.add_geom(
            name=f"mark_{name}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[0.3, 0.02, 0.0],
            pos=[place[0], place[1], 0.03],
            rgba=[*(np.array(colour) / 255), 1.0],
        )
    model = spec.compile()
    for geom in range(model.ngeom):  # the nearest wall must not hide the rest
        if "wall_2" == model.geom(geom).name or model.geom(geom).name in ("hedge_2", "barrier_2"):
            model.geom_rgba[geom, 3] = 0.15
    model.light_diffuse[:] = 0.35
    model.light_specular[:] = 0.0
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.25
    model.vis.headlight.specular[:] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    low, high = np.array(world.low), np.array(world.high)
    camera.lookat[:] = [*(0.5 * (low + high))[:2], 0.3]
    camera.azimuth = 90.0
    camera.elevation = (
        -85.0 if world.name == "maze" else -64.0
    )  # its walls hide what is behind them
    camera.distance = 1.12 * max(high[0] - low[0], 1.3 * (high[1] - low[1]))
    with mujoco.Renderer(model, SIZE[1], SIZE[0]) as renderer:
        renderer.update_scene(data, camera)
        image = Image.fromarray(renderer.render())
    ImageDraw.Draw(image).text((8, 6), world.name, fill=(255, 255, 255))
    return image.quantize(COLOURS)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
