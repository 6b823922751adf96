"""Options of an import, and its result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.parts import Part

UnknownCells = Literal["occupied", "free"]


@dataclass(frozen=True)
class ImportOptions:
    """Options for what a file does not contain.

    Attributes:
        height: To which flat maps are extruded, and the rise of a height image from black to white,
            m.
        resolution: Side of a cell where the file gives none (`.3dmap`, height fields), m.
        scale: Metres to a unit of a mesh.
        unknown: Treatment of unknown cells of a flat map.
        skip_missing: Whether models that a file includes and that are not there are left out.
    """

    height: float = 2.0
    resolution: float = 0.1
    scale: float = 1.0
    unknown: UnknownCells = "occupied"
    skip_missing: bool = False

    def __post_init__(self) -> None:
        """Refuse lengths that no world has.

        Raises:
            ValueError: Naming the field.
        """
        for name, low, high in (
            ("height", 0.01, 1000.0), ("resolution", 0.001, 1000.0), ("scale", 1e-6, 1e6)
        ):  # fmt: skip
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name}: got {value:g}, expected {low:g} to {high:g} m")


class Ends(NamedTuple):
    """Start, goal and area: what a mission needs besides the solids.

    Attributes:
        low: Lower corner of the operating area, m.
        high: Upper corner, m.
        start: On the floor, m.
        start_heading: rad.
        goal: On the floor, m.
    """

    low: Vector3
    high: Vector3
    start: Vector3
    start_heading: float
    goal: Vector3


@dataclass
class Found:
    """Contents of an imported file.

    Attributes:
        parts: Everything solid but the floor.
        plane: Whether the file has a level plane at height 0: the floor.
        notes: What was left out or taken otherwise than written, a line each.
        start: Point on the floor, m; None if the file gives none.
        start_heading: rad.
        goal: Likewise, m.
        low: Lower corner of the operating area, m; None if the file gives none.
        high: Upper corner.
        route_length: Published length of a route from start to goal, m.
        source: Path or name of the imported file.
        protocol: Protocol of the world's benchmark: limits and the constants of its score.
        format: Format of the world file that was read; empty for other files.
    """

    parts: list[Part] = field(default_factory=list)
    plane: bool = False
    notes: list[str] = field(default_factory=list)
    start: Vector3 | None = None
    start_heading: float | None = None
    goal: Vector3 | None = None
    low: Vector3 | None = None
    high: Vector3 | None = None
    route_length: float | None = None
    source: str = ""
    protocol: str = ""
    format: str = ""

    def ends(self) -> Ends | None:
        """Return what a mission needs, if the file gives all of it."""
        if self.low is None or self.high is None or self.start is None or self.goal is None:
            return None
        if self.start_heading is None:
            return None
        return Ends(self.low, self.high, self.start, self.start_heading, self.goal)
