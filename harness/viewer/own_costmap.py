"""A stack's own costmap from above, beside the picture of the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wayproof.harness.decision import path_of
from wayproof.harness.explain.stack_costmap import Newest, shades
from wayproof.harness.interface.types import Grid
from wayproof.harness.viewer import overlay
from wayproof.harness.viewer.caption import pixel_of
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.overlay import Colour
from wayproof.maps import FREE, UNKNOWN

REACH = 4.0
"""Distance about the robot that is shown to each side, m."""

TEXT_SIZE = 16
"""Height of the words, pixels."""

UNKNOWN_SPACE, FREE_SPACE, OCCUPIED = (
    pixel_of(overlay.FLOOR[UNKNOWN]),
    pixel_of(overlay.FLOOR[FREE]),
    (20, 20, 25),
)
"""Colours of cells; unknown and free as in the scene."""

WORDS = "white free, yellow to red by cost, black occupied, grey unknown"

Array = NDArray[np.float64]


def costmap_from_above(own: Newest, moment: Moment, size: int, radius: float) -> Image.Image:
    """Draw a stack's own costmap about the robot, with its paths; x to the right, y up.

    Args:
        own: The newest costmap of the stack.
        moment: The decision that is drawn.
        size: Width and height, pixels.
        radius: Radius of the body, m.
    """
    here = np.array(moment.decision.position[:2])
    image = Image.fromarray(_pixels(own.grid, here, size))
    draw = ImageDraw.Draw(image)
    scale = 0.5 * size / REACH

    def line(points: Array, colour: Colour, width: int) -> None:
        at = 0.5 * size + scale * (points[:, :2] - here) * (1.0, -1.0)
        draw.line([tuple(point) for point in at.tolist()], pixel_of(colour), width)

    line(path_of(moment.decision.trajectory.path), overlay.COMMITTED, 6)
    command = moment.commanded
    if command is not None:
        line(command.planned_path, overlay.PLANNED, 3)
        line(command.refused, overlay.REFUSED, 7)
    low, high = 0.5 * size - scale * radius, 0.5 * size + scale * radius
    draw.ellipse((low, low, high, high), outline=pixel_of(overlay.BELIEVED), width=3)
    text = f"the stack's own costmap, as of decision {own.sequence}\n{WORDS}"
    font = ImageFont.load_default(TEXT_SIZE)
    draw.rectangle(draw.textbbox((8, 8), text, font), fill=(255, 255, 255))
    draw.text((8, 8), text, (0, 0, 0), font)
    return image


def _pixels(grid: Grid, here: Array, size: int) -> NDArray[np.uint8]:
    """Return colours (size, size, 3) of the cells about a place; unknown beyond the costmap."""
    steps = REACH * (2.0 * (np.arange(size) + 0.5) / size - 1.0)
    across, up = (
        np.floor((here[axis] + steps - grid.origin[axis]) / grid.resolution) for axis in range(2)
    )
    ny, nx = grid.cells.shape
    inside = ((up >= 0) & (up < ny))[::-1, None] & ((across >= 0) & (across < nx))
    cells = np.full((size, size), -1, np.int8)
    rows = np.clip(up, 0, max(ny - 1, 0)).astype(int)[::-1, None]
    if grid.cells.size:
        found = grid.cells[rows, np.clip(across, 0, nx - 1).astype(int)]
        cells[inside] = found[inside]
    return shades(cells, unknown=UNKNOWN_SPACE, free=FREE_SPACE, occupied=OCCUPIED)


def beside(left: Image.Image, right: Image.Image) -> Image.Image:
    """Put two images of one height side by side."""
    both = Image.new("RGB", (left.width + right.width, left.height))
    both.paste(left, (0, 0))
    both.paste(right, (left.width, 0))
    return both
