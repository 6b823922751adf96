"""Colours that all viewers share: red, green and blue, 0 to 255."""

from __future__ import annotations

Colour = tuple[int, int, int]
Shade = tuple[int, int, int, int]

GLOBAL_PATH, COMMITTED = (60, 110, 235), (20, 170, 70)
BELIEVED, TRUE = (0, 184, 217), (210, 40, 40)
PLANNED, REFUSED = (150, 60, 190), (235, 20, 90)
"""Colours of a stack's own plan, and of its command beyond what the referee admits."""

ROBOT, MARK = (255, 212, 0), (208, 0, 208)
HIT, FAILURE = (150, 80, 200), (255, 0, 0)
PRIOR: Shade = (200, 120, 0, 90)

OBSTACLES, GLASS, GROUND, MOVERS = "obstacles", "glass", "floor", "movers"
"""Parts of a scene: glass is what no beam meets; the floor is what may be stepped on, unless it is
a plane."""

SURFACES: dict[str, Shade] = {
    OBSTACLES: (255, 225, 150, 45),
    GLASS: (120, 220, 255, 60),
    GROUND: (190, 190, 190, 30),
    MOVERS: (230, 140, 20, 90),
}
"""Colours of the true scene, and opacity."""


def packed(colour: Colour) -> int:
    """Return a colour as 0xRRGGBBAA, opaque."""
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | 255


def shares(colour: Colour) -> tuple[float, float, float]:
    """Return a colour as shares of red, green and blue, 0 to 1."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0
