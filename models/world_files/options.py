"""Options of an import, and its result."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.parts import Part
from wayproof.models.worlds.movers import Mover

UnknownCells = Literal["occupied", "free"]


@dataclass(frozen=True)
class ImportOptions:
    """Options for content that a file lacks.

    Attributes:
        height: Height to which flat maps are extruded, and the rise of a height image from black to
            white, m.
        resolution: Side of a cell where the file gives none (`.3dmap`, height fields), m.
        scale: Metres to a unit of a mesh.
        unknown: Treatment of unknown cells of a flat map.
        skip_missing: Whether models and meshes that a file names and that are not there are left
            out.
        visuals: Whether links that have visuals only, and collisions that no body meets, are made
            solid.
        model_paths: Folders with models that a file includes, searched before the usual ones.
        floor: Height of the floor in the file, m; None for its plane or one large level surface.
        kinds: Kind of the parts of a model, by a pattern of its name, such as `ground*`.
        robot_radius: Radius of the robot that will run, for start and goal, m.
        robot_height: Height of it, m.
        robot_step: Height that it steps over, m, for ends on level ground; 0 if it flies.
        without: Bodies of a MuJoCo scene that are left out with all that is on them.
        root: Folder below which a MuJoCo scene may name files; None for its own.
    """

    height: float = 2.0
    resolution: float = 0.1
    scale: float = 1.0
    unknown: UnknownCells = "occupied"
    skip_missing: bool = False
    visuals: bool = False
    model_paths: tuple[Path, ...] = ()
    floor: float | None = None
    kinds: tuple[tuple[str, str], ...] = ()
    robot_radius: float = 0.5
    robot_height: float = 0.6
    robot_step: float = 0.0
    without: tuple[str, ...] = ()
    root: Path | None = None

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
    """Start, goal and area of a mission.

    Attributes:
        low: Lower corner of the operating area, m.
        high: Upper corner, m.
        start: Start on the floor, m.
        start_heading: Heading at the start, rad.
        goal: Goal on the floor, m.
    """

    low: Vector3
    high: Vector3
    start: Vector3
    start_heading: float
    goal: Vector3


class Plane(NamedTuple):
    """A plane of a file, solid behind its face.

    Attributes:
        point: (3,) on the plane, m.
        normal: (3,) unit vector, out of the solid side.
        half_extents: Half the length and width that it is drawn with, m.
        model: Name of its model or geom.
        axes: (3, 3) rotation from its axes to the world's where it ends as it is drawn unless it is
            the floor, such as a sticker of a Gazebo world; None of an infinite one.
    """

    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    half_extents: tuple[float, float] | None = None
    model: str = ""
    axes: NDArray[np.float64] | None = None

    @property
    def area(self) -> float:
        """Area that it is drawn with, m^2."""
        return 4.0 * self.half_extents[0] * self.half_extents[1] if self.half_extents else np.inf


@dataclass
class Found:
    """Contents of an imported file.

    Attributes:
        parts: Everything solid but the floor.
        plane: Whether there is a level plane at height 0: the floor.
        planes: Planes of the file, until the floor is settled.
        movers: Things that move, each with a body on the ground.
        extent: Corners of a scene with infinite walls, which are solid beyond, m; else None.
        closed: Whether nothing is known beyond the parts, as around a map.
        grid: Whether the parts are cells of a grid; the lowest may be the floor.
        notes: Notes on parts left out or taken otherwise than written, a line each.
        start: Point on the floor, m; None if the file gives none.
        start_heading: Heading at the start, rad.
        goal: Point on the floor, m; None if the file gives none.
        low: Lower corner of the operating area, m; None if the file gives none.
        high: Upper corner.
        route_length: Published length of a route from start to goal, m.
        source: Path or name of the imported file.
        format: Format of the world file that was read; empty for other files.
    """

    parts: list[Part] = field(default_factory=list)
    plane: bool = False
    planes: list[Plane] = field(default_factory=list)
    movers: list[Mover] = field(default_factory=list)
    extent: tuple[Vector3, Vector3] | None = None
    closed: bool = False
    grid: bool = False
    notes: list[str] = field(default_factory=list)
    start: Vector3 | None = None
    start_heading: float | None = None
    goal: Vector3 | None = None
    low: Vector3 | None = None
    high: Vector3 | None = None
    route_length: float | None = None
    source: str = ""
    format: str = ""

    def ends(self) -> Ends | None:
        """Return start, goal and area, if the file gives all of them."""
        if self.low is None or self.high is None or self.start is None or self.goal is None:
            return None
        if self.start_heading is None:
            return None
        return Ends(self.low, self.high, self.start, self.start_heading, self.goal)
