"""Sweeps against triangles: tiles of beams that walk trees of boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.fans import (
    ROUNDING,
    TILE,
    bound_fan,
    boxes_met,
    choose_frame,
    measure_packets,
    measure_slopes,
    set_fan,
)
from wayproof.models.rays.field_grid import Fields
from wayproof.models.rays.lanes import (
    Beams,
    Lanes,
    SurfaceHits,
    aim_lanes,
    end_geom,
    end_lanes,
    make_lanes,
    start_geom,
    start_lanes,
)
from wayproof.models.rays.packets import LANES, OX, PX, WIDTH, U, farthest_hit, localize
from wayproof.models.rays.walks import (
    Placed,
    Soup,
    farthest_of,
    list_geoms,
    walk_field,
    walk_tree,
)


@allocating
def meet_tiles(
    starts: NDArray[np.int64],
    beams: Beams,
    soup: Soup,
    fields: Fields,
    placed: Placed,
    limit: float,
    hits: SurfaceHits,
) -> None:
    """Meet the geoms with some tiles of a sweep, and keep the nearer hits.

    Args:
        starts: (t + 1,) first beam of each of these tiles, and one past the last beam.
        beams: Beams of the sweep.
        soup: Triangles.
        fields: Height fields.
        placed: Geoms.
        limit: Longest distance, m; finite.
        hits: Hits so far; nearer ones are written over them.
    """
    lanes = make_lanes(len(placed.geoms))
    for tile in range(len(starts) - 1):
        start, stop = starts[tile], starts[tile + 1]
        first, size = start, LANES
        while first < stop:
            n = min(size, stop - first)
            if not meet_together(first, n, beams, soup, fields, placed, limit, hits, lanes):
                size = WIDTH if n > WIDTH else 1
                continue
            first += n
            if (first - start) % LANES == 0:
                size = LANES
            elif (first - start) % WIDTH == 0:
                size = max(size, WIDTH)


@kernel
def meet_together(
    first: int,
    n: int,
    beams: Beams,
    soup: Soup,
    fields: Fields,
    placed: Placed,
    limit: float,
    hits: SurfaceHits,
    lanes: Lanes,
) -> bool:
    """Meet the geoms with the n beams from `first` on; return False if these are too far apart."""
    rays, frame, slopes = lanes.rays, lanes.frame, lanes.slopes
    aim_lanes(first, n, beams, rays)
    choose_frame(n, rays, frame)
    if not measure_slopes(rays, lanes.bits, frame, slopes) and n > 1:
        return False
    stop = n if len(beams.origins) > 1 else 1
    count = (n + WIDTH - 1) // WIDTH
    margin = margin_of(placed.reaches[len(placed.geoms)], rays, PX, stop)
    set_fan(TILE, slopes, frame, rays, PX, 0, stop, margin, lanes.fans, lanes.sides)
    bound_fan(slopes, frame, rays, PX, stop, limit, margin, lanes.fans)
    near = list_geoms(placed.boxes, placed.links, limit, lanes)
    if near == 0:
        return True
    measure_packets(count, rays, lanes.bits, slopes)
    start_lanes(first, n, beams.places, limit, hits, rays, lanes.found)
    for p in range(count):
        lanes.farthest[p] = farthest_hit(rays, lanes.bits, U(WIDTH * p))
    for k in range(near):
        if lanes.near_ahead[k] > farthest_of(count, lanes.farthest):
            break
        meet_geom(lanes.near[k], n, stop, soup, fields, placed, limit, lanes)
    end_lanes(first, n, beams.places, hits, rays, lanes.found)
    return True


@kernel
def meet_geom(
    g: int,
    n: int,
    stop: int,
    soup: Soup,
    fields: Fields,
    placed: Placed,
    limit: float,
    lanes: Lanes,
) -> None:
    """Meet one geom with n beams, in its frame.

    Args:
        g: Row of the geom in `placed`.
        n: Number of beams.
        stop: Number of beams whose origins differ; 1 if all have the same.
        soup: Triangles.
        fields: Height fields.
        placed: Geoms.
        limit: Longest distance, m.
        lanes: Beams in the world, and their best hits, which are updated.
    """
    rays, local, slopes, fans, sides = (
        lanes.rays, lanes.local_frame, lanes.slopes, lanes.fans, lanes.sides,
    )  # fmt: skip
    localize(rays, placed.poses, g)
    turn_frame(lanes.frame, placed.poses, g, local)
    margin = margin_of(placed.reaches[g], rays, OX, stop)
    set_fan(TILE, slopes, local, rays, OX, 0, stop, margin, fans, sides)
    bound_fan(slopes, local, rays, OX, stop, limit, margin, fans)
    geom, root, field = placed.geoms[g, 0], placed.geoms[g, 1], placed.geoms[g, 2]
    count = (n + WIDTH - 1) // WIDTH
    most = farthest_of(count, lanes.farthest)
    boxes = soup.boxes
    if field < 0 and boxes_met(boxes, root, boxes, root, 0, fans, sides, TILE, most) == 0:
        return
    for p in range(count):
        start = WIDTH * p
        end = min(start + WIDTH, n) if stop > 1 else start + 1
        set_fan(p, slopes, local, rays, OX, start, end, margin, fans, sides)
    start_geom(geom, rays, lanes.found)
    nearer = walk_tree(count, root, soup, lanes)
    if field >= 0:
        nearer |= walk_field(count, field, fields, lanes)
    if nearer:
        end_geom(geom, rays, lanes.found)


@kernel
def margin_of(reach: float, rays: Array, row: np.uint64, stop: int) -> float:
    """Return the margin of planes among boxes within `reach` of a frame's origin, m."""
    largest = 0.0
    for lane in range(stop):
        i = row + U(lane)
        far = abs(rays[i]) + abs(rays[i + U(LANES)]) + abs(rays[i + U(2 * LANES)])
        largest = max(largest, far)
    return ROUNDING * (reach + largest)


@kernel
def turn_frame(frame: Array, poses: Array, g: int, local: Array) -> None:
    """Turn the axes of a fan from the world to a geom's frame."""
    for axis in range(3):
        x, y, z = frame[axis, 0], frame[axis, 1], frame[axis, 2]
        for k in range(3):
            local[axis, k] = poses[g, 3 + k] * x + poses[g, 6 + k] * y + poses[g, 9 + k] * z
