"""Static parts of an episode in Rerun: mission, styles, true scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.log.reader import Log
from wayproof.harness.mission import Mission
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.viewer import colours, events
from wayproof.harness.viewer.colours import packed
from wayproof.harness.viewer.curves import styles
from wayproof.harness.viewer.true_scene import true_scene
from wayproof.maps import OCCUPIED
from wayproof.maps.grid import FLOOR_LAYER

PRIOR = (200, 120, 0, 90)
"""Colour of the prior map: red, green, blue and opacity."""

HIT, MOVER, FAILURE = (150, 80, 200), (230, 140, 20), (255, 0, 0)
LINE = 0.02  # m
HIT_RADIUS = rr.Radius.ui_points(1.5)
EVENT_RADIUS = rr.Radius.ui_points(6.0)

LANES = {
    "action": {
        "follow": 0x2E9E4FFF,
        "slow": 0xE0B000FF,
        "stop_and_wait": 0xD2691EFF,
        "explore": 0x3C6EEBFF,
        "recover": 0x9650C8FF,
        "goal": 0x1E8C8CFF,
        "abort": 0xD22828FF,
    },
    "verdict": {"admitted": 0x2E9E4FFF, "unknown": 0xE0A000FF, "blocked": 0xD22828FF},
    "event": {kind: packed(colour) for kind, colour in events.COLOURS.items()},
}
"""Colours of the states of the lanes."""

LINES = {
    "global_path": (LINE, colours.GLOBAL_PATH),
    "trajectory": (2 * LINE, colours.COMMITTED),
    "planned_path": (LINE, colours.PLANNED),
    "not_admitted": (3 * LINE, colours.REFUSED),
    "trail": (LINE, colours.TRUE),
    "believed_trail": (LINE, colours.BELIEVED),
    "pose_error": (LINE, FAILURE),
}
"""Radii, m, and colours of lines."""


def show_static(stream: rr.RecordingStream, log: Log, root: str) -> frozenset[str]:
    """Send all that does not change; return the names of the movers that have a surface.

    Raises:
        InputError: The scene in the log cannot be compiled.
    """
    world, mission = f"{root}/world", log.mission
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    parts: dict[str, rr.AsComponents] = {
        "goal": rr.Points3D(mission.goals, radii=0.12, colors=colours.COMMITTED),
        "goal/words": _goal_words(mission),
        "robot/ahead": rr.Arrows3D(
            vectors=[[1.6 * mission.radius, 0.0, 0.0]], radii=0.03, colors=colours.BELIEVED
        ),
        "robot/words": words_at([0.0, 0.0, mission.height], "robot"),
        "robot/body": _body(mission, colours.BELIEVED),
        "truth/body": _body(mission, colours.TRUE),
        "sweep": rr.Points3D.from_fields(radii=HIT_RADIUS, colors=HIT),
        "movers": rr.Points3D.from_fields(radii=0.25, colors=MOVER),
    }
    for name, (radius, colour) in LINES.items():
        parts[name] = rr.LineStrips3D.from_fields(radii=radius, colors=colour)
    for kind, colour in events.COLOURS.items():
        parts[f"events/{events.name_of(kind)}"] = rr.Points3D.from_fields(
            radii=EVENT_RADIUS,
            colors=colour,
            show_labels=kind != events.STOP,  # there are many
        )
    if (prior := _prior(log)) is not None:
        parts["prior"] = prior
    scene = true_scene(log)
    movers = {} if scene is None else scene.movers
    for part, triangles in ({} if scene is None else scene.still).items():
        parts[f"scene/{part}"] = _surface(triangles, colours.SURFACES[part])
    for name, triangles in movers.items():
        shade = colours.SURFACES[colours.MOVERS]
        parts[f"scene/movers/{name}"] = _surface(triangles, shade)
    for name, content in parts.items():
        stream.log(f"{world}/{name}", content, static=True)
    show_lanes(stream, root, LANES)
    for kind, plot in events.PLOTS.items():
        dots = rr.SeriesPoints(colors=events.COLOURS[kind], marker_sizes=4.0, names=kind)
        stream.log(f"{root}/plots/{plot}/{events.name_of(kind)}", dots, static=True)
    for curve, (name, line) in styles(log.config).items():
        stream.log(f"{root}/plots/{curve}", rr.SeriesLines(colors=line, names=name), static=True)
    return frozenset(movers)


def show_lanes(
    stream: rr.RecordingStream, root: str, lanes: Mapping[str, Mapping[str, int]]
) -> None:
    """Send the colours of the states of lanes."""
    for lane, states in lanes.items():
        # An array: a list of three would be taken for one colour.
        shown = np.array(list(states.values()), np.uint32)
        look = rr.StateConfiguration(values=list(states), colors=shown)
        stream.log(f"{root}/{lane}", look, static=True)


def _prior(log: Log) -> rr.Points3D | None:
    """Return the occupied cells of the prior map; None without one."""
    cells = logged_cells(log.config)
    if cells is None:
        return None
    size, found = cells.resolution, np.argwhere(cells.states == OCCUPIED)
    above = found[found[:, 2] + cells.first[2] > FLOOR_LAYER]
    centres = (cells.window.origin + (above + 0.5) * size).astype(np.float32)
    return rr.Points3D(centres, radii=0.3 * size, colors=PRIOR)


def words_at(place: Sequence[float], words: str) -> rr.Points3D:
    """Return a separate label, which is readable on any colour of its object."""
    return rr.Points3D([list(place)], radii=0.02, colors=(255, 255, 255), labels=[words])


def _goal_words(mission: Mission) -> rr.Points3D:
    """Return the labels of the goals: the numbers of those at one place in one label."""
    if not mission.waypoints:
        return words_at(mission.goal, "goal")
    numbers: dict[tuple[float, float, float], list[str]] = {}
    for number, goal in enumerate(mission.goals, 1):
        numbers.setdefault(goal, []).append(str(number))
    labels = [f"goal {', '.join(some)}" for some in numbers.values()]
    return rr.Points3D(list(numbers), radii=0.02, colors=(255, 255, 255), labels=labels)


def _body(mission: Mission, colour: colours.Colour) -> rr.Cylinders3D | rr.Ellipsoids3D:
    fill = rr.components.FillMode.TransparentFillMajorWireframe
    if mission.planar:
        return rr.Cylinders3D(lengths=[0.1], radii=[mission.radius], colors=colour, fill_mode=fill)
    size = [mission.radius, mission.radius, 0.5 * mission.height]
    return rr.Ellipsoids3D(half_sizes=[size], colors=colour, fill_mode=fill)


def _surface(triangles: NDArray[np.float64], colour: colours.Shade) -> rr.Mesh3D:
    """Return triangles (n, 3, 3), m, as a translucent mesh, lit by their own normals."""
    along, across = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(along, across)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3).astype(np.float32),
        vertex_normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        albedo_factor=colour,
    )
