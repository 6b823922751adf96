"""A scenario from a recording: what its robot saw as a world, and its way as start and goal.

The world is the last map in the plane, extruded. Cells that no beam decided are solid, of the kind
`unseen`: a robot that is stopped by one, or touches one, was judged by what nobody saw.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, as_truth
from wayproof.harness.map_files.files import moment_at, plane_of
from wayproof.harness.regress.scene import Case, Place, place_of
from wayproof.harness.scenario.robots import find_robot
from wayproof.maps import FREE, OCCUPIED
from wayproof.models.world_files import WorldFileError
from wayproof.models.world_files.cells import cell_boxes
from wayproof.models.world_files.options import Ends, Found

UNSEEN = "unseen"
"""Kind of the solids in place of cells that no beam decided."""

HEIGHT = 2.0
"""Height of what was seen in the plane, m."""

BORDER = 0.5
"""Width of the unseen wall around the map, m."""


def case_of_recording(log: Log, robot: str, seed: int) -> Case:
    """Return the scenario of the log of a recording.

    Start and goal are the first and the last place of the way at which the robot fits.

    Args:
        log: Log that `wayproof shadow` wrote.
        robot: Robot that drives: a name, or a spec file.
        seed: Seed of the noise.

    Raises:
        InputError: The recording has no way, the robot fits nowhere on it, or the map is more than
            a world may hold.
    """
    way = tuple(place_of(as_truth(motion)) for motion in log.motions())
    if len(way) < 2:
        raise InputError(f"log '{log.path}': {len(way)} recorded poses, expected a way")
    moment = moment_at(log, None)
    plane, resolution = plane_of(moment), moment.costmap.resolution
    x, y = moment.costmap.origin[:2].tolist()
    driven = _driven(plane.shape, (x, y), resolution, way, log.mission.radius)
    border = round(BORDER / resolution)
    unseen = np.pad((plane != FREE) & (plane != OCCUPIED) & ~driven, border, constant_values=True)
    occupied = np.pad(plane == OCCUPIED, border)
    low = (x - border * resolution, y - border * resolution, 0.0)
    try:
        parts = [
            replace(part, kind=kind)
            for solid, kind in ((occupied, "wall"), (unseen, UNSEEN))
            for part in cell_boxes(
                log.path, solid[:, :, None], (resolution, resolution, HEIGHT), low
            )
        ]
    except WorldFileError as error:
        raise InputError(str(error)) from None
    high = [corner + cells * resolution for corner, cells in zip(low, occupied.shape, strict=False)]
    config = Config("", robot, seed)
    room = find_robot(config).spec.radius + config.costmap.localization_margin
    way = tuple(_with_room(way, occupied | unseen, low, resolution, room))
    if len(way) < 2:
        raise InputError(
            f"log '{log.path}': robot '{robot}', {room:.2f} m with its margin, fits nowhere on the "
            "recorded way, expected a smaller one"
        )
    first, last = way[0], way[-1]
    ends = Ends(
        low=(low[0], low[1], -0.5),
        high=(high[0], high[1], log.mission.high[2]),
        start=(first.x, first.y, 0.0),
        start_heading=first.heading,
        goal=(last.x, last.y, 0.0),
    )
    return Case(config, Found(parts=parts, plane=True), ends, way)


def _with_room(
    way: tuple[Place, ...],
    solid: NDArray[np.bool_],
    low: tuple[float, float, float],
    resolution: float,
    room: float,
) -> Iterator[Place]:
    """Yield the places with room to every solid cell (nx, ny)."""
    clearance = (ndimage.distance_transform_edt(~solid) - 0.5) * resolution
    for place in way:
        i, j = int((place.x - low[0]) // resolution), int((place.y - low[1]) // resolution)
        if clearance[i, j] > room:
            yield place


def _driven(
    shape: tuple[int, ...],
    corner: tuple[float, float],
    resolution: float,
    way: tuple[Place, ...],
    radius: float,
) -> NDArray[np.bool_]:
    """Return the cells (nx, ny) within the body's radius of the recorded way: they were free."""
    driven = np.zeros(shape, np.bool_)
    x = corner[0] + (np.arange(shape[0]) + 0.5) * resolution
    y = corner[1] + (np.arange(shape[1]) + 0.5) * resolution
    for place in way:
        near_x, near_y = np.abs(x - place.x) <= radius, np.abs(y - place.y) <= radius
        dx, dy = x[near_x] - place.x, y[near_y] - place.y
        driven[np.ix_(near_x, near_y)] |= dx[:, None] ** 2 + dy[None, :] ** 2 <= radius**2
    return driven
