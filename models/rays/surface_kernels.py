"""Meeting triangles: packets of rays that walk a tree of boxes together.

A packet is eight rays that are handled as one vector: eight neighbours of a sweep mostly visit the
same nodes, and a triangle's constants are loaded once for all of them. A ray that a packet carries
in vain costs a lane, never a wrong answer, so packets may be of any rays.

Whether a ray passes a triangle is decided by the side on which it passes each edge, in Plücker
coordinates (Jones, "Intersecting a ray and a triangle with Plücker coordinates", Ray Tracing News
13(1), 2000). The numbers of an edge are those of its neighbour's with the other sign, to the last
bit, so that no ray slips through between two triangles.

The tables stand here because numba's cache would not notice if their fields were put in another
order in another file.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.tree import DEEPEST

WIDTH = 8
"""Rays of a packet: a row of a tile, and one 512-bit register of doubles."""

LEAST = 1e-15
"""MuJoCo's mjMINVAL: a triangle of less area than this, as a ray sees it, is not met, m^2."""

STACK = 2 * DEEPEST
"""Nodes that wait during a walk: of the tree in the world and of one asset's."""

NO_GEOM = np.iinfo(np.int32).max
"""Id of no geom, so that any geom's id is lower."""

# Rows of a packet.
DX, DY, DZ = 0, 1, 2  # direction
OX, OY, OZ = 3, 4, 5  # origin, m
MX, MY, MZ = 6, 7, 8  # moment, origin x direction
IX, IY, IZ = 9, 10, 11  # inverse of the direction
PACKET_ROWS = 12

# Columns of a triangle: three edges of six, then its plane.
EDGE = 6  # midpoint x edge, edge
NORMAL, OFFSET = 18, 21  # normal with twice the area as its length; its product with a vertex
TRIANGLE_COLUMNS = 22


class Soup(NamedTuple):
    """Triangles of all assets, each asset in its own frame under a tree of its own.

    Attributes:
        boxes: (k, 6) of all trees' nodes.
        links: (k, 3) likewise; children and triangles are rows of these tables.
        triangles: (t, 22) in the order of the leaves.
    """

    boxes: Array
    links: NDArray[np.int32]
    triangles: Array


class Placed(NamedTuple):
    """Geoms that are made of triangles, where they are now, under one tree in the world.

    Attributes:
        boxes: (k, 6) of the tree's nodes, in the world.
        links: (k, 3) likewise; the leaves' items are rows of these tables.
        geoms: (g, 2) geom id in the model, and the node of `Soup` that holds the whole geom.
        poses: (g, 12) position in the world, m, and R_world_geom, row-major.
    """

    boxes: Array
    links: NDArray[np.int32]
    geoms: NDArray[np.int32]
    poses: Array


@kernel
def complete(packets: Array, p: int) -> None:
    """Fill in the rows of a packet that follow from its directions and origins."""
    for i in range(WIDTH):
        dx, dy, dz = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
        ox, oy, oz = packets[p, OX, i], packets[p, OY, i], packets[p, OZ, i]
        packets[p, MX, i] = oy * dz - oz * dy
        packets[p, MY, i] = oz * dx - ox * dz
        packets[p, MZ, i] = ox * dy - oy * dx
        # A finite inverse keeps 0 * infinity out; over any range it moves a ray by less than the
        # margin of the boxes.
        packets[p, IX, i] = 1.0 / (dx if abs(dx) > 1e-30 else 1e-30)
        packets[p, IY, i] = 1.0 / (dy if abs(dy) > 1e-30 else 1e-30)
        packets[p, IZ, i] = 1.0 / (dz if abs(dz) > 1e-30 else 1e-30)


@kernel
def count_in_box(packets: Array, p: int, boxes: Array, node: int, best: Array) -> int:
    """How many rays of a packet enter a box before the best hit they have."""
    x0, y0, z0 = boxes[node, 0], boxes[node, 1], boxes[node, 2]
    x1, y1, z1 = boxes[node, 3], boxes[node, 4], boxes[node, 5]
    count = 0
    for i in range(WIDTH):
        low = (x0 - packets[p, OX, i]) * packets[p, IX, i]
        high = (x1 - packets[p, OX, i]) * packets[p, IX, i]
        near = low if low < high else high
        far = high if low < high else low
        low = (y0 - packets[p, OY, i]) * packets[p, IY, i]
        high = (y1 - packets[p, OY, i]) * packets[p, IY, i]
        enter = low if low < high else high
        leave = high if low < high else low
        near = near if near > enter else enter
        far = far if far < leave else leave
        low = (z0 - packets[p, OZ, i]) * packets[p, IZ, i]
        high = (z1 - packets[p, OZ, i]) * packets[p, IZ, i]
        enter = low if low < high else high
        leave = high if low < high else low
        near = near if near > enter else enter
        far = far if far < leave else leave
        count += (near <= far) & (far >= 0.0) & (near <= best[p, i])
    return count


@kernel
def load(triangles: Array, row: int) -> tuple[float, ...]:
    """One row as scalars: only what is loaded before a loop over rays lets it become vectors."""
    t, k = triangles, row
    return (
        t[k, 0], t[k, 1], t[k, 2], t[k, 3], t[k, 4], t[k, 5],
        t[k, 6], t[k, 7], t[k, 8], t[k, 9], t[k, 10], t[k, 11],
        t[k, 12], t[k, 13], t[k, 14], t[k, 15], t[k, 16], t[k, 17],
        t[k, 18], t[k, 19], t[k, 20], t[k, 21],
    )  # fmt: skip


@kernel
def reach_triangle(packets: Array, p: int, i: int, triangle: tuple[float, ...]) -> float:
    """Distance of one ray of a packet to a triangle from either side, infinite for a miss."""
    ax, ay, az, au, av, aw, bx, by, bz, bu, bv, bw, cx, cy, cz, cu, cv, cw = triangle[:NORMAL]
    nx, ny, nz, offset = triangle[NORMAL:]
    dx, dy, dz = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
    mx, my, mz = packets[p, MX, i], packets[p, MY, i], packets[p, MZ, i]
    a = (dx * ax + dy * ay + dz * az) + (mx * au + my * av + mz * aw)
    b = (dx * bx + dy * by + dz * bz) + (mx * bu + my * bv + mz * bw)
    c = (dx * cx + dy * cy + dz * cz) + (mx * cu + my * cv + mz * cw)
    inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0))
    slope = dx * nx + dy * ny + dz * nz
    x = (
        offset - (packets[p, OX, i] * nx + packets[p, OY, i] * ny + packets[p, OZ, i] * nz)
    ) / slope
    return x if inside & (abs(slope) >= LEAST) & (x >= 0.0) else math.inf


@kernel
def count_on_triangle(packets: Array, p: int, triangles: Array, row: int, best: Array) -> int:
    """How many rays of a packet meet a triangle no farther than the best hit they have."""
    triangle = load(triangles, row)
    count = 0
    for i in range(WIDTH):
        count += reach_triangle(packets, p, i, triangle) <= best[p, i]
    return count


@kernel
def keep_nearest(
    packets: Array,
    p: int,
    triangles: Array,
    row: int,
    geom: int,
    best: Array,
    found: NDArray[np.int32],
) -> None:
    """Take over nearer hits; of equal ones the lower geom id's, then the lower row's."""
    triangle = load(triangles, row)
    for i in range(WIDTH):
        x = reach_triangle(packets, p, i, triangle)
        lower = (geom < found[p, 0, i]) | ((geom == found[p, 0, i]) & (row < found[p, 1, i]))
        if (x < best[p, i]) | ((x == best[p, i]) & lower):
            best[p, i] = x
            found[p, 0, i] = geom
            found[p, 1, i] = row


@kernel
def walk(
    packets: Array,
    p: int,
    boxes: Array,
    links: NDArray[np.int32],
    triangles: Array,
    root: int,
    geom: int,
    best: Array,
    found: NDArray[np.int32],
    stack: NDArray[np.int32],
    bottom: int,
) -> None:
    """Meet one geom's triangles with a packet in its frame, nodes roughly front to back."""
    stack[bottom] = root
    waiting = bottom + 1
    while waiting > bottom:
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
        for row in range(first, first + items):
            if count_on_triangle(packets, p, triangles, row, best) > 0:
                keep_nearest(packets, p, triangles, row, geom, best, found)


@kernel
def bring(packets: Array, p: int, poses: Array, g: int, local: Array) -> None:
    """Bring a packet from the world into a geom's frame."""
    px, py, pz = poses[g, 0], poses[g, 1], poses[g, 2]
    m0, m1, m2 = poses[g, 3], poses[g, 4], poses[g, 5]
    m3, m4, m5 = poses[g, 6], poses[g, 7], poses[g, 8]
    m6, m7, m8 = poses[g, 9], poses[g, 10], poses[g, 11]
    for i in range(WIDTH):
        x, y, z = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
        local[p, DX, i] = m0 * x + m3 * y + m6 * z
        local[p, DY, i] = m1 * x + m4 * y + m7 * z
        local[p, DZ, i] = m2 * x + m5 * y + m8 * z
        x, y, z = packets[p, OX, i] - px, packets[p, OY, i] - py, packets[p, OZ, i] - pz
        local[p, OX, i] = m0 * x + m3 * y + m6 * z
        local[p, OY, i] = m1 * x + m4 * y + m7 * z
        local[p, OZ, i] = m2 * x + m5 * y + m8 * z
    complete(local, p)


@kernel
def meet_packets(
    count: int,
    packets: Array,
    local: Array,
    world_boxes: Array,
    world_links: NDArray[np.int32],
    geoms: NDArray[np.int32],
    poses: Array,
    boxes: Array,
    links: NDArray[np.int32],
    triangles: Array,
    best: Array,
    found: NDArray[np.int32],
    stack: NDArray[np.int32],
) -> None:
    """Meet all geoms with packets whose directions and origins are in the world.

    Several packets at a time and tables as plain arrays, because every call counts references to
    all arrays it is given, and every look into a tuple to those it takes out.
    """
    for p in range(count):
        complete(packets, p)
        stack[0] = 0
        waiting = 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if count_in_box(packets, p, world_boxes, node, best) == 0:
                continue
            first, items, axis = world_links[node, 0], world_links[node, 1], world_links[node, 2]
            if items == 0:
                backwards = packets[p, axis, 0] < 0.0
                stack[waiting] = first if backwards else first + 1
                stack[waiting + 1] = first + 1 if backwards else first
                waiting += 2
            for g in range(first, first + items):
                bring(packets, p, poses, g, local)
                walk(
                    local, p, boxes, links, triangles, geoms[g, 1], geoms[g, 0], best, found,
                    stack, waiting,
                )  # fmt: skip


@kernel
def start_lane(
    p: int,
    i: int,
    place: int,
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
    face: NDArray[np.int32],
    best: Array,
    found: NDArray[np.int32],
) -> None:
    """Let a lane start from the hit that its ray has so far, or from the range."""
    hit = distance[place] >= 0.0
    best[p, i] = distance[place] if hit else limit
    found[p, 0, i] = geom_id[place] if hit else NO_GEOM
    found[p, 1, i] = face[place]


@kernel
def end_lane(
    p: int,
    i: int,
    place: int,
    distance: Array,
    geom_id: NDArray[np.int32],
    face: NDArray[np.int32],
    best: Array,
    found: NDArray[np.int32],
) -> None:
    """Hand over what a lane has met."""
    hit = found[p, 0, i] != NO_GEOM
    distance[place] = best[p, i] if hit else -1.0
    geom_id[place] = found[p, 0, i] if hit else -1
    face[place] = found[p, 1, i] if hit else -1


@kernel
def meet_tiles(
    most: int,
    beams: Array,
    places: NDArray[np.int64],
    moments: NDArray[np.int32],
    starts: NDArray[np.int64],
    origins: Array,
    rotations: Array,
    soup: Soup,
    placed: Placed,
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
    face: NDArray[np.int32],
) -> None:
    """Meet the geoms with some tiles of a sweep.

    Args:
        most: Beams of the largest tile, or more.
        beams: (3, n) unit directions, sensor frame, tile by tile.
        places: (n,) where the result of each beam belongs.
        moments: (n,) pose of the sensor at each beam; of no matter when there is one pose.
        starts: (t + 1,) first beam of each of these tiles, and one past the last beam.
        origins: (m, 3) of the sensor in the world, m.
        rotations: (m, 3, 3) R_world_sensor.
        soup: Triangles.
        placed: Geoms.
        limit: Longest distance, m; finite.
        distance: (n,) hits so far, m, -1 for none; nearer ones are written over them.
        geom_id: (n,) likewise.
        face: (n,) likewise, row in `soup.triangles`.
    """
    world_boxes, world_links, geoms, poses = placed
    boxes, links, triangles = soup
    room = (most + WIDTH - 1) // WIDTH
    packets, local = np.empty((room, PACKET_ROWS, WIDTH)), np.empty((room, PACKET_ROWS, WIDTH))
    best, found = np.empty((room, WIDTH)), np.empty((room, 2, WIDTH), np.int32)
    stack = np.empty(STACK, np.int32)
    for tile in range(len(starts) - 1):
        start, stop = starts[tile], starts[tile + 1]
        count = (stop - start + WIDTH - 1) // WIDTH
        for lane in range(count * WIDTH):
            p, i = lane // WIDTH, lane % WIDTH
            j = start + lane if start + lane < stop else stop - 1  # spare lanes repeat the last
            k = moments[j] if len(origins) > 1 else 0
            x, y, z = beams[0, j], beams[1, j], beams[2, j]
            for axis in range(3):
                r0, r1, r2 = rotations[k, axis, 0], rotations[k, axis, 1], rotations[k, axis, 2]
                packets[p, DX + axis, i] = x * r0 + y * r1 + z * r2
                packets[p, OX + axis, i] = origins[k, axis]
            start_lane(p, i, places[j], limit, distance, geom_id, face, best, found)
        meet_packets(
            count, packets, local, world_boxes, world_links, geoms, poses, boxes, links, triangles,
            best, found, stack,
        )  # fmt: skip
        for lane in range(stop - start):
            place = places[start + lane]
            end_lane(lane // WIDTH, lane % WIDTH, place, distance, geom_id, face, best, found)
