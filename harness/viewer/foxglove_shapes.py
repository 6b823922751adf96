"""Parts of Foxglove's messages: grids, lines, balls, colours, poses."""

from __future__ import annotations

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from wayproof.harness.schema import foxglove_pb2 as fox

WORLD, ROBOT, TRUTH = "world", "robot", "truth"
"""Names of the frames."""

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

BLUE, GREEN, RED = (0.24, 0.43, 0.92), (0.08, 0.67, 0.27), (0.82, 0.16, 0.16)
PURPLE, PINK = (0.59, 0.24, 0.75), (0.92, 0.08, 0.35)


def coloured_grid(
    colours: NDArray[np.uint8], x: float, y: float, side: float, stamp: Timestamp
) -> fox.Grid:
    """Return a grid on the floor.

    Args:
        colours: (ny, nx, 4) red, green, blue and opacity of its cells.
        x: Coordinate x of the lower corner of its first cell, m, world.
        y: Coordinate y of that corner, m, world.
        side: Edge of a cell, m.
        stamp: Time.
    """
    columns = colours.shape[1]
    return fox.Grid(
        timestamp=stamp,
        frame_id=WORLD,
        pose=pose_at(x, y, 0.0),
        column_count=columns,
        cell_size=fox.Vector2(x=side, y=side),
        row_stride=4 * columns,
        cell_stride=4,
        fields=packed_fields(("red", "green", "blue", "alpha"), fox.PackedElementField.UINT8, 1),
        data=colours.tobytes(),
    )


def packed_fields(
    names: tuple[str, ...], kind: fox.PackedElementField.NumericType, size: int
) -> list[fox.PackedElementField]:
    """Return fields of one kind, `size` bytes each, that follow one another."""
    return [
        fox.PackedElementField(name=name, offset=size * place, type=kind)
        for place, name in enumerate(names)
    ]


def line_through(
    points: NDArray[np.float64], thickness: float, colour: Colour
) -> fox.LinePrimitive:
    """Return a line through points (n, 3), m, world, of a thickness, m."""
    line = fox.LinePrimitive(pose=pose_at(0.0, 0.0, 0.0), thickness=thickness)
    line.color.CopyFrom(colour_of(colour, 1.0))
    for x, y, z in points.tolist():
        line.points.add(x=x, y=y, z=z)
    return line


def ball(
    place: tuple[float, ...], size: float, colour: Colour, opacity: float
) -> fox.SpherePrimitive:
    """Return a ball with a diameter, m, at a place (3,), m, world."""
    return fox.SpherePrimitive(
        pose=pose_at(*place),
        size=fox.Vector3(x=size, y=size, z=size),
        color=colour_of(colour, opacity),
    )


def label(place: tuple[float, ...], words: str, colour: Colour, above: float) -> fox.TextPrimitive:
    """Return words that face the camera, at a height, m, above a place (3,), m, world."""
    x, y, z = place
    return fox.TextPrimitive(
        pose=pose_at(x, y, z + above),
        billboard=True,
        font_size=0.3,
        text=words,
        color=colour_of(colour, 1.0),
    )


def colour_of(colour: Colour, opacity: float) -> fox.Color:
    """Return a colour with an opacity, 0 to 1."""
    r, g, b = colour
    return fox.Color(r=r, g=g, b=b, a=opacity)


def pose_at(x: float, y: float, z: float) -> fox.Pose:
    """Return the pose of something at a place, m, that is not turned."""
    return fox.Pose(position=fox.Vector3(x=x, y=y, z=z), orientation=fox.Quaternion(w=1.0))
