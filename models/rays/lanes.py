"""Beams of a sweep, and the lanes that a tile of them is cast in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.fans import FAN_COLUMNS, PLANES, TILE
from wayproof.models.rays.packets import (
    BEST,
    LANES,
    NO_ROW,
    PX,
    PY,
    PZ,
    ROW,
    TILE_NUMBERS,
    WX,
    WY,
    WZ,
    U,
)
from wayproof.models.rays.wide_tree import SIDES, STACK_SIZE

NO_GEOM = np.iinfo(np.int32).max
"""Sentinel for no geom: an id above any geom's."""


class Beams(NamedTuple):
    """Beams of a sweep, tile by tile, and the scan poses that they leave from.

    Attributes:
        directions: (3, n) unit directions, sensor frame.
        places: (n,) index of each beam in the order that the sensor reports.
        pose_indices: (n,) scan pose of each beam; unused where there is one.
        origins: (m, 3) origins of the sensor in the world, m.
        rotations: (m, 3, 3) R_world_sensor.
    """

    directions: Array
    places: NDArray[np.int64]
    pose_indices: NDArray[np.int32]
    origins: Array
    rotations: Array


class SurfaceHits(NamedTuple):
    """Hits of the beams in the order that the sensor reports; nearer ones are written over them.

    Attributes:
        distance: (n,) m, -1 for none.
        geom_id: (n,) -1 for none.
        face: (n,) row in `Soup.triangles`, -1 for none.
    """

    distance: Array
    geom_id: NDArray[np.int32]
    face: NDArray[np.int32]


class Lanes(NamedTuple):
    """Scratch arrays for the beams that are handled together, and the geoms that they may meet.

    Attributes:
        rays: (TILE_NUMBERS,) see `packets`.
        bits: The memory of `rays` as integers.
        found: (2, 64) geom id and triangle of the best hits.
        frame: (3, 3) axes of the fan in the world.
        local_frame: (3, 3) and in a geom's frame.
        slopes: (9, 4) by `measure_slopes`.
        fans: (9, 26) of each packet and of the whole tile, by `set_fan`.
        sides: (9, 15) likewise.
        farthest: (8,) farthest hit of each packet, m.
        masks: (8,) children of a node that each packet may meet.
        stack: (STACK_SIZE,) nodes that wait.
        ahead: (STACK_SIZE,) least distance to these, m.
        node: (1, 48) a node of a height field as one of a tree.
        near: (g,) rows of the geoms that the tile may meet, nearest first.
        near_ahead: (g,) least distance to these, m.
    """

    rays: Array
    bits: NDArray[np.int64]
    found: NDArray[np.int32]
    frame: Array
    local_frame: Array
    slopes: Array
    fans: NDArray[np.float32]
    sides: NDArray[np.uint64]
    farthest: NDArray[np.float32]
    masks: NDArray[np.int64]
    stack: NDArray[np.int64]
    ahead: NDArray[np.float32]
    node: NDArray[np.float32]
    near: NDArray[np.int32]
    near_ahead: NDArray[np.float32]


@allocating
def make_lanes(geoms: int) -> Lanes:
    """Return scratch arrays for a number of geoms."""
    rays = np.zeros(TILE_NUMBERS)
    return Lanes(
        rays,
        rays.view(np.int64),
        np.empty((2, LANES), np.int32),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((TILE + 1, 4)),
        np.empty((TILE + 1, FAN_COLUMNS), np.float32),
        np.empty((TILE + 1, 3 * PLANES), np.uint64),
        np.empty(TILE, np.float32),
        np.empty(TILE, np.int64),
        np.empty(STACK_SIZE, np.int64),
        np.empty(STACK_SIZE, np.float32),
        np.empty((1, SIDES), np.float32),
        np.empty(geoms, np.int32),
        np.empty(geoms, np.float32),
    )


@kernel
def aim_lanes(first: int, n: int, beams: Beams, rays: Array) -> None:
    """Write directions and origins of n beams in the world; spare lanes repeat the last beam."""
    directions, _, pose_indices, origins, rotations = beams
    rolling = len(origins) > 1
    r00, r01, r02 = rotations[0, 0, 0], rotations[0, 0, 1], rotations[0, 0, 2]
    r10, r11, r12 = rotations[0, 1, 0], rotations[0, 1, 1], rotations[0, 1, 2]
    r20, r21, r22 = rotations[0, 2, 0], rotations[0, 2, 1], rotations[0, 2, 2]
    ox, oy, oz = origins[0, 0], origins[0, 1], origins[0, 2]
    start = U(first)
    for lane in range(n):
        i = U(lane)
        x, y, z = directions[0, start + i], directions[1, start + i], directions[2, start + i]
        rays[WX + i] = x * r00 + y * r01 + z * r02
        rays[WY + i] = x * r10 + y * r11 + z * r12
        rays[WZ + i] = x * r20 + y * r21 + z * r22
    for lane in range(LANES):
        i = U(lane)
        rays[PX + i], rays[PY + i], rays[PZ + i] = ox, oy, oz
    if rolling:
        for lane in range(n):
            j, k = first + lane, pose_indices[first + lane]
            x, y, z = directions[0, j], directions[1, j], directions[2, j]
            for axis in range(3):
                r0, r1, r2 = rotations[k, axis, 0], rotations[k, axis, 1], rotations[k, axis, 2]
                i = U(LANES * axis + lane)
                rays[WX + i] = x * r0 + y * r1 + z * r2
                rays[PX + i] = origins[k, axis]
    for lane in range(n, LANES):
        for axis in range(3):
            i, last = U(LANES * axis + lane), U(LANES * axis + n - 1)
            rays[WX + i], rays[PX + i] = rays[WX + last], rays[PX + last]


@kernel
def start_lanes(
    first: int,
    n: int,
    places: NDArray[np.int64],
    limit: float,
    hits: SurfaceHits,
    rays: Array,
    found: NDArray[np.int32],
) -> None:
    """Let each lane start from the hit that its beam has so far, or from the range."""
    distance, geom_id, face = hits
    for lane in range(LANES):
        place = places[first + min(lane, n - 1)]
        hit = distance[place] >= 0.0
        rays[BEST + U(lane)] = distance[place] if hit else limit
        found[0, lane] = geom_id[place] if hit else NO_GEOM
        found[1, lane] = face[place]


@kernel
def start_geom(geom: int, rays: Array, found: NDArray[np.int32]) -> None:
    """Let a geom's triangles win over equal hits on geoms of higher id, and over no others."""
    for lane in range(LANES):
        rays[ROW + U(lane)] = NO_ROW if geom < found[0, lane] else -1.0


@kernel
def end_geom(geom: int, rays: Array, found: NDArray[np.int32]) -> None:
    """Note the geom's triangles that are best hits now."""
    for lane in range(LANES):
        row = rays[ROW + U(lane)]
        if (row >= 0.0) & (row < NO_ROW):
            found[0, lane], found[1, lane] = geom, int(row)


@kernel
def end_lanes(
    first: int,
    n: int,
    places: NDArray[np.int64],
    hits: SurfaceHits,
    rays: Array,
    found: NDArray[np.int32],
) -> None:
    """Write each lane's hit in the order that the sensor reports."""
    distance, geom_id, face = hits
    for lane in range(n):
        place = places[first + lane]
        hit = found[0, lane] != NO_GEOM
        distance[place] = rays[BEST + U(lane)] if hit else -1.0
        geom_id[place] = found[0, lane] if hit else -1
        face[place] = found[1, lane] if hit else -1
