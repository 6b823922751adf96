"""Parameters of the generated worlds, by world, with bounds and units.

A parameter that is None is set by the difficulty or drawn from the seed, as its description says;
one that is given takes no draw of others away, so a world changes in that alone. This file has no
arithmetic, as every config is read with it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple, get_type_hints


class Interval(NamedTuple):
    """Closed interval of a parameter.

    Attributes:
        low: Least value.
        high: Greatest value.
        unit: Unit of both.
    """

    low: float
    high: float
    unit: str = ""


Length = Annotated[float, Interval(8.0, 60.0, "m")]
Width = Annotated[float, Interval(8.0, 60.0, "m")]
Passage = Annotated[float | None, Interval(0.2, 1.5, "m")]
Count = Annotated[int | None, Interval(0, 200)]
Share = Annotated[float | None, Interval(0.0, 1.0)]
Door = Annotated[float | None, Interval(0.8, 4.0, "m")]


@functools.cache
def intervals_of(kind: type) -> dict[str, Interval]:
    """Return the interval of each parameter of a world."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        name: bound
        for name, hint in hints.items()
        for bound in getattr(hint, "__metadata__", ())
        if isinstance(bound, Interval)
    }


def check(parameters: object, section: str) -> None:
    """Check that every parameter given is in its interval.

    Raises:
        ValueError: One is not, or is NaN.
    """
    kind: type = type(parameters)
    for name, (low, high, unit) in intervals_of(kind).items():
        value = getattr(parameters, name)
        if value is not None and not low <= value <= high:  # nor NaN
            expected = f"{low:g} to {high:g} {unit}".rstrip()
            raise ValueError(f"world.{section}.{name}: got {value:g}, expected {expected}")


@dataclass(frozen=True)
class Common:
    """Parameters of every generated world.

    Attributes:
        passage_radius: Radius of the disc that can pass from start to goal, m; by default 0.75 m,
            beyond a difficulty of 0.5 down to 0.6 m.
        passers_by: Number of people who walk to and fro across the shortest path, beside what the
            world itself moves; those without a free line of 2 m are left out.
        passers_by_speed: Speed of these people, m/s.
    """

    passage_radius: Passage = None
    passers_by: Annotated[int, Interval(0, 30)] = 0
    passers_by_speed: Annotated[float, Interval(0.0, 3.0, "m/s")] = 1.0

    def __post_init__(self) -> None:
        """Check every parameter."""
        check(self, type(self).__name__.lower())


@dataclass(frozen=True)
class Warehouse(Common):
    """Parameters of `warehouse`.

    Attributes:
        length: Length of the hall, along x, m.
        width: Width of the hall, along y, m.
        aisle_width: Least width of aisles and cross-aisles, m.
        door_width: Width of the doorway, m; by default drawn from 1.6 to 1.8 m.
        crates: Number of crates; by default 6 to 12 times twice the difficulty. One that fits
            nowhere is left out.
    """

    length: Annotated[float, Interval(18.0, 60.0, "m")] = 20.0
    width: Annotated[float, Interval(10.0, 40.0, "m")] = 14.0
    aisle_width: Annotated[float, Interval(0.8, 2.6, "m")] = 1.8
    door_width: Door = None
    crates: Count = None


@dataclass(frozen=True)
class Corridor(Common):
    """Parameters of `corridor`.

    Attributes:
        length: Length of the centre line from end wall to end wall, m.
        width: Width between the walls, m; by default drawn from 2.0 to 2.4 m.
        bends: Number of bends; by default drawn, 1 or 2.
        crates: Number of crates; by default 2 to 4 times twice the difficulty.
    """

    length: Annotated[float, Interval(12.0, 60.0, "m")] = 16.0
    width: Annotated[float | None, Interval(0.9, 3.5, "m")] = None
    bends: Annotated[int | None, Interval(1, 2)] = None
    crates: Count = None


@dataclass(frozen=True)
class Empty(Common):
    """Parameters of `empty`.

    Attributes:
        length: Length of the room, along x, m.
        width: Width of the room, along y, m.
    """

    length: Length = 12.0
    width: Width = 12.0


@dataclass(frozen=True)
class Office(Common):
    """Parameters of `office`.

    Attributes:
        length: Length of the floor, along x, m.
        width: Width of the floor, along y, m.
        rooms: Number of rooms on either side of the hallway, each at least 4 m long.
        hallway_width: Between the walls of the hallway, m; by default 2.4 m, at difficulty 1 2.0.
        door_width: Width of every door, m; by default 1.9 m, at difficulty 1 1.6.
        furniture: Number of pieces; by default 4, at difficulty 1 20.
    """

    length: Annotated[float, Interval(12.0, 60.0, "m")] = 16.0
    width: Annotated[float, Interval(10.0, 40.0, "m")] = 12.4
    rooms: Annotated[int, Interval(2, 12)] = 3
    hallway_width: Annotated[float | None, Interval(1.0, 4.0, "m")] = None
    door_width: Annotated[float | None, Interval(0.8, 2.6, "m")] = None
    furniture: Count = None


@dataclass(frozen=True)
class Forest(Common):
    """Parameters of `forest`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        trees: Number of trees; by default 12, at difficulty 1 44.
        bushes: Number of bushes; by default 2, at difficulty 1 8.
        branch_share: Share of the up to three branches that a tree has; by default 0.2, at
            difficulty 1 0.7.
    """

    length: Length = 17.0
    width: Width = 12.0
    trees: Count = None
    bushes: Count = None
    branch_share: Share = None


@dataclass(frozen=True)
class Construction(Common):
    """Parameters of `construction`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        pieces: Number of scaffolds, trestles, planks, stacks, ramps and stairs; by default 4, at
            difficulty 1 18.
        holes: Number of holes in the floor; by default drawn, 1 to 3.
        unguarded_share: Share of holes without barriers; by default 0 up to a difficulty of 0.5,
            then up to 1.
    """

    length: Length = 17.0
    width: Width = 12.0
    pieces: Count = None
    holes: Annotated[int | None, Interval(0, 12)] = None
    unguarded_share: Share = None


@dataclass(frozen=True)
class Maze(Common):
    """Parameters of `maze`.

    Attributes:
        columns: Number of cells along x.
        rows: Number of cells along y.
        pitch: Pitch from wall to wall, middle to middle, m; by default 2.6 m, at difficulty 1 2.1.
        loop_share: Share of the inner walls that are taken out; by default 0.4, at difficulty 1 0.
        longest_way: Greatest length of the way from start to goal along the passages, m.
    """

    columns: Annotated[int, Interval(2, 20)] = 6
    rows: Annotated[int, Interval(2, 20)] = 5
    pitch: Annotated[float | None, Interval(1.2, 5.0, "m")] = None
    loop_share: Share = None
    longest_way: Annotated[float, Interval(5.0, 200.0, "m")] = 15.0


@dataclass(frozen=True)
class Cylinders(Common):
    """Parameters of `cylinders`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        filled_share: Share of the cells of 0.4 m that are filled at first; by default 0.10, at
            difficulty 1 0.34.
        pillar_radius: Radius of a pillar, m.
    """

    length: Length = 16.0
    width: Width = 10.0
    filled_share: Annotated[float | None, Interval(0.0, 0.6)] = None
    pillar_radius: Annotated[float, Interval(0.05, 0.4, "m")] = 0.2


@dataclass(frozen=True)
class Crossing(Common):
    """Parameters of `crossing`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        movers: Number of people and forklifts; by default 2, at difficulty 1 8.
        speed: Speed of all movers, m/s; by default drawn from 0.3 to 0.7 m/s, at difficulty 1
            from 0.7 to 1.5.
        forklift_share: Share of forklifts among the movers.
        crates: Number of crates; by default drawn, 0 to 3.
    """

    length: Annotated[float, Interval(12.0, 60.0, "m")] = 17.0
    width: Width = 11.0
    movers: Annotated[int | None, Interval(0, 40)] = None
    speed: Annotated[float | None, Interval(0.0, 3.0, "m/s")] = None
    forklift_share: Annotated[float, Interval(0.0, 1.0)] = 0.25
    crates: Count = None


@dataclass(frozen=True)
class Ghosts(Common):
    """Parameters of `ghosts`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        panels: Number of panels; by default 2, at difficulty 1 12.
        shortest_stay: Shortest time that a panel exists, s.
        longest_stay: Longest time that a panel exists, s.
    """

    length: Length = 16.0
    width: Width = 9.0
    panels: Annotated[int | None, Interval(0, 60)] = None
    shortest_stay: Annotated[float, Interval(0.1, 600.0, "s")] = 3.0
    longest_stay: Annotated[float, Interval(0.1, 600.0, "s")] = 12.0


@dataclass(frozen=True)
class Tunnel(Common):
    """Parameters of `tunnel`.

    Attributes:
        length: Length between the end walls, m.
        width: Width between the side walls, m.
    """

    length: Annotated[float, Interval(8.0, 100.0, "m")] = 30.0
    width: Annotated[float, Interval(2.1, 6.0, "m")] = 2.2


@dataclass(frozen=True)
class Hall(Common):
    """Parameters of `hall`.

    Attributes:
        length: Extent along x, m.
        width: Extent along y, m.
        wall_distance: Least distance of start and goal from the walls, m.
    """

    length: Annotated[float, Interval(44.0, 100.0, "m")] = 46.0
    width: Annotated[float, Interval(30.0, 100.0, "m")] = 32.0
    wall_distance: Annotated[float, Interval(1.0, 14.5, "m")] = 13.8


@dataclass(frozen=True)
class WorldParameters:
    """Parameters of the generated worlds; those of the world of an episode apply.

    Attributes:
        warehouse: Parameters of `warehouse`.
        corridor: Parameters of `corridor`.
        empty: Parameters of `empty`.
        office: Parameters of `office`.
        forest: Parameters of `forest`.
        construction: Parameters of `construction`.
        maze: Parameters of `maze`.
        cylinders: Parameters of `cylinders`.
        crossing: Parameters of `crossing`.
        ghosts: Parameters of `ghosts`.
        tunnel: Parameters of `tunnel`.
        hall: Parameters of `hall`.
    """

    warehouse: Warehouse = field(default_factory=Warehouse)
    corridor: Corridor = field(default_factory=Corridor)
    empty: Empty = field(default_factory=Empty)
    office: Office = field(default_factory=Office)
    forest: Forest = field(default_factory=Forest)
    construction: Construction = field(default_factory=Construction)
    maze: Maze = field(default_factory=Maze)
    cylinders: Cylinders = field(default_factory=Cylinders)
    crossing: Crossing = field(default_factory=Crossing)
    ghosts: Ghosts = field(default_factory=Ghosts)
    tunnel: Tunnel = field(default_factory=Tunnel)
    hall: Hall = field(default_factory=Hall)
