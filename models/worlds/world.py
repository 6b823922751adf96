"""A world is a floor, boxes, and two places: truth that the simulator and the metrics share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector3 = tuple[float, float, float]

FLOOR_FRICTION = 0.8
"""Sliding friction, assumed: rubber on dry concrete."""

COLOURS = {
    "wall": "0.75 0.75 0.72 1",
    "partition": "0.70 0.72 0.75 1",
    "lintel": "0.70 0.72 0.75 1",
    "shelf": "0.30 0.42 0.60 1",
    "overhang": "0.85 0.55 0.20 1",
    "crate": "0.62 0.47 0.31 1",
}
"""Colour by kind of box, for pictures only."""

_SCENE = """\
<mujoco model="{name}_{seed}">
  <option timestep="0.002" integrator="implicitfast" cone="pyramidal" iterations="50" \
gravity="0 0 -9.81"/>
  <visual>
    <map znear="0.001"/>
  </visual>
  <worldbody>
    <light name="sun" pos="{centre} 10" dir="0 0 -1" directional="true" castshadow="false"/>
    <geom name="floor" type="plane" pos="{centre} 0" size="{half} 0.05" group="0" contype="1" \
conaffinity="1" friction="{friction} 0.005 0.0001" rgba="0.9 0.9 0.9 1"/>
{boxes}
  </worldbody>
</mujoco>
"""
# znear: depth rendered by OpenGL is clipped at znear times the extent of the model, which at the
# default (0.01) hides what is nearer than 0.3 m in a 30 m hall.


@dataclass(frozen=True)
class Box:
    """A solid box, turned about the vertical only.

    Attributes:
        centre: World frame, m.
        half_extents: Half the length, width and height, along the box's own axes, m.
        yaw: Turn of the box's axes about z, rad.
        kind: What it stands for: wall, partition, lintel, shelf, overhang, crate.
    """

    centre: Vector3
    half_extents: Vector3
    yaw: float
    kind: str

    def __post_init__(self) -> None:
        """Refuse flat boxes.

        Raises:
            ValueError: A half extent is not positive.
        """
        if min(self.half_extents) <= 0.0:
            raise ValueError(f"half_extents: got {self.half_extents}, expected positive lengths")

    @classmethod
    def between(cls, low: Vector3, high: Vector3, kind: str) -> Box:
        """Build an axis-aligned box from opposite corners (world, m), rounded to millimetres."""
        corners = [(round(a, 3), round(b, 3)) for a, b in zip(low, high, strict=True)]
        x, y, z = (round((a + b) / 2, 4) for a, b in corners)
        half_x, half_y, half_z = (round((b - a) / 2, 4) for a, b in corners)
        return cls((x, y, z), (half_x, half_y, half_z), 0.0, kind)

    @property
    def bottom(self) -> float:
        """Height of the underside, m."""
        return self.centre[2] - self.half_extents[2]

    @property
    def top(self) -> float:
        """Height of the upper side, m."""
        return self.centre[2] + self.half_extents[2]

    @property
    def reach(self) -> tuple[float, float]:
        """Half the world-frame extent in x and y of the footprint, m."""
        c, s = abs(cos(self.yaw)), abs(sin(self.yaw))
        length, width = self.half_extents[:2]
        return c * length + s * width, s * length + c * width

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:  # (n,)
        """Exact distance from points to the box, 0 inside.

        Args:
            points: (n, 3) world frame, m; or (n, 2), for the distance to the footprint.
        """
        offset = np.asarray(points, np.float64) - self.centre[: np.shape(points)[-1]]
        c, s = cos(self.yaw), sin(self.yaw)
        along = c * offset[:, 0] + s * offset[:, 1]
        across = c * offset[:, 1] - s * offset[:, 0]
        own_axes = np.column_stack([along, across, offset[:, 2:]])  # (n, 3) or (n, 2)
        outside = np.abs(own_axes) - self.half_extents[: own_axes.shape[1]]
        return np.asarray(np.sqrt(np.square(np.maximum(outside, 0.0)).sum(axis=1)))


@dataclass(frozen=True)
class World:
    """Boxes on a floor at z = 0, with a start and a goal on that floor.

    Attributes:
        name: Registry name.
        seed: What it was drawn from.
        low: Lower corner of the operating area that the robot knows (its geofence), m.
        high: Upper corner of it, m.
        boxes: Everything solid but the floor.
        start: On the floor, m; the harness adds the robot's height.
        start_heading: rad.
        goal: On the floor, m.
    """

    name: str
    seed: int
    low: Vector3
    high: Vector3
    boxes: tuple[Box, ...]
    start: Vector3
    start_heading: float
    goal: Vector3

    def __post_init__(self) -> None:
        """Refuse a start or goal outside the operating area.

        Raises:
            ValueError: Naming the field, what was got and what was expected.
        """
        for field, point in (("start", self.start), ("goal", self.goal)):
            limits = zip(self.low, point, self.high, strict=True)
            if not all(low <= value <= high for low, value, high in limits):
                raise ValueError(f"{field}: got {point}, expected within {self.low}..{self.high}")

    @property
    def box_names(self) -> tuple[str, ...]:
        """Geom name of each box: its kind and its count within the kind, such as `shelf_3`."""
        seen: Counter[str] = Counter()
        names = []
        for box in self.boxes:
            names.append(f"{box.kind}_{seen[box.kind]}")
            seen[box.kind] += 1
        return tuple(names)

    def contains_obstacle(self, point: ArrayLike, radius: float) -> str | None:
        """Name the nearest box within `radius` of a point, if there is one; the floor is none.

        Args:
            point: (3,) world frame, m.
            radius: m.
        """
        if not self.boxes:
            return None
        distances = [box.distance(np.reshape(point, (1, 3)))[0] for box in self.boxes]
        nearest = int(np.argmin(distances))
        return self.box_names[nearest] if distances[nearest] <= radius else None

    def mjcf(self) -> str:
        """The scene as MJCF, the same bytes for the same world.

        All boxes sit directly in the world body: up to some hundred of them this is the layout
        in which MuJoCo's own ray caster is fastest.
        """
        centre = [(a + b) / 2 for a, b in zip(self.low[:2], self.high[:2], strict=True)]
        half = [(b - a) / 2 for a, b in zip(self.low[:2], self.high[:2], strict=True)]
        geoms = map(_geom, self.box_names, self.boxes)
        return _SCENE.format(
            name=self.name,
            seed=self.seed,
            centre=_numbers(centre),
            half=_numbers(half),
            friction=FLOOR_FRICTION,
            boxes="\n".join(geoms),
        )


def _geom(name: str, box: Box) -> str:
    turn = ""
    if box.yaw:
        turn = f' quat="{cos(box.yaw / 2):.9f} 0 0 {sin(box.yaw / 2):.9f}"'
    colour = COLOURS.get(box.kind, "0.6 0.6 0.6 1")
    return (
        f'    <geom name="{name}" type="box" pos="{_numbers(box.centre)}" '
        f'size="{_numbers(box.half_extents)}"{turn} group="0" contype="1" conaffinity="1" '
        f'friction="{FLOOR_FRICTION} 0.005 0.0001" rgba="{colour}"/>'
    )


def _numbers(values: list[float] | Vector3) -> str:
    """Lengths at a tenth of a millimetre: corners are whole millimetres, halves of them are not."""
    return " ".join(f"{value:.4f}" for value in values)
