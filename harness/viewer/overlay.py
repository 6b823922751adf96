"""Map, plans and tracks of a decision, drawn over the rendered scene."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.mission import Mission
from wayproof.harness.viewer.boxes import flat_boxes, surrounding_boxes, upright_boxes
from wayproof.harness.viewer.cutaway import cut_boxes
from wayproof.harness.viewer.layer import FRONTIER, INFLATED, kinds, layer_at
from wayproof.harness.viewer.moments import Moment, standing_low
from wayproof.maps import FREE, UNKNOWN

Colour = tuple[float, float, float, float]

FLOOR: dict[int, Colour] = {
    UNKNOWN: (0.34, 0.36, 0.42, 0.85),
    FREE: (1.0, 1.0, 1.0, 0.8),
    INFLATED: (1.0, 0.75, 0.47, 0.75),
    FRONTIER: (0.24, 0.75, 0.35, 0.9),
}
"""Colours of the kinds of cells drawn on the floor."""

OCCUPIED_COLOUR: Colour = (0.2, 0.35, 0.9, 0.22)
GLOBAL_PATH: Colour = (0.2, 0.4, 0.95, 1.0)
COMMITTED: Colour = (0.05, 0.65, 0.2, 1.0)
PLANNED: Colour = (0.55, 0.25, 0.7, 1.0)
REFUSED: Colour = (0.95, 0.05, 0.45, 1.0)
TRUE: Colour = (0.85, 0.1, 0.1, 1.0)
BELIEVED: Colour = (0.0, 0.72, 0.85, 1.0)

SKIN = 0.004
"""Extra half extent of a drawn occupied cell, m, so that its faces do not flicker with a wall's."""

SIGHT = 10.0
"""Distance from the robot up to which occupied cells are drawn, m: farther ones are mostly out of
the picture, and each costs time."""

BEYOND = 30.0
"""Width of the unknown floor drawn around the map, m: beyond the view of the camera."""

RING_SIDES = 24
"""Sides of the polygon that approximates the circle of the estimated body."""


class Tracks(NamedTuple):
    """Positions of the base up to the moment, each (3,) m, world.

    Attributes:
        true: Positions by the simulator.
        believed: Positions by the pose estimate.
    """

    true: Sequence[NDArray[np.float64]]
    believed: Sequence[NDArray[np.float64]]


class Overlay:
    """Boxes and lines added to a rendered scene, as long as it has room."""

    def __init__(self, scene: Any) -> None:
        """Add to an `mujoco.MjvScene`."""
        self._scene = scene

    def add_box(self, middle: Any, half: Any, colour: Colour) -> None:
        """Add a box with centre and half extents (3,), m."""
        geom = self._next()
        if geom is not None:
            kind = mujoco.mjtGeom.mjGEOM_BOX
            mujoco.mjv_initGeom(geom, kind, half, middle, np.eye(3).ravel(), colour)

    def add_line(self, points: Any, radius: float, colour: Colour) -> None:
        """Add a line through points (n, 3), m, with a radius, m."""
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
        if self._scene.ngeom >= self._scene.maxgeom:
            return None
        self._scene.ngeom += 1
        return self._scene.geoms[self._scene.ngeom - 1]


def lay_over(
    scene: Any, moment: Moment, mission: Mission, *, tracks: Tracks, cut_at: float
) -> None:
    """Draw the map, the plans and the tracks of a moment over a scene.

    Args:
        scene: An `mujoco.MjvScene`, which is added to.
        moment: The decision.
        mission: Its task.
        tracks: True and believed positions so far.
        cut_at: Height above which occupied cells are cut, m.
    """
    overlay = Overlay(scene)
    _lay_floor(overlay, moment)
    middles, halves = upright_boxes(moment.map, standing_low(mission), mission.high)
    middles, halves = cut_boxes(middles, halves, cut_at)
    off = middles[:, :2] - np.array(moment.truth.position)[:2]
    near = np.hypot(off[:, 0], off[:, 1]) < SIGHT
    for middle, half in zip(middles[near], halves[near], strict=True):
        overlay.add_box(middle, half + SKIN, OCCUPIED_COLOUR)
    _lay_plans(overlay, moment, mission)
    overlay.add_line(tracks.true, 0.015, TRUE)
    overlay.add_line(tracks.believed, 0.015, BELIEVED)
    overlay.add_line(_ring(tracks.believed[-1], mission.radius), 0.012, BELIEVED)


def _lay_floor(overlay: Overlay, moment: Moment) -> None:
    """Draw the layer of the robot on the floor; outside the map as unknown."""
    costmap = moment.costmap
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    found = kinds(costmap, layer, moment.record.decision.collision_distance_sq)
    size = costmap.resolution
    around = surrounding_boxes(found.shape, costmap.origin, size, BEYOND)
    pieces = [(UNKNOWN, around)]
    pieces += [(kind, flat_boxes(found == kind, costmap.origin, size)) for kind in FLOOR]
    for kind, (middles, halves) in pieces:
        for middle, half in zip(middles, halves, strict=True):
            overlay.add_box([*middle, 0.02], [*half, 0.002], FLOOR[kind])


def _lay_plans(overlay: Overlay, moment: Moment, mission: Mission) -> None:
    lift = np.array([0.0, 0.0, 0.05 if mission.planar else 0.0])
    decision, command = moment.decision, moment.commanded
    if command is None:
        overlay.add_line(path_of(decision.global_path) + lift, 0.015, GLOBAL_PATH)
    overlay.add_line(path_of(decision.trajectory.path) + lift, 0.035, COMMITTED)
    if command is not None:
        overlay.add_line(command.planned_path + lift, 0.015, PLANNED)
        overlay.add_line(command.refused + lift, 0.045, REFUSED)


def _ring(centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return a closed circle (n, 3), m, around a centre (3,), in its height."""
    angles = np.linspace(0.0, 2.0 * np.pi, RING_SIDES + 1)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    return centre + radius * around
