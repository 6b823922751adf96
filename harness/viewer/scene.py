"""What the viewers show of a log in space: named shapes, in one list for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.goals import mission_towards
from wayproof.harness.log.reader import Log
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.result import RECORDED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer import colours, events
from wayproof.harness.viewer.colours import Colour, Shade
from wayproof.harness.viewer.layer import palette, shades
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.snapshots import MOST_HITS, Layer, Snapshot, tiles_of
from wayproof.harness.viewer.true_scene import true_scene
from wayproof.maps import OCCUPIED
from wayproof.maps.grid import FLOOR_LAYER

Array = NDArray[np.float64]

WIDTH = 0.04
"""Width of a line, m."""

FRAMES = ("robot", "truth")
"""Names of the frames of the estimated and the true body: `robot/body` moves with `robot`."""

CELLS = "cells/"
"""Beginning of the names of the tiles of occupied cells."""

EVENTS = "events/"
"""Beginning of the names of events; each stays where it was."""


class Frame(NamedTuple):
    """Pose of a frame in the world: (3,) m, and a quaternion w x y z."""

    position: Sequence[float]
    quaternion: Sequence[float]


class Line(NamedTuple):
    """Line through points (n, 3), m, with a width, m."""

    points: Array
    width: float
    colour: Colour


class Balls(NamedTuple):
    """Balls at places (n, 3), m, of a diameter, m, or marks if 0; words for each, or none."""

    places: Array
    diameter: float
    colour: Colour
    words: Sequence[str] = ()


class Body(NamedTuple):
    """Ellipsoid about the origin of a frame, through which one sees: diameters (3,), m."""

    size: tuple[float, float, float]
    colour: Colour


class Cloud(NamedTuple):
    """Points (n, 3), m, with a diameter, m, or a few pixels if 0; without a colour by height."""

    points: Array
    diameter: float
    colour: Colour | Shade | None = None


class Grid(NamedTuple):
    """Colours (ny, nx, 3) of cells on the floor, least y first: corner (2,) and edge, m."""

    cells: NDArray[np.uint8]
    corner: Array
    side: float


class Surface(NamedTuple):
    """Triangles (n, 3, 3), m, in the frame of a pose.

    Attributes:
        triangles: The corners of each.
        part: One of those of `colours.SURFACES`.
        pose: None in the world's frame, where it stands still.
        present: Whether it is shown.
    """

    triangles: Array
    part: str
    pose: Frame | None = None
    present: bool = True


Shape = Frame | Line | Balls | Body | Cloud | Grid | Surface
Named = tuple[str, Shape]
"""A shape and its name, by which it takes the place of an earlier one."""


class Artist:
    """Shapes of each moment of a log; unchanged ones are not repeated.

    Attributes:
        log: The log.
        events: Its events.
        found: Events of the newest decision.
    """

    def __init__(self, log: Log) -> None:
        """Compile the true scene.

        Raises:
            InputError: The scene in the log cannot be compiled.
        """
        self.log, self.events = log, events.Events(log)
        self.found: list[events.Event] = []
        self._tiles, self._scene = tiles_of(log), true_scene(log)
        self._layer: NDArray[np.uint8] | None = None
        self._last = -1

    def still(self) -> Iterator[Named]:
        """Yield what stays as it is."""
        mission = self.log.mission
        numbers: dict[tuple[float, float, float], list[str]] = {}
        for number, goal in enumerate(mission.goals, 1):
            numbers.setdefault(goal, []).append(str(number))
        several = len(mission.goals) > 1
        words = [f"goal {', '.join(some)}" if several else "goal" for some in numbers.values()]
        yield "goals", Balls(np.array(list(numbers)), 0.25, colours.COMMITTED, words)
        high = 0.1 if mission.planar else mission.height
        size = 2.0 * mission.radius, 2.0 * mission.radius, high
        yield "robot/body", Body(size, colours.BELIEVED)
        yield "truth/body", Body(size, colours.TRUE)
        ahead = np.array([[0.0, 0.0, 0.0], [1.6 * mission.radius, 0.0, 0.0]])
        yield "robot/ahead", Line(ahead, 1.5 * WIDTH, colours.BELIEVED)
        if (cells := logged_cells(self.log.config)) is not None:
            size_m, occupied = cells.resolution, np.argwhere(cells.states == OCCUPIED)
            above = occupied[occupied[:, 2] + cells.first[2] > FLOOR_LAYER]
            centres = cells.window.origin + (above + 0.5) * size_m
            yield "prior", Cloud(centres, 0.6 * size_m, colours.PRIOR)
        for part, triangles in ({} if self._scene is None else self._scene.still).items():
            yield f"scene/{part}", Surface(triangles, part)

    def shapes(self, snapshot: Snapshot) -> Iterator[Named]:
        """Yield what changes at a moment."""
        moment, layer = snapshot.moment, snapshot.layer
        if moment.decision.sequence != self._last:
            self._last = moment.decision.sequence
            yield from self._plan(moment)
            yield from self.movers(moment.truth)
            yield from self.marks(moment.decision, moment.truth)
        if layer is not None:
            yield from self._grids(layer)
        if snapshot.with_costmap and moment.stack_costmap is not None:
            own = moment.stack_costmap.grid
            yield "stack_costmap", Grid(shades(own.cells), own.origin, own.resolution)
        if snapshot.with_hits:
            yield "sweep", Cloud(moment.hits(MOST_HITS), 0.0, colours.HIT)
        for tile in snapshot.tiles:
            centres = self._tiles.centres(tile)
            yield f"{CELLS}{tile.name}", Cloud(centres, self.log.config.map.resolution)

    def movers(self, truth: pb.Truth) -> Iterator[Named]:
        """Yield the movers where they are."""
        known: Mapping[str, Array] = {} if self._scene is None else self._scene.movers
        for mover in truth.movers:
            if mover.name in known:
                pose = Frame(mover.position, mover.quaternion)
                surface = Surface(known[mover.name], colours.MOVERS, pose, mover.present)
                yield f"scene/movers/{mover.name}", surface

    def marks(self, decision: pb.Decision, truth: pb.Truth) -> Iterator[Named]:
        """Yield the marks of a decision's events."""
        self.found = list(self.events.at(decision, truth))
        for event in self.found:
            words = [] if event.kind == events.STOP else [event.mark]  # of stops there are many
            yield self.mark(event.kind, truth.position, words)

    def mark(self, kind: str, place: ArrayLike, words: Sequence[str]) -> Named:
        """Return the mark of an event at a place (3,), m."""
        ball = Balls(np.array([place]), 0.0, events.COLOURS[kind], words)
        return f"{EVENTS}{events.name_of(kind)}", ball

    def ending(self, last: Moment, result: Mapping[str, str]) -> Iterator[Named]:
        """Yield the mark of a failure, at the last moment."""
        if result["outcome"] not in ("success", RECORDED):
            words = f"{result['outcome']}: {result.get('reason', '')}"
            yield "failure", Balls(np.array([last.truth.position]), 0.5, colours.FAILURE, [words])

    def _plan(self, moment: Moment) -> Iterator[Named]:
        """Yield the poses, the paths, and the error of the pose."""
        decision, truth, command = moment.decision, moment.truth, moment.commanded
        pose, goal = moment.record.inputs.pose, moment.record.inputs.goal
        yield "robot", Frame(pose.position.tolist(), pose.quaternion.tolist())
        yield "truth", Frame(truth.position, truth.quaternion)
        if command is None:
            yield "global_path", Line(path_of(decision.global_path), WIDTH, colours.GLOBAL_PATH)
        else:
            yield "planned_path", Line(command.planned_path, WIDTH, colours.PLANNED)
            yield "not_admitted", Line(command.refused, 3.0 * WIDTH, colours.REFUSED)
        committed = path_of(decision.trajectory.path)
        yield "trajectory", Line(committed, 2.0 * WIDTH, colours.COMMITTED)
        error = np.array([truth.position, pose.position])
        yield "pose_error", Line(error, WIDTH, colours.FAILURE)
        if goal is not None:
            towards = mission_towards(self.log.mission, goal).goal
            yield "goal", Balls(np.array([towards]), 0.3, colours.COMMITTED)

    def _grids(self, layer: Layer) -> Iterator[Named]:
        """Yield a layer if it differs from the last one, and its evidence if it has any."""
        if layer.evidence is not None:
            for name, image in layer.evidence.images().items():
                yield name, Grid(image, layer.corner, layer.resolution)
        if self._layer is None or not np.array_equal(self._layer, layer.kinds):
            self._layer = layer.kinds
            yield "layer", Grid(palette()[layer.kinds.T], layer.corner, layer.resolution)
