"""Picture of the simulated scene from behind the robot, with the map of the decision as an overlay.

Joints are those of the logged state of the simulator. Without it the base is at its true pose and
the legs are at rest.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.outputs import written_whole
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.recompute.side_by_side import as_input_error
from wayproof.harness.scenario.scenario import Scenario
from wayproof.harness.sim.snapshot import PhysicsState, restore_parts
from wayproof.harness.viewer.caption import ROBOT, captioned, scene_size
from wayproof.harness.viewer.cutaway import cut_scene
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.harness.viewer.overlay import Tracks, lay_over
from wayproof.harness.viewer.own_costmap import beside, costmap_from_above
from wayproof.harness.viewer.sight import geoms_in_front
from wayproof.models.sensors.caster import ROBOT_GROUP

SIZE = (960, 640)
"""Width and height of a picture, pixels."""

MOST_GEOMS = 60_000

DISTANCE, ELEVATION = 2.3, -38.0
"""Distance of the camera from the robot, m, and its pitch, degrees."""

CUT_ABOVE = 0.15
"""Height above the robot's base at which walls and cells are cut, m."""

IN_FRONT = 0.12
"""Opacity of geometry between camera and robot."""

SHARE = 0.8
"""Share of the robot's colour in that of each of its parts, which stay distinct."""


class Stage:
    """Renderer of the scene of one log."""

    def __init__(self, log: Log, size: tuple[int, int], smooth: bool = True) -> None:
        """Compile the scene of a log and open an offscreen renderer.

        Args:
            log: The log.
            size: Width and height of a picture with its words, pixels.
            smooth: Whether edges are smoothed, which takes most of the time without a GPU.

        Raises:
            InputError: The scene is not one of this robot, or nothing can be drawn.
        """
        self._scenario: Scenario = rebuild(log)
        self._model = model = self._scenario.scene.model
        self._data = mujoco.MjData(model)
        self._log = log
        self._true: list[NDArray[np.float64]] = []
        self._believed: list[NDArray[np.float64]] = []
        width, height = scene_size(size)
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        _dim(model)
        _simplify(model, smooth)
        robot = np.flatnonzero(model.geom_group == ROBOT_GROUP)
        _paint(model, robot)
        self._colours, self._materials = model.geom_rgba.copy(), model.geom_matid.copy()
        self._robot = frozenset(robot.tolist())
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 1  # also those of the robot
        self._options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = 0
        try:
            self._renderer: Any = mujoco.Renderer(model, height, width, max_geom=MOST_GEOMS)
        except Exception as error:  # each driver raises its own
            raise InputError(
                f"no picture here: {error}; MUJOCO_GL=egl or osmesa draws without a screen"
            ) from None

    def __enter__(self) -> Self:
        """Return this stage."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the renderer."""
        self._renderer.close()

    def follow(self, moment: Moment) -> None:
        """Record the positions; call for every moment, drawn or not."""
        self._true.append(np.array(moment.truth.position))
        self._believed.append(np.array(moment.record.inputs.pose.position))

    def draw(self, moment: Moment) -> Image.Image:
        """Draw one moment, with its words."""
        self._pose(moment)
        camera = self._camera(moment)
        self._see_through(camera)
        self._renderer.update_scene(self._data, camera, self._options)
        scene, cut_at = self._renderer.scene, float(moment.truth.position[2]) + CUT_ABOVE
        cut_scene(scene, cut_at, self._robot)
        tracks = Tracks(self._true, self._believed)
        log = self._log
        lay_over(scene, moment, log.mission, tracks=tracks, cut_at=cut_at)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            scene.flags[flag] = 0  # overlay boxes cast no shadows
        drawn = Image.fromarray(self._renderer.render())
        axes = log.mission.axes
        return captioned(drawn, moment, log.config.costmap.cost_range, axes)

    def _pose(self, moment: Moment) -> None:
        truth, state = moment.truth, moment.record.state
        if state is not None:
            simulation = PhysicsState(self._model, self._data)
            restore_parts({"simulation": simulation}, state)
        else:
            controller = self._scenario.scene.controller
            controller.reset(self._data, np.array(truth.position), 0.0)
            base = int(self._model.body_jntadr[self._scenario.scene.base])
            first = int(self._model.jnt_qposadr[base])
            self._data.qpos[first : first + 7] = [*truth.position, *truth.quaternion]
            for mover in truth.movers:
                mocap = self._model.body(mover.name).mocapid[0]
                place = mover.position if mover.present else (0.0, 0.0, -1000.0)
                self._data.mocap_pos[mocap] = place
                self._data.mocap_quat[mocap] = mover.quaternion
        mujoco.mj_forward(self._model, self._data)

    def _camera(self, moment: Moment) -> mujoco.MjvCamera:
        """Return a camera behind the robot along the line to the first goal; it does not sway."""
        (x0, y0, _), (x1, y1, _) = self._log.mission.start, self._log.mission.goals[0]
        along = math.atan2(y1 - y0, x1 - x0)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = moment.truth.position
        camera.azimuth, camera.elevation = math.degrees(along), ELEVATION
        camera.distance = DISTANCE
        return camera

    def _see_through(self, camera: mujoco.MjvCamera) -> None:
        """Fade geometry between the camera and the robot."""
        colours = self._model.geom_rgba
        colours[:], self._model.geom_matid[:] = self._colours, self._materials
        radius = self._log.mission.radius
        colours[geoms_in_front(self._model, self._data, camera, radius), 3] = IN_FRONT


def _paint(model: mujoco.MjModel, robot: NDArray[np.int64]) -> None:
    """Give the visible geoms of the robot a colour that stands out, in place."""
    seen = robot[model.geom_rgba[robot, 3] > 0.0]
    own = model.geom_rgba[seen, :3]
    model.geom_rgba[seen, :3] = SHARE * np.array(ROBOT[:3]) + (1.0 - SHARE) * own
    model.geom_matid[seen] = -1  # otherwise its colour would apply


def _dim(model: mujoco.MjModel) -> None:
    """Reduce the light so that pale colours stay distinct."""
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.5, 0.4
    model.vis.headlight.specular[:] = 0.0
    model.light_diffuse[:], model.light_ambient[:], model.light_specular[:] = 0.15, 0.0, 0.0


def _simplify(model: mujoco.MjModel, smooth: bool) -> None:
    """Draw each side of a box as one face: the light is even, and there are thousands."""
    quality = model.vis.quality
    quality.numquads, quality.numslices, quality.numstacks = 1, 16, 8
    if not smooth:
        quality.offsamples = 0


def draw_picture(path: Path, sequence: int, out: Path, allow_plugins: bool = False) -> None:
    """Draw one decision as a picture, with a stack's own costmap beside it if it gave one.

    Raises:
        InputError: The log cannot be read or has no such decision, or nothing can be drawn.
    """
    log = open_log(path, allow_plugins)
    count, own = 0, None
    with Stage(log, SIZE) as stage:
        for moment in moments(log, shown=sequence):
            stage.follow(moment)
            count += 1
            own = moment.stack_costmap or own
            if moment.decision.sequence == sequence:
                picture = drawn(stage, moment)
                if own is not None:
                    above = costmap_from_above(own, moment, SIZE[1], log.mission.radius)
                    picture = beside(picture, above)
                _write(out, picture)
                return
    if not count:
        raise InputError(f"log '{path}': no decisions in it")
    raise InputError(f"log '{path}': no decision {sequence}, expected 0 to {count - 1}")


def drawn(stage: Stage, moment: Moment) -> Image.Image:
    """Draw one moment; a failure that the log is to blame for becomes an InputError."""
    return as_input_error(f"decision {moment.decision.sequence}", lambda: stage.draw(moment))


def _write(out: Path, picture: Image.Image) -> None:
    with written_whole(out, "picture") as partial:
        picture.save(partial, format="png", optimize=True)
