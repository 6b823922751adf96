"""Draw one decision of a log: the true scene from above, and the map that the decision rests on.

Usage: python docs/picture.py LOG SEQUENCE OUT.png
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from harness.navigator import Navigator
from harness.reader import open_log
from maps import FREE, OCCUPIED, UNKNOWN
from models.sensors import ROBOT_GROUP

PIXELS_PER_CELL = 4
COLOURS = {UNKNOWN: (150, 150, 160), FREE: (250, 250, 250), OCCUPIED: (30, 30, 35)}
INFLATED = (255, 205, 150)
GUIDE, COMMITTED, TRAIL = (60, 110, 235), (20, 150, 60), (200, 30, 30)


def main(log_path: Path, sequence: int, out: Path) -> None:
    """Replay up to the decision, then put scene and map side by side."""
    log = open_log(log_path)
    navigator = Navigator(log.config, log.mission, log.beams)
    trail, truths = [], {truth.sequence: truth for truth in log.truth()}
    for record in log.records():
        decision = navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        trail.append(record.inputs.pose.position)
        if decision.sequence == sequence:
            break
    plan_view = draw_map(navigator.costmap, decision, np.array(trail))
    scene = render_scene(log, truths[sequence], plan_view.size)
    both = Image.new("RGB", (2 * plan_view.width + 8, plan_view.height), "white")
    both.paste(scene, (0, 0))
    both.paste(plan_view, (plan_view.width + 8, 0))
    both.save(out, optimize=True)


def draw_map(costmap, decision, trail):
    """The three states with what inflation forbids, the guide, its committed part, the trail."""
    layer = min(int((trail[-1][2] - costmap.origin[2]) / costmap.resolution), costmap.shape[2] - 1)
    states = costmap.state[:, :, layer]  # (nx, ny)
    pixels = np.zeros((*states.shape, 3), np.uint8)
    for state, colour in COLOURS.items():
        pixels[states == state] = colour
    field = costmap.obstacle_clearance[:, :, layer]
    pixels[(field <= costmap.blocked_at_or_below) & (states == FREE)] = INFLATED
    image = Image.fromarray(np.flipud(pixels.transpose(1, 0, 2)))
    image = image.resize([PIXELS_PER_CELL * n for n in states.shape], Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(image)

    def line(points, colour, width):
        cells = (points[:, :2] - costmap.origin[:2]) / costmap.resolution * PIXELS_PER_CELL
        cells[:, 1] = image.height - cells[:, 1]
        draw.line([tuple(cell) for cell in cells], fill=colour, width=width)

    line(as_array(decision.guide), GUIDE, 2)
    line(trail, TRAIL, 3)
    line(as_array(decision.trajectory.path), COMMITTED, 5)
    return image


def render_scene(log, truth, size):
    """The logged scene from above, with the robot where it truly was."""
    spec = mujoco.MjSpec.from_string(log.scene)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = size
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:3], data.qpos[3:7] = truth.position, truth.quaternion
    for mover in truth.movers:
        mocap = model.body(mover.name).mocapid[0]
        data.mocap_pos[mocap] = mover.position if mover.present else (0.0, 0.0, -1000.0)
        data.mocap_quat[mocap] = mover.quaternion
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    low, high = np.array(log.mission.low), np.array(log.mission.high)
    camera.lookat[:] = [*(0.5 * (low + high))[:2], 0.0]
    camera.azimuth, camera.elevation, camera.distance = 90.0, -89.9, 20.0
    camera.orthographic = 1
    model.vis.global_.fovy = high[1] - low[1]  # of an orthographic camera: metres
    flatten_colours(model)
    options = mujoco.MjvOption()
    options.geomgroup[:] = 1
    with mujoco.Renderer(model, size[1], size[0]) as renderer:
        renderer.update_scene(data, camera, options)
        return Image.fromarray(renderer.render())


def flatten_colours(model):
    """Even light, pale floor, dark walls, red robot: a plan, not a photograph."""
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.6, 0.3
    model.vis.headlight.specular[:] = 0.0
    model.light_diffuse[:] = model.light_specular[:] = 0.0
    for geom in range(model.ngeom):
        if model.geom(geom).name.startswith("floor"):
            model.geom_rgba[geom] = 0.98, 0.98, 0.98, 1.0
        if model.geom(geom).name.startswith(("wall", "partition", "lintel")):
            model.geom_rgba[geom] = 0.15, 0.15, 0.17, 1.0
    model.geom_rgba[model.geom_group == ROBOT_GROUP] = 0.9, 0.1, 0.1, 1.0


def as_array(points):
    """Logged points as (n, 3)."""
    return np.array([(point.x, point.y, point.z) for point in points]).reshape(-1, 3)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
