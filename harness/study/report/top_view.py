"""An episode from above as SVG text: true geometry, true and believed track, goal, end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.scenario.outlines import outlines
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.study.report.palette import BELIEVED, CHANCE, GOAL, LIMIT, OBSTACLE, TRUE
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

Array = NDArray[np.float64]

WIDTH = 420
"""Width of the picture in units of the SVG."""

TALLEST = 420
"""Greatest height of the picture."""

BAND = 20
"""Height of the band below the drawing, which holds the scale."""

EDGE = 0.4
"""Space around the drawing, m."""


class Tracks(NamedTuple):
    """Overlay of the geometry; positions are x, y, m.

    Attributes:
        believed: (n, 2) estimated positions.
        true: (n, 2) true positions; empty where nothing knows them.
        goals: Goals, in their order.
        failed: Whether the end is marked as a failure.
        chance: True position at the last chance; None without one.
    """

    believed: Array
    true: Array
    goals: tuple[tuple[float, float], ...]
    failed: bool
    chance: tuple[float, float] | None = None


def top_view(footprints: Sequence[Array], tracks: Tracks) -> str:
    """Draw an episode from above; x to the right, y up, one scale.

    Args:
        footprints: (k, 2) outlines of the geometry, m.
        tracks: Tracks and marks.
    """
    drawn = [*footprints, tracks.believed, tracks.true, np.array(tracks.goals)]
    points = np.concatenate([one for one in drawn if len(one)])
    low, high = points.min(axis=0) - EDGE, points.max(axis=0) + EDGE
    scale = min(WIDTH / (high[0] - low[0]), TALLEST / (high[1] - low[1]))
    height = scale * (high[1] - low[1])

    def placed(some: Array) -> Array:
        return np.stack([(some[:, 0] - low[0]) * scale, (high[1] - some[:, 1]) * scale], axis=1)

    parts = [f'<polygon points="{_text(placed(one))}" fill="{OBSTACLE}"/>' for one in footprints]
    parts.append(_polyline(placed(tracks.believed), BELIEVED, ""))
    if len(tracks.true):
        parts.append(_polyline(placed(tracks.true), TRUE, ' stroke-dasharray="5 3"'))
    for number, goal in enumerate(placed(np.array(tracks.goals)), 1):
        parts.append(_ring(goal, GOAL, 7, f"goal {number}" if len(tracks.goals) > 1 else "goal"))
    ways = tracks.true if len(tracks.true) else tracks.believed
    start, end = placed(ways[[0, -1]])
    parts.append(_ring(start, TRUE, 3, "start"))
    if tracks.chance is not None:
        (chance,) = placed(np.array([tracks.chance]))
        parts.append(_ring(chance, CHANCE, 6, "last chance"))
    if tracks.failed:
        x, y = end
        parts.append(
            f'<path d="M{x - 5:.1f} {y - 5:.1f}l10 10m0 -10l-10 10" stroke="{LIMIT}" '
            'stroke-width="2.5"><title>end</title></path>'
        )
    y = height + 0.5 * BAND
    bar = f'<path d="M8 {y:.1f}h{scale:.1f}" stroke="#1a202c" stroke-width="2"/>'
    bar += f'<text x="{scale + 14:.1f}" y="{y + 4:.1f}">1 m</text>'
    return (
        f'<svg viewBox="0 0 {scale * (high[0] - low[0]):.0f} {height + BAND:.0f}" font-size="11" '
        f'fill="#4a5568" role="img">{"".join(parts)}{bar}</svg>'
    )


def _polyline(points: Array, colour: str, dash: str) -> str:
    return (
        f'<polyline points="{_text(points)}" fill="none" stroke="{colour}" '
        f'stroke-width="1.8"{dash}/>'
    )


def _ring(place: Array, colour: str, radius: float, name: str) -> str:
    x, y = place
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="none" stroke="{colour}" '
        f'stroke-width="2.5"><title>{name}</title></circle>'
    )


def _text(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def footprints(scene: str) -> list[NDArray[np.float64]]:  # (4, 2) each
    """Return the outlines from above of the world's geoms: boxes exactly, others by their bounds.

    Raises:
        InputError: The scene refers to other files, or does not compile.
    """
    text = safe_scene(scene)
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except NOT_COMPILED as error:
        raise InputError(f"scene: {' '.join(str(error).split())[:200]}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return outlines(model, data, model.body_weldid[model.geom_bodyid] == 0)
