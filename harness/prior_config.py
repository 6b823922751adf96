"""Settings of the section `prior`: a map that the episode did not measure, and what it may do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from wayproof.bounds import Bounds, check_fields

PriorPolicy = Literal["guide", "admit", "ignore"]

NO_PRIOR = "none"
"""Source of no prior map."""

TRUTH = "truth"
"""Source of the prior map that is made of the geometry of the world, for studies."""

SPLAT = "splat"
"""Source of a splat that is made of the geometry of the world, likewise."""

MADE_OF_WORLD = (NO_PRIOR, TRUTH, SPLAT)
"""Sources that are no files."""


@dataclass(frozen=True)
class PriorConfig:
    """A prior map, and what its cells may do where nothing was measured.

    Attributes:
        source: `none`, `truth` (the world's geometry), `splat` (Gaussians made of it), or a file.
            Files: an occupancy map (`.yaml`), an OctoMap (`.bt`, `.ot`), our own map (`.map`), the
            map at the end of a log (`.mcap`), a world file (`.xml`), a 3D Gaussian splat (`.ply`,
            `.spz`). A log holds the cells, and the name and hash of the file.
        policy: `guide`: free cells cost a global path less than unknown ones, occupied ones are
            avoided if there is another way, none is admitted; `admit`: they count as measured ones
            until they are measured; `ignore`: nothing.
        cost: Cost to a global path of space that is free by a prior map or a prediction and not
            measured. At the edge of the inflation it is 1, and `behaviour.unknown_cost` where
            nothing is known.
        x: Position of the prior map's origin in the world along x, m.
        y: Position of the prior map's origin along y, m.
        z: Position of the prior map's origin along z, m.
        yaw: Turn of the prior map about its origin, rad.
        height: Height of the walls of an occupancy map, which is flat, m.
        scale: Metres in a unit of a splat.
        up: Axis of a splat that points up.
    """

    source: str = NO_PRIOR
    policy: PriorPolicy = "guide"
    cost: Annotated[float, Bounds(0.0, 1e6)] = 2.0
    x: Annotated[float, Bounds(-1e4, 1e4, "m")] = 0.0
    y: Annotated[float, Bounds(-1e4, 1e4, "m")] = 0.0
    z: Annotated[float, Bounds(-100.0, 100.0, "m")] = 0.0
    yaw: Annotated[float, Bounds(-3.1416, 3.1416, "rad")] = 0.0
    height: Annotated[float, Bounds(0.1, 100.0, "m")] = 3.0
    scale: Annotated[float, Bounds(1e-3, 1e3, "m")] = 1.0
    up: Literal["z", "-z", "y", "-y"] = "z"

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "prior.")
