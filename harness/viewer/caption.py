"""Words of a picture: time, decision, action and clearance above it, the legend below it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from wayproof.harness.clearance import in_metres, map_clearance_is_bound, true_in_metres
from wayproof.harness.viewer import overlay
from wayproof.harness.viewer.layer import FRONTIER, INFLATED
from wayproof.harness.viewer.moments import Moment
from wayproof.harness.viewer.overlay import Colour
from wayproof.harness.viewer.words import is_warning
from wayproof.maps import FREE, UNKNOWN

ROBOT: Colour = (1.0, 0.85, 0.0, 1.0)
"""Colour of the robot."""

PAPER, INK, FAINT, WARNING = (255, 255, 255), (26, 32, 44), (90, 98, 112), (190, 30, 40)
"""Colours of the bands and of their words."""

LETTERS = 45
"""Width of a picture over the size of its letters."""

LINE = 1.35
"""Height of a line over the size of its letters."""

LINES_ABOVE, LINES_BELOW = 3, 2

Entry = tuple[str, Colour]

CELLS: tuple[Entry, ...] = (
    ("free", overlay.FLOOR[FREE]),
    ("unknown, or outside the map", overlay.FLOOR[UNKNOWN]),
    ("inflated", overlay.FLOOR[INFLATED]),
    ("frontier", overlay.FLOOR[FRONTIER]),
    ("occupied", (0.3, 0.42, 0.85, 1.0)),
)
"""Legend of the cells; occupied ones as they look over a grey wall."""

BODIES: tuple[Entry, ...] = (
    ("robot", ROBOT),
    ("true track", overlay.TRUE),
    ("believed", overlay.BELIEVED),
    ("committed", overlay.COMMITTED),
)
OURS: tuple[Entry, ...] = (("path to the goal", overlay.GLOBAL_PATH),)
ON_TRIAL: tuple[Entry, ...] = (
    ("path of the stack", overlay.PLANNED),
    ("not admitted", overlay.REFUSED),
)


def legend_colours() -> list[tuple[int, int, int]]:
    """Return the colours of all legends: red, green and blue, 0 to 255."""
    return [pixel_of(colour) for _, colour in (*CELLS, *BODIES, *OURS, *ON_TRIAL)]


def scene_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return the width and height, pixels, that the words leave to the scene of a picture."""
    width, height = size
    return width, height - _band(width, LINES_ABOVE) - _band(width, LINES_BELOW)


def captioned(scene: Image.Image, moment: Moment, cost_range: float, axes: int) -> Image.Image:
    """Return a scene with words above and below.

    Args:
        scene: Picture of `scene_size`.
        moment: The decision.
        cost_range: `costmap.cost_range` of its config, m.
        axes: Number of axes that the pose error is over: 2 on the ground, 3 in the air.
    """
    width, above = scene.width, _band(scene.width, LINES_ABOVE)
    below = _band(width, LINES_BELOW)
    picture = Image.new("RGB", (width, above + scene.height + below), PAPER)
    picture.paste(scene, (0, above))
    _head(ImageDraw.Draw(picture), head(moment, cost_range, axes), is_warning(moment.decision))
    others = OURS if moment.commanded is None else ON_TRIAL
    top = above + scene.height
    _legend(ImageDraw.Draw(picture), top, width, (CELLS, (*BODIES, *others)))
    return picture


def head(moment: Moment, cost_range: float, axes: int) -> tuple[str, str, str]:
    """Return three lines: time, decision, action and label; figures; reason.

    Args:
        moment: The decision.
        cost_range: `costmap.cost_range` of its config, m.
        axes: Number of axes that the pose error is over: 2 on the ground, 3 in the air.
    """
    decision, truth = moment.decision, moment.truth
    label = "" if decision.label == "none" else f" [{decision.label}]"
    first = f"{moment.time_ns * 1e-9:.1f} s   decision {decision.sequence}   "
    first += f"{decision.action}{label}"
    mapped = in_metres(decision.least_clearance_m, map_clearance_is_bound(decision, cost_range))
    off = math.dist(moment.record.inputs.pose.position[:axes], truth.position[:axes])
    known = not math.isnan(truth.clearance_m)  # a recording has no truth
    now = f"{true_in_metres(truth.clearance_m)}, " if known else ""
    figures = f"clearance {now}in the map along the path {mapped}; pose error {off:.2f} m"
    reason = decision.reason
    if moment.commanded is not None:
        reason = f"referee: {moment.commanded.verdict}. {reason}"
    return first, figures, reason


def _head(draw: ImageDraw.ImageDraw, lines: Sequence[str], warns: bool) -> None:
    width = draw.im.size[0]
    font, indent = _font(width), _letter(width) // 2
    colours = (WARNING if warns else INK, INK, FAINT)
    for number, (words, colour) in enumerate(zip(lines, colours, strict=True)):
        fitting = _shortened(draw, words, font, width - 2 * indent)
        draw.text((indent, _line(width, number)), fitting, colour, font)


def _legend(
    draw: ImageDraw.ImageDraw, top: int, width: int, rows: Sequence[Sequence[Entry]]
) -> None:
    letter, font = _letter(width), _font(width)
    for number, entries in enumerate(rows):
        x, y = letter // 2, top + _line(width, number)
        for name, colour in entries:
            swatch = (x, y + letter // 6, x + letter, y + letter)
            draw.rectangle(swatch, pixel_of(colour), FAINT)
            x += round(1.4 * letter)
            draw.text((x, y), name, INK, font)
            x += round(draw.textlength(name, font)) + letter


def _shortened(
    draw: ImageDraw.ImageDraw, words: str, font: ImageFont.FreeTypeFont, width: int
) -> str:
    """Return the words, or as many of their letters as are no wider than a width, pixels."""
    if draw.textlength(words, font) <= width:
        return words
    while words and draw.textlength(f"{words}...", font) > width:
        words = words[:-1]
    return f"{words}..."


def _font(width: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(_letter(width))
    assert isinstance(font, ImageFont.FreeTypeFont)  # that of a size
    return font


def _letter(width: int) -> int:
    return width // LETTERS


def _line(width: int, number: int) -> int:
    """Return the offset of a line in its band, pixels."""
    return round((number * LINE + 0.25) * _letter(width))


def _band(width: int, lines: int) -> int:
    """Return the height of a band of lines, pixels."""
    return round((lines * LINE + 0.35) * _letter(width))


def pixel_of(colour: Colour) -> tuple[int, int, int]:
    """Return a colour as it looks over a pale floor: red, green and blue, 0 to 255."""
    *shade, alpha = colour
    red, green, blue = np.rint(255 * (alpha * np.array(shade) + (1 - alpha) * 0.8)).astype(int)
    return int(red), int(green), int(blue)
