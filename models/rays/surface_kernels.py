"""Sweeps against triangles: packets of rays that walk trees of boxes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.packets import (
    DX,
    OX,
    PACKET_ROWS,
    WIDTH,
    complete,
    count_in_box,
    count_on_triangle,
    keep_nearest,
    localize,
)
from wayproof.models.rays.tree import DEEPEST

STACK_SIZE = 2 * DEEPEST
"""Maximum number of nodes that wait during a walk: of the world's tree and of one asset's."""

NO_GEOM = np.iinfo(np.int32).max
"""Sentinel for no geom: an id above any geom's."""


class Soup(NamedTuple):
    """Triangles of all assets, each asset in its own frame under a tree of its own.

    Attributes:
        boxes: (k, 6) nodes of all trees.
        links: (k, 3) likewise; children and triangles are rows of these tables.
        triangles: (t, 22) in the order of the leaves.
    """

    boxes: Array
    links: NDArray[np.int32]
    triangles: Array


class Placed(NamedTuple):
    """Geoms made of triangles at their present poses, under one tree in the world.

    Attributes:
        boxes: (k, 6) nodes of the tree, in the world.
        links: (k, 3) likewise; the leaves' items are rows of these tables.
        geoms: (g, 2) geom id in the model, and the node of `Soup` that holds the whole geom.
        poses: (g, 12) position in the world, m, and R_world_geom, row-major.
    """

    boxes: Array
    links: NDArray[np.int32]
    geoms: NDArray[np.int32]
    poses: Array


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
    """Scratch arrays for the k packets of one tile.

    Attributes:
        packets: (k, 12, 8) rays in the world.
        local: (k, 12, 8) the same rays in one geom's frame.
        best: (k, 8) nearest hits so far, m.
        found: (k, 2, 8) geom id and triangle of these.
        stack: (STACK_SIZE,) nodes that wait.
    """

    packets: Array
    local: Array
    best: Array
    found: NDArray[np.int32]
    stack: NDArray[np.int32]


@kernel
def meet_tiles(
    starts: NDArray[np.int64],
    beams: Beams,
    soup: Soup,
    placed: Placed,
    limit: float,
    hits: SurfaceHits,
) -> None:
    """Meet the geoms with some tiles of a sweep, and keep the nearer hits.

    Args:
        starts: (t + 1,) first beam of each of these tiles, and one past the last beam.
        beams: Beams of the sweep.
        soup: Triangles.
        placed: Geoms.
        limit: Longest distance, m; finite.
        hits: Hits so far; nearer ones are written over them.
    """
    largest = 0
    for tile in range(len(starts) - 1):
        largest = max(largest, starts[tile + 1] - starts[tile])
    room = (largest + WIDTH - 1) // WIDTH
    lanes = Lanes(
        np.empty((room, PACKET_ROWS, WIDTH)),
        np.empty((room, PACKET_ROWS, WIDTH)),
        np.empty((room, WIDTH)),
        np.empty((room, 2, WIDTH), np.int32),
        np.empty(STACK_SIZE, np.int32),
    )
    for tile in range(len(starts) - 1):
        start, stop = starts[tile], starts[tile + 1]
        aim_lanes(start, stop, beams, lanes.packets)
        start_lanes(start, stop, beams.places, limit, hits, lanes)
        meet_packets((stop - start + WIDTH - 1) // WIDTH, lanes, placed, soup)
        end_lanes(start, stop, beams.places, hits, lanes)


@kernel
def aim_lanes(start: int, stop: int, beams: Beams, packets: Array) -> None:
    """Write a tile's directions and origins in the world; spare lanes repeat the last beam."""
    directions, _, pose_indices, origins, rotations = beams
    rolling = len(origins) > 1
    count = (stop - start + WIDTH - 1) // WIDTH
    for lane in range(count * WIDTH):
        p, i = lane // WIDTH, lane % WIDTH
        j = start + lane if start + lane < stop else stop - 1
        k = pose_indices[j] if rolling else 0
        x, y, z = directions[0, j], directions[1, j], directions[2, j]
        for axis in range(3):
            r0, r1, r2 = rotations[k, axis, 0], rotations[k, axis, 1], rotations[k, axis, 2]
            packets[p, DX + axis, i] = x * r0 + y * r1 + z * r2
            packets[p, OX + axis, i] = origins[k, axis]


@kernel
def start_lanes(
    start: int,
    stop: int,
    places: NDArray[np.int64],
    limit: float,
    hits: SurfaceHits,
    lanes: Lanes,
) -> None:
    """Let each lane of a tile start from the hit that its ray has so far, or from the range."""
    distance, geom_id, face = hits
    best, found = lanes.best, lanes.found
    count = (stop - start + WIDTH - 1) // WIDTH
    for lane in range(count * WIDTH):
        p, i = lane // WIDTH, lane % WIDTH
        place = places[start + lane if start + lane < stop else stop - 1]
        hit = distance[place] >= 0.0
        best[p, i] = distance[place] if hit else limit
        found[p, 0, i] = geom_id[place] if hit else NO_GEOM
        found[p, 1, i] = face[place]


@kernel
def end_lanes(
    start: int, stop: int, places: NDArray[np.int64], hits: SurfaceHits, lanes: Lanes
) -> None:
    """Write each lane's hit in the order that the sensor reports."""
    distance, geom_id, face = hits
    best, found = lanes.best, lanes.found
    for lane in range(stop - start):
        p, i = lane // WIDTH, lane % WIDTH
        place = places[start + lane]
        hit = found[p, 0, i] != NO_GEOM
        distance[place] = best[p, i] if hit else -1.0
        geom_id[place] = found[p, 0, i] if hit else -1
        face[place] = found[p, 1, i] if hit else -1


@kernel
def meet_packets(count: int, lanes: Lanes, placed: Placed, soup: Soup) -> None:
    """Meet all geoms with packets whose directions and origins are in the world.

    All packets of a tile in one call, because every call counts references to all arrays given.
    """
    packets, local, best, _, stack = lanes
    boxes, links, geoms, poses = placed
    for p in range(count):
        complete(packets, p)
        stack[0] = 0
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if count_in_box(packets, p, boxes, node, best) == 0:
                continue
            first, items, axis = links[node, 0], links[node, 1], links[node, 2]
            if items == 0:
                backwards = packets[p, axis, 0] < 0.0
                stack[waiting] = first if backwards else first + 1
                stack[waiting + 1] = first + 1 if backwards else first
                waiting += 2
            for g in range(first, first + items):
                localize(packets, p, poses, g, local)
                walk(p, geoms[g, 0], geoms[g, 1], soup, lanes, waiting)


@kernel
def walk(p: int, geom: int, root: int, soup: Soup, lanes: Lanes, bottom: int) -> None:
    """Meet one geom's triangles with packet p in its frame, nodes roughly front to back.

    Args:
        p: Packet.
        geom: Geom id.
        root: Node of `soup` that holds the whole geom.
        soup: Triangles.
        lanes: `local`, `best` and `found` of the packet.
        bottom: First free place on the stack.
    """
    boxes, links, triangles = soup
    _, local, best, found, stack = lanes
    stack[bottom] = root
    waiting = bottom + 1
    while waiting > bottom:
        waiting -= 1
        node = stack[waiting]
        if count_in_box(local, p, boxes, node, best) == 0:
            continue
        first, items, axis = links[node, 0], links[node, 1], links[node, 2]
        if items == 0:
            backwards = local[p, axis, 0] < 0.0
            stack[waiting] = first if backwards else first + 1
            stack[waiting + 1] = first + 1 if backwards else first
            waiting += 2
        for row in range(first, first + items):
            if count_on_triangle(local, p, triangles, row, best) > 0:
                keep_nearest(local, p, triangles, row, geom, best, found)
