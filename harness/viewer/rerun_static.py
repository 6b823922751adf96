"""Static parts of an episode in Rerun: mission, styles, true scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.log.reader import Log
from wayproof.harness.mission import Mission
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.viewer import events
from wayproof.harness.viewer.true_scene import GLASS, GROUND, OBSTACLES, true_scene
from wayproof.maps import OCCUPIED
from wayproof.maps.grid import FLOOR_LAYER

GLOBAL_PATH, COMMITTED, BELIEVED, TRUE = (
    (60, 110, 235),
    (20, 170, 70),
    (0, 184, 217),
    (210, 40, 40),
)
PLANNED, REFUSED = (150, 60, 190), (235, 20, 90)
"""Colours of a stack's own plan, and of its command beyond what the referee admits."""

PRIOR = (200, 120, 0, 90)
"""Colour of the prior map: red, green, blue and opacity."""

HIT, MOVER, FAILURE = (150, 80, 200), (230, 140, 20), (255, 0, 0)
LINE = 0.02  # m
HIT_RADIUS = rr.Radius.ui_points(1.5)
EVENT_RADIUS = rr.Radius.ui_points(6.0)

SURFACES = {
    OBSTACLES: (255, 225, 150, 45),
    GLASS: (120, 220, 255, 60),
    GROUND: (190, 190, 190, 30),
    "movers": (230, 140, 20, 90),
}
"""Colours of the true scene: red, green, blue and opacity."""

CURVES = {
    "clearance/true_m": ("true clearance", 0x2E9E4FFF),
    "speed/true_m_s": ("true speed", 0xB0B0B0FF),
    "path/committed_m": ("committed path", 0x3C6EEBFF),
    "pose/error_m": ("error", 0xFF4040FF),
    "pose/margin_m": ("margin", 0x00B8D9FF),
    "heading/error_deg": ("error of the heading", 0xFF4040FF),
    "latency/sense_ms": ("sense", 0x9696A0FF),
    "latency/map_ms": ("map", 0x3C6EEBFF),
    "latency/costmap_ms": ("costmap", 0xE0A000FF),
    "latency/plan_ms": ("plan", 0x2E9E4FFF),
    "delay/delay_ms": ("delay", 0x00B8D9FF),
    "delay/deadline_ms": ("deadline", 0xFF4040FF),
}
"""Names and colours of the curves."""

BY_PROVENANCE = {
    "path/committed_unmeasured_m": ("of it not measured", 0xFF4040FF),
    "path/global_measured_m": ("global path, measured", 0x2E9E4FFF),
    "path/global_prior_m": ("global path by the prior map", 0xE0A000FF),
    "path/global_predicted_m": ("global path, predicted", 0x9650C8FF),
    "path/global_unproven_m": ("global path, by nothing", 0x9696A0FF),
}
"""Those of curves that only a log with a prior map or predictions has."""

PREDICTED = "path/global_predicted_m"

ACTIONS = {
    "follow": 0x2E9E4FFF,
    "slow": 0xE0B000FF,
    "stop_and_wait": 0xD2691EFF,
    "explore": 0x3C6EEBFF,
    "recover": 0x9650C8FF,
    "goal": 0x1E8C8CFF,
    "abort": 0xD22828FF,
}
"""Colours of actions on their lane."""

VERDICTS = {"admitted": 0x2E9E4FFF, "unknown": 0xE0A000FF, "blocked": 0xD22828FF}
"""Colours of the referee's verdicts on their lane."""


def show_static(stream: rr.RecordingStream, log: Log, root: str) -> frozenset[str]:
    """Send all that does not change; return the names of the movers that have a surface.

    Raises:
        InputError: The scene in the log cannot be compiled.
    """
    world = f"{root}/world"
    stream.log(world, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _show_bodies(stream, log.mission, world)
    _show_styles(stream, root, log.config)
    _show_prior(stream, log, world)
    return _show_scene(stream, log, world)


def _show_prior(stream: rr.RecordingStream, log: Log, world: str) -> None:
    """Show the occupied cells of the prior map."""
    cells = logged_cells(log.config)
    if cells is None:
        return
    size, found = cells.resolution, np.argwhere(cells.states == OCCUPIED)
    above = found[found[:, 2] + cells.first[2] > FLOOR_LAYER]
    centres = (cells.window.origin + (above + 0.5) * size).astype(np.float32)
    shown = rr.Points3D(centres, radii=0.3 * size, colors=PRIOR)
    stream.log(f"{world}/prior", shown, static=True)


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


def _show_bodies(stream: rr.RecordingStream, mission: Mission, world: str) -> None:
    """Show goals, estimated body and true body."""
    stream.log(
        f"{world}/goal", rr.Points3D(mission.goals, radii=0.12, colors=COMMITTED), static=True
    )
    stream.log(f"{world}/goal/words", _goal_words(mission), static=True)
    ahead = rr.Arrows3D(vectors=[[1.6 * mission.radius, 0.0, 0.0]], radii=0.03, colors=BELIEVED)
    stream.log(f"{world}/robot/ahead", ahead, static=True)
    name = words_at([0.0, 0.0, mission.height], "robot")
    stream.log(f"{world}/robot/words", name, static=True)
    for entity, colour in (("robot", BELIEVED), ("truth", TRUE)):
        stream.log(f"{world}/{entity}/body", _body(mission, colour), static=True)


def _body(mission: Mission, colour: tuple[int, int, int]) -> rr.Cylinders3D | rr.Ellipsoids3D:
    fill = rr.components.FillMode.TransparentFillMajorWireframe
    if mission.planar:
        return rr.Cylinders3D(lengths=[0.1], radii=[mission.radius], colors=colour, fill_mode=fill)
    size = [mission.radius, mission.radius, 0.5 * mission.height]
    return rr.Ellipsoids3D(half_sizes=[size], colors=colour, fill_mode=fill)


def _curves_of_layers(config: Config) -> dict[str, tuple[str, int]]:
    """Return the curves of evidence that was not measured; those of predictions with the source."""
    if not config.has_layers:
        return {}
    curves = dict(BY_PROVENANCE)
    if (source := config.prediction.source) != NO_PREDICTOR:
        words, colour = curves[PREDICTED]
        curves[PREDICTED] = f"{words} by {source}", colour
    if config.runs_predictor:
        curves["latency/predict_ms"] = "predictor, beside them", colour
    return curves


def _show_styles(stream: rr.RecordingStream, root: str, config: Config) -> None:
    lanes = {"action": ACTIONS, "verdict": VERDICTS}
    lanes["event"] = {kind: _packed(colour) for kind, colour in events.COLOURS.items()}
    for lane, colours in lanes.items():
        # An array: a list of three would be taken for one colour.
        shown = np.array(list(colours.values()), np.uint32)
        states = rr.StateConfiguration(values=list(colours), colors=shown)
        stream.log(f"{root}/{lane}", states, static=True)
    styles: dict[str, rr.AsComponents] = {
        "sweep": rr.Points3D.from_fields(radii=HIT_RADIUS, colors=HIT),
        "movers": rr.Points3D.from_fields(radii=0.25, colors=MOVER),
        "global_path": rr.LineStrips3D.from_fields(radii=LINE, colors=GLOBAL_PATH),
        "trajectory": rr.LineStrips3D.from_fields(radii=2 * LINE, colors=COMMITTED),
        "planned_path": rr.LineStrips3D.from_fields(radii=LINE, colors=PLANNED),
        "not_admitted": rr.LineStrips3D.from_fields(radii=3 * LINE, colors=REFUSED),
        "trail": rr.LineStrips3D.from_fields(radii=LINE, colors=TRUE),
        "believed_trail": rr.LineStrips3D.from_fields(radii=LINE, colors=BELIEVED),
        "pose_error": rr.LineStrips3D.from_fields(radii=LINE, colors=FAILURE),
    }
    for kind, colour in events.COLOURS.items():
        styles[f"events/{events.name_of(kind)}"] = rr.Points3D.from_fields(
            radii=EVENT_RADIUS,
            colors=colour,
            show_labels=kind != events.STOP,  # there are many
        )
    for name, style in styles.items():
        stream.log(f"{root}/world/{name}", style, static=True)
    for kind, plot in events.PLOTS.items():
        dots = rr.SeriesPoints(colors=events.COLOURS[kind], marker_sizes=4.0, names=kind)
        stream.log(f"{root}/plots/{plot}/{events.name_of(kind)}", dots, static=True)
    for curve, (name, line) in (CURVES | _curves_of_layers(config)).items():
        stream.log(f"{root}/plots/{curve}", rr.SeriesLines(colors=line, names=name), static=True)
    markdown = rr.TextDocument.from_fields(media_type="text/markdown")
    stream.log(f"{root}/decision", markdown, static=True)


def _packed(colour: tuple[int, int, int]) -> int:
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | 255


def _show_scene(stream: rr.RecordingStream, log: Log, world: str) -> frozenset[str]:
    scene = true_scene(log)
    if scene is None:
        return frozenset()
    for part, triangles in scene.still.items():
        stream.log(f"{world}/scene/{part}", _surface(triangles, SURFACES[part]), static=True)
    for name, triangles in scene.movers.items():
        surface = _surface(triangles, SURFACES["movers"])
        stream.log(f"{world}/scene/movers/{name}", surface, static=True)
    return frozenset(scene.movers)


def _surface(triangles: NDArray[np.float64], colour: tuple[int, int, int, int]) -> rr.Mesh3D:
    """Return triangles (n, 3, 3), m, as a translucent mesh, lit by their own normals."""
    along, across = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(along, across)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3).astype(np.float32),
        vertex_normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        albedo_factor=colour,
    )
