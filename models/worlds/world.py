"""Worlds: a floor, solids, start and goal; ground truth for simulator and metrics."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.solids import FRICTION, Band, Box, Solid
from wayproof.models.worlds.solids.solid import class_of, numbers

_SCENE = """\
<mujoco model="{name}_{seed}">
  <size nuser_geom="1"/>
  <option timestep="0.002" integrator="implicitfast" cone="pyramidal" iterations="50" \
gravity="0 0 -9.81"/>
  <visual>
    <map znear="0.001"/>
  </visual>
{assets}  <worldbody>
    <light name="sun" pos="{centre} 10" dir="0 0 -1" directional="true" castshadow="false"/>
{geoms}
  </worldbody>
</mujoco>
"""
# znear: depth rendered by OpenGL is clipped at znear times the extent of the model, which at the
# default (0.01) hides what is nearer than 0.3 m in a 30 m hall.


@dataclass(frozen=True)
class World:
    """Solids on a floor at z = 0, with a start and a goal on that floor.

    Attributes:
        name: Registry name.
        seed: Seed that it was generated from.
        low: Lower corner of the operating area that the robot knows (its geofence), m.
        high: Upper corner of it, m.
        solids: Everything solid that stays where it is, but the floor.
        start: Start on the floor, m; the harness adds the robot's height.
        start_heading: rad.
        goal: Goal on the floor, m.
        difficulty: 0 to 1, as its generator understands it.
        floor: None for a plane; otherwise the slabs that bear a body on the ground, with holes
            where there are none.
        movers: Things that move, appear or vanish.
        route_length: Length of the shortest way if it is known from elsewhere, m.
        aisle: Places along the centre line of an aisle, on the floor, m; empty without one.
        passage_radius: Radius of the disc that its generator lets through, m; None if unknown.
        friction: Coefficient of friction of the floor.
    """

    name: str
    seed: int
    low: Vector3
    high: Vector3
    solids: tuple[Solid, ...]
    start: Vector3
    start_heading: float
    goal: Vector3
    difficulty: float = 0.5
    floor: tuple[Box, ...] | None = None
    movers: tuple[Mover, ...] = ()
    route_length: float | None = None
    aisle: tuple[Vector3, ...] = ()
    passage_radius: float | None = None
    friction: float = FRICTION

    def __post_init__(self) -> None:
        """Refuse a start or goal outside the operating area, and movers of one name.

        Raises:
            ValueError: Naming the field, what was got and what was expected.
        """
        for field, point in (("start", self.start), ("goal", self.goal)):
            limits = zip(self.low, point, self.high, strict=True)
            if not all(low <= value <= high for low, value, high in limits):
                raise ValueError(f"{field}: got {point}, expected within {self.low}..{self.high}")
        if len({mover.name for mover in self.movers}) < len(self.movers):
            raise ValueError("movers: got one name twice, expected a name for each")

    @property
    def solid_names(self) -> tuple[str, ...]:
        """Geom name of each solid: its kind and its count within the kind, such as `shelf_3`."""
        seen: Counter[str] = Counter()
        names = []
        for solid in self.solids:
            names.append(f"{solid.kind}_{seen[solid.kind]}")
            seen[solid.kind] += 1
        return tuple(names)

    def contains_obstacle(self, point: ArrayLike, radius: float) -> str | None:
        """Name the nearest solid within `radius` of a point, if there is one; the floor is none.

        Args:
            point: (3,) world frame, m.
            radius: m.
        """
        if not self.solids:
            return None
        distances = [solid.distance(np.reshape(point, (1, 3)))[0] for solid in self.solids]
        nearest = int(np.argmin(distances))
        return self.solid_names[nearest] if distances[nearest] <= radius else None

    def obstacle_in_band(self, point: ArrayLike, radius: float, band: Band) -> str | None:
        """Name the nearest solid that stands within `radius` of a place, in a height band.

        Args:
            point: (>= 2,) world frame, m.
            radius: m.
            band: Heights that a body on the ground takes up, above what it steps over, m.
        """
        at = np.ravel(np.asarray(point, np.float64))[None, :2]
        nearest, found = radius, None
        for name, solid in zip(self.solid_names, self.solids, strict=True):
            low, high = np.array(solid.low[:2]), np.array(solid.high[:2])
            beyond = np.maximum(np.maximum(low - at[0], at[0] - high), 0.0)
            if solid.bottom >= band[1] or solid.top <= band[0] or (beyond > radius).any():
                continue
            distance = float(solid.distance_in_plane(at, band)[0])
            if distance <= nearest:
                nearest, found = distance, name
        return found

    def ground_height(self, point: ArrayLike) -> float:
        """Return the height of the floor at a point (>= 2,), m."""
        del point
        return 0.0

    def mjcf(self) -> str:
        """Write the scene as MJCF without outside references; equal worlds give equal bytes.

        All that stays sits directly in the world body: up to some hundred solids this is the layout
        in which MuJoCo's own ray caster is fastest. What moves is a mocap body each.
        """
        named = list(zip(self.solid_names, self.solids, strict=True))
        for mover in self.movers:
            named += zip(mover.solid_names, mover.solids, strict=True)
        assets = "".join(f"{asset}\n" for name, solid in named if (asset := solid.asset(name)))
        geoms = [self._floor(), *geoms_of(self)]
        return _SCENE.format(
            name=self.name,
            seed=self.seed,
            centre=numbers(self._middle()),
            assets=f"  <asset>\n{assets}  </asset>\n" if assets else "",
            geoms="\n".join(geom for geom in (*geoms, *map(mover_body, self.movers)) if geom),
        )

    def _middle(self) -> list[float]:
        return [(a + b) / 2 for a, b in zip(self.low[:2], self.high[:2], strict=True)]

    def _floor(self) -> str:
        if self.floor is not None:
            slabs = "\n".join(slab.geom(f"floor_{i}") for i, slab in enumerate(self.floor))
            return slabs.replace(f'friction="{FRICTION} ', f'friction="{self.friction} ')
        half = [(b - a) / 2 for a, b in zip(self.low[:2], self.high[:2], strict=True)]
        return (
            f'    <geom name="floor" type="plane" pos="{numbers(self._middle())} 0" '
            f'size="{numbers(half)} 0.05" group="0" contype="1" conaffinity="1" '
            f'friction="{self.friction} 0.005 0.0001" rgba="0.9 0.9 0.9 1" '
            f'user="{class_of("floor")}"/>'
        )


def geoms_of(thing: World | Mover) -> list[str]:
    """Write the solids of a world or a mover."""
    return [solid.geom(name) for name, solid in zip(thing.solid_names, thing.solids, strict=True)]


def mover_body(mover: Mover) -> str:
    """Write a mover as a mocap body at its start."""
    place = mover.place(0)
    turn = f"{cos(place.yaw / 2):.9f} 0 0 {sin(place.yaw / 2):.9f}"
    geoms = "\n".join(geoms_of(mover))
    return (
        f'    <body name="{mover.name}" mocap="true" pos="{numbers(place.position)}" '
        f'quat="{turn}">\n{geoms}\n    </body>'
    )
