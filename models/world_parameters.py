"""Parameters of the generated worlds, with bounds and units, and names of places in them.

A parameter that is None is set by the difficulty or drawn from the seed, as its description says;
one that is given takes no draw of others away, so a world changes in that alone. This file has no
arithmetic, as every config is read with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from wayproof.bounds import Bounds, check_fields

Size = Annotated[float, Bounds(8.0, 60.0, "m")]
Count = Annotated[int | None, Bounds(0, 200)]


@dataclass(frozen=True)
class Warehouse:
    """Parameters of `warehouse`.

    Attributes:
        aisle_width: Least width of aisles and cross-aisles, m.
        crates: Number of crates; by default 6 to 12 times twice the difficulty. One that fits
            nowhere is left out.
    """

    aisle_width: Annotated[float, Bounds(0.8, 2.6, "m")] = 1.8
    crates: Count = None

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_fields(self, "world.warehouse.")


@dataclass(frozen=True)
class Corridor:
    """Parameters of `corridor`.

    Attributes:
        width: Width between the walls, m; by default drawn from 2.0 to 2.4 m.
        crates: Number of crates; by default 2 to 4 times twice the difficulty.
    """

    width: Annotated[float | None, Bounds(0.9, 3.5, "m")] = None
    crates: Count = None

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_fields(self, "world.corridor.")


@dataclass(frozen=True)
class Empty:
    """Parameters of `empty`.

    Attributes:
        length: Length of the room, along x, m.
        width: Width of the room, along y, m.
    """

    length: Size = 12.0
    width: Size = 12.0

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_fields(self, "world.empty.")


@dataclass(frozen=True)
class WorldParameters:
    """Parameters of the generated worlds.

    Attributes:
        passage_radius: Radius of the disc that can pass from start to goal, m; by default 0.75 m,
            beyond a difficulty of 0.5 down to 0.6 m.
        passers_by: Number of people who walk to and fro across the shortest path, beside what the
            world itself moves; those without a free line of 2 m are left out.
        passers_by_speed: Speed of these people, m/s.
        warehouse: Parameters of `warehouse`.
        corridor: Parameters of `corridor`.
        empty: Parameters of `empty`.
    """

    passage_radius: Annotated[float | None, Bounds(0.2, 1.5, "m")] = None
    passers_by: Annotated[int, Bounds(0, 30)] = 0
    passers_by_speed: Annotated[float, Bounds(0.0, 3.0, "m/s")] = 1.0
    warehouse: Warehouse = field(default_factory=Warehouse)
    corridor: Corridor = field(default_factory=Corridor)
    empty: Empty = field(default_factory=Empty)

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_fields(self, "world.")


PLACES = {
    "home": "the start",
    "world": "the world's own goal",
    "aisle": "an end, the middle and the other end of the world's aisle, the nearer end first",
}
"""Meaning of each name; `models.worlds.aisle` and `harness.scenario.places` give the points."""
