"""True scene, evidence and events of a log as messages of Foxglove."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from wayproof.harness.log.reader import Log
from wayproof.harness.mission import Mission
from wayproof.harness.schema import foxglove_pb2 as fox
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.events import COLOURS, STOP, Events
from wayproof.harness.viewer.evidence import age_pixels, evidence_at, probability_pixels
from wayproof.harness.viewer.foxglove_shapes import (
    WORLD,
    Colour,
    ball,
    colour_of,
    coloured_grid,
    label,
    pose_at,
)
from wayproof.harness.viewer.layer import layer_at
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.true_scene import GLASS, GROUND, OBSTACLES, true_scene

Array = NDArray[np.float64]

SURFACES: dict[str, tuple[Colour, float]] = {
    OBSTACLES: ((1.0, 0.88, 0.59), 0.2),
    GLASS: ((0.47, 0.86, 1.0), 0.25),
    GROUND: ((0.75, 0.75, 0.75), 0.12),
}
"""Colours of the true scene, and opacity."""

MOVERS: tuple[Colour, float] = ((0.9, 0.55, 0.08), 0.35)

OPACITY = 230
"""Opacity of grids on the floor, 0 to 255."""


class TrueScene:
    """The true scene: static geometry once, movers at every decision."""

    def __init__(self, log: Log) -> None:
        """Read the scene.

        Raises:
            InputError: The scene in the log cannot be compiled.
        """
        self._scene = true_scene(log)
        self._sent = False

    def update(self, truth: pb.Truth, stamp: Timestamp) -> fox.SceneUpdate | None:
        """Return the changes of the scene at a decision; None without any."""
        if self._scene is None:
            return None
        entities = []
        if not self._sent:
            self._sent = True
            for part, triangles in self._scene.still.items():
                entities.append(_surface(part, triangles, pose_at(0.0, 0.0, 0.0), SURFACES[part]))
        for mover in truth.movers:
            triangles = self._scene.movers.get(mover.name, np.empty((0, 3, 3)))
            if not mover.present:
                triangles = triangles[:0]  # replaces what was shown under its name
            pose = pose_at(*mover.position)
            w, x, y, z = mover.quaternion
            pose.orientation.CopyFrom(fox.Quaternion(x=x, y=y, z=z, w=w))
            entities.append(_surface(f"mover {mover.name}", triangles, pose, MOVERS))
        for entity in entities:
            entity.timestamp.CopyFrom(stamp)
        return fox.SceneUpdate(entities=entities) if entities else None


class EventMarks:
    """Marks of the events of a log; each stays where it is."""

    def __init__(self, log: Log) -> None:
        """Begin at the first decision."""
        self._events = Events(log)
        self._count = 0

    def update(self, moment: Moment) -> fox.SceneUpdate | None:
        """Return the marks of a decision; None if it has no event. Call for each."""
        update = fox.SceneUpdate()
        x, y, z = moment.truth.position
        for event in self._events.at(moment.decision, moment.truth):
            red, green, blue = (value / 255.0 for value in COLOURS[event.kind])
            colour = red, green, blue
            mark = fox.SceneEntity(
                timestamp=moment.decision.timestamp, frame_id=WORLD, id=f"event {self._count}"
            )
            mark.spheres.append(ball((x, y, z), 0.2, colour, 1.0))
            if event.kind != STOP:  # there are many
                mark.texts.append(label((x, y, z), event.mark, colour, 0.4))
            update.entities.append(mark)
            self._count += 1
        return update if update.entities else None


def evidence_grids(moment: Moment, mission: Mission) -> Iterator[tuple[str, fox.Grid]]:
    """Yield the age and the probability of the layer of the robot as grids, with their topics."""
    costmap = moment.costmap
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    evidence = evidence_at(moment.map, costmap, layer, mission, moment.time_ns)
    x, y = (float(value) for value in costmap.origin[:2])
    for topic, image in (
        ("/viz/age", age_pixels(evidence.age_s)),
        ("/viz/probability", probability_pixels(evidence.probability)),
    ):
        opaque = np.full((*image.shape[:2], 1), OPACITY, np.uint8)
        colours = np.concatenate([image, opaque], axis=2)[::-1]  # a grid has the least y first
        yield (
            topic,
            coloured_grid(colours, x, y, side=costmap.resolution, stamp=moment.decision.timestamp),
        )


def _surface(
    name: str, triangles: Array, pose: fox.Pose, colour: tuple[Colour, float]
) -> fox.SceneEntity:
    """Return triangles (n, 3, 3), m, in the frame of a pose."""
    entity = fox.SceneEntity(frame_id=WORLD, id=name)
    if len(triangles):
        surface = fox.TriangleListPrimitive(pose=pose, color=colour_of(*colour))
        for x, y, z in triangles.reshape(-1, 3).tolist():
            surface.points.add(x=x, y=y, z=z)
        entity.triangles.append(surface)
    return entity
