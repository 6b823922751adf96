"""Picture of the simulated scene from behind the robot, with the map of the decision as an overlay.

Joints are those of the logged state of the simulator. Without it the base is at its true pose and
the legs are at rest.
"""

from __future__ import annotations

import itertools
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
from wayproof.harness.stack.decision import path_of
from wayproof.harness.viewer.boxes import flat_boxes, surrounding_boxes, upright_boxes
from wayproof.harness.viewer.cutaway import cut_boxes, cut_scene
from wayproof.harness.viewer.layer import COLOURS, FRONTIER, INFLATED, kinds, layer_at
from wayproof.harness.viewer.moments import Moment, moments, standing_low
from wayproof.harness.viewer.sight import geoms_in_front
from wayproof.maps import UNKNOWN
from wayproof.models.sensors.caster import ROBOT_GROUP

SIZE = (960, 640)
"""Width and height of a picture, pixels."""

MOST_GEOMS = 60_000

OVERLAY = {UNKNOWN: 0.6, INFLATED: 0.55, FRONTIER: 0.9}
"""Opacity of the kinds of cells drawn on the floor."""

OCCUPIED_COLOUR = (0.2, 0.35, 0.9, 0.22)
GLOBAL_PATH, COMMITTED = (0.2, 0.4, 0.95, 1.0), (0.05, 0.65, 0.2, 1.0)
PLANNED, REFUSED = (0.55, 0.25, 0.7, 1.0), (0.95, 0.05, 0.45, 1.0)
TRAIL = (0.85, 0.1, 0.1, 1.0)

DISTANCE, ELEVATION = 2.3, -38.0
"""Distance of the camera from the robot, m, and its pitch, degrees."""

CUT_ABOVE = 0.15
"""Height above the robot's base at which walls and cells are cut, m."""

SKIN = 0.004
"""Extra half extent of a drawn occupied cell, m, so that its faces do not flicker with a wall's."""

SIGHT = 10.0
"""Distance from the robot up to which occupied cells are drawn, m: farther ones are mostly out of
the picture, and each costs time."""

BEYOND = 30.0
"""Width of the unknown floor drawn around the map, m: beyond the view of the camera."""

IN_FRONT = 0.12
"""Opacity of geometry between camera and robot."""

Box = NDArray[np.float64]


class Stage:
    """Renderer of the scene of one log."""

    def __init__(self, log: Log, size: tuple[int, int], smooth: bool = True) -> None:
        """Compile the scene of a log and open an offscreen renderer.

        Args:
            log: The log.
            size: Width and height, pixels.
            smooth: Whether edges are smoothed, which takes most of the time without a GPU.

        Raises:
            InputError: The scene is not one of this robot, or nothing can be drawn.
        """
        self._scenario: Scenario = rebuild(log)
        self._model = model = self._scenario.scene.model
        self._data = mujoco.MjData(model)
        self._log = log
        self._trail: list[NDArray[np.float64]] = []
        model.vis.global_.offwidth, model.vis.global_.offheight = size
        _dim(model)
        _simplify(model, smooth)
        self._colours, self._materials = model.geom_rgba.copy(), model.geom_matid.copy()
        self._robot = frozenset(np.flatnonzero(model.geom_group == ROBOT_GROUP).tolist())
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 1  # also those of the robot
        self._options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = 0
        try:
            self._renderer: Any = mujoco.Renderer(model, size[1], size[0], max_geom=MOST_GEOMS)
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
        """Record the true position; call for every moment, drawn or not."""
        self._trail.append(np.array(moment.truth.position))

    def draw(self, moment: Moment) -> Image.Image:
        """Draw one moment."""
        self._pose(moment)
        camera = self._camera(moment)
        self._see_through(camera)
        self._renderer.update_scene(self._data, camera, self._options)
        cut_scene(self._renderer.scene, self._cut_at(moment), self._robot)
        self._lay_over(moment)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._renderer.scene.flags[flag] = 0  # overlay boxes cast no shadows
        return Image.fromarray(self._renderer.render())

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
        """Return a camera behind the robot along the line from start to goal; it does not sway."""
        mission = self._log.mission
        along = math.atan2(mission.goal[1] - mission.start[1], mission.goal[0] - mission.start[0])
        camera = mujoco.MjvCamera()
        camera.lookat[:] = moment.truth.position
        camera.azimuth, camera.elevation = math.degrees(along), ELEVATION
        camera.distance = DISTANCE
        return camera

    def _cut_at(self, moment: Moment) -> float:
        """Return the height above which nothing is drawn, m."""
        return float(moment.truth.position[2]) + CUT_ABOVE

    def _see_through(self, camera: mujoco.MjvCamera) -> None:
        """Fade geometry between the camera and the robot."""
        colours = self._model.geom_rgba
        colours[:], self._model.geom_matid[:] = self._colours, self._materials
        radius = self._log.mission.radius
        colours[geoms_in_front(self._model, self._data, camera, radius), 3] = IN_FRONT

    def _lay_over(self, moment: Moment) -> None:
        costmap, mission = moment.costmap, self._log.mission
        layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
        found = kinds(costmap, layer, moment.record.decision.collision_distance_sq)
        self._lay_flat(
            *surrounding_boxes(found.shape, costmap.origin, costmap.resolution, BEYOND),
            UNKNOWN,
        )
        for kind in OVERLAY:
            self._lay_flat(*flat_boxes(found == kind, costmap.origin, costmap.resolution), kind)
        middles, halves = upright_boxes(moment.map, standing_low(mission), mission.high)
        middles, halves = cut_boxes(middles, halves, self._cut_at(moment))
        off = middles[:, :2] - np.array(moment.truth.position)[:2]
        near = np.hypot(off[:, 0], off[:, 1]) < SIGHT
        for middle, half in zip(middles[near], halves[near], strict=True):
            self._add_box(middle, half + SKIN, OCCUPIED_COLOUR)
        lift = np.array([0.0, 0.0, 0.05 if mission.planar else 0.0])
        decision = moment.decision
        command = moment.commanded
        if command is None:
            self._add_line(path_of(decision.global_path) + lift, 0.015, GLOBAL_PATH)
        self._add_line(path_of(decision.trajectory.path) + lift, 0.035, COMMITTED)
        if command is not None:
            self._add_line(command.planned_path + lift, 0.015, PLANNED)
            self._add_line(command.refused + lift, 0.045, REFUSED)
        self._add_line(np.array(self._trail), 0.015, TRAIL)

    def _lay_flat(self, middles: Box, halves: Box, kind: int) -> None:
        """Draw boxes on the floor in the colour of a kind of cells."""
        colour = (*(value / 255.0 for value in COLOURS[kind]), OVERLAY[kind])
        for middle, half in zip(middles, halves, strict=True):
            self._add_box([*middle, 0.02], [*half, 0.002], colour)

    def _add_box(self, middle: Any, half: Any, colour: tuple[float, ...]) -> None:
        geom = self._next()
        if geom is not None:
            mujoco.mjv_initGeom(
                geom, mujoco.mjtGeom.mjGEOM_BOX, half, middle, np.eye(3).ravel(), colour
            )

    def _add_line(self, points: Box, radius: float, colour: tuple[float, ...]) -> None:
        nothing = np.zeros(3)
        for start, end in itertools.pairwise(points):
            geom = self._next()
            if geom is None:
                return
            capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
            mujoco.mjv_initGeom(geom, capsule, nothing, nothing, np.eye(3).ravel(), colour)
            mujoco.mjv_connector(geom, capsule, radius, start, end)

    def _next(self) -> Any:
        """Return the next free geom of the scene; None if the scene is full."""
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return None
        scene.ngeom += 1
        return scene.geoms[scene.ngeom - 1]


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
    """Draw one decision as a picture.

    Raises:
        InputError: The log cannot be read or has no such decision, or nothing can be drawn.
    """
    log = open_log(path, allow_plugins)
    count = 0
    with Stage(log, SIZE) as stage:
        for moment in moments(log):
            stage.follow(moment)
            count += 1
            if moment.decision.sequence == sequence:
                _write(out, drawn(stage, moment))
                return
    raise InputError(f"log '{path}': no decision {sequence}, expected 0 to {count - 1}")


def drawn(stage: Stage, moment: Moment) -> Image.Image:
    """Draw one moment; a failure that the log is to blame for becomes an InputError."""
    return as_input_error(f"decision {moment.decision.sequence}", lambda: stage.draw(moment))


def _write(out: Path, picture: Image.Image) -> None:
    with written_whole(out, "picture") as partial:
        picture.save(partial, format="png", optimize=True)
