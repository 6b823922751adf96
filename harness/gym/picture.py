"""Picture of an environment from above: true geometry, body, goal, and the scan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

Array = NDArray[np.float64]

SIZE = 480
"""Longer edge of a picture, pixels."""

COLOURS = {"obstacle": "#b8bfc8", "goal": "#2f855a", "body": "#1f77d0", "scan": "#d1232a"}


def draw(
    outlines: list[Array],
    extent: tuple[Array, Array],
    goal: Array,
    body: tuple[Array, float, float],
    returns: Array,
) -> NDArray[np.uint8]:
    """Return a picture (rows, columns, 3), x to the right and y up.

    Args:
        outlines: (k, 2) outlines of the geometry, m.
        extent: Lowest and highest x, y that are drawn, m.
        goal: (2,) m.
        body: True position (2,), m, heading, rad, and radius, m.
        returns: (n, 2) nearest return in each direction, m.
    """
    low, high = extent
    scale = SIZE / float((high - low).max())
    width, height = np.ceil(scale * (high - low)).astype(int).tolist()
    image = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(image)

    def placed(points: Array) -> list[tuple[float, float]]:
        shown = np.stack([points[..., 0] - low[0], high[1] - points[..., 1]], axis=-1) * scale
        return [(x, y) for x, y in np.atleast_2d(shown).tolist()]

    def ring(centre: Array, radius: float, colour: str, **more: str) -> None:
        ((x, y),) = placed(centre)
        r = max(scale * radius, 2.0)
        pen.ellipse((x - r, y - r, x + r, y + r), outline=colour, width=2, **more)

    for one in outlines:
        pen.polygon(placed(one), fill=COLOURS["obstacle"])
    for one in returns:
        ring(one, 0.0, COLOURS["scan"])
    position, heading, radius = body
    ring(goal, 0.3, COLOURS["goal"])
    ring(position, radius, COLOURS["body"])
    nose = position + radius * np.array([np.cos(heading), np.sin(heading)])
    pen.line(placed(np.stack([position, nose])), fill=COLOURS["body"], width=2)
    return np.asarray(image)
