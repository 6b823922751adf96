"""Tables that the kernels of the tile caster read and write."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array


class Geoms(NamedTuple):
    """Tables over the ray-visible geoms, in the order of their ids.

    Each is, in its own frame, inside the Minkowski sum of an ellipsoid and a box, and either
    may be flat: a capsule is that of a ball and a line, a cylinder that of a disc and a line.

    Attributes:
        ids: (g,) geom id in the model.
        kinds: (g,) MuJoCo's `mjtGeom`.
        sizes: (g, 3) MuJoCo's sizes, m.
        axes: (g, 3) half axes of the ellipsoid, m.
        sides: (g, 3) half sides of the box, m; those of a plane may be as good as endless.
        radii: (g,) radius of the ball about each geom, m.
        roots: (g,) node of `Soup` that holds its triangles, -1 for a primitive.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major; of a sphere the identity, which MuJoCo's caster
            does not turn either.
    """

    ids: NDArray[np.int32]
    kinds: NDArray[np.int32]
    sizes: Array
    axes: Array
    sides: Array
    radii: Array
    roots: NDArray[np.int32]
    positions: Array
    rotations: Array


class Soup(NamedTuple):
    """Triangles of all assets, each asset in its own frame under a tree of its own.

    Attributes:
        boxes: (k, 48) nodes of all trees, see `WideTree`.
        links: (k, 8) likewise; children and triangles are rows of these tables.
        vertices: (v, 3) m.
        corners: (t, 3) rows of the vertices of each triangle, in the order of the leaves.
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    vertices: Array
    corners: NDArray[np.int32]


class Waiting(NamedTuple):
    """Children that wait during a walk down a tree, the nearest on top.

    Attributes:
        links: (STACK_SIZE,) their links.
        ahead: (STACK_SIZE,) lower bounds of the distances to them, m.
    """

    links: NDArray[np.int64]
    ahead: NDArray[np.float32]


class Pattern(NamedTuple):
    """Beams of one sweep in the order of their tiles, and the cones about them.

    Attributes:
        beams: (3, n) unit directions, sensor frame, in the order of the tiles.
        places: (n,) index of each beam in the order that the sensor reports.
        tile_starts: (t + 1,) first beam of each tile, and n.
        tile_cones: (t, 5) axis in the sensor frame, cosine and sine of the half angle.
        block_starts: (b + 1,) first tile of each block, and t.
        block_cones: (b, 5) likewise.
        pose_indices: (n,) index of the scan pose that each beam leaves from, in the order of the
            tiles; 0 where there is one.
    """

    beams: Array
    places: NDArray[np.int64]
    tile_starts: NDArray[np.int64]
    tile_cones: Array
    block_starts: NDArray[np.int64]
    block_cones: Array
    pose_indices: NDArray[np.int32]


class Sweep(NamedTuple):
    """Scan poses of a pattern, and the geoms as seen from there.

    Attributes:
        origins: (m, 3) in the world, m.
        turns: (m, 3, 3) R_world_sensor.
        R: (3, 3) rotation of `beams` to the world: R_world_sensor, or the identity.
        beams: (3, n) directions in the order of the tiles: the pattern's own if all beams leave
            from one pose, else in the world, written block by block as that is cast.
        spread: Radius of the ball about the first origin that holds them all, m.
        limit: Longest distance of a hit, m; finite.
        tile_cones: (t, 5) cones about the beams in the world, written likewise.
        block_cones: (b, 5) likewise.
        order: (g,) rows of `Geoms` by ascending lower bound of the distance.
        views: (6, g) in that order, by `view_geoms`.
        local: (g, 3) first origin in each geom's frame, m, in the order of the ids.
    """

    origins: Array
    turns: Array
    R: Array
    beams: Array
    spread: float
    limit: float
    tile_cones: Array
    block_cones: Array
    order: NDArray[np.int64]
    views: Array
    local: Array


class Room(NamedTuple):
    """Scratch arrays for tiles of up to w beams against g geoms.

    Attributes:
        v: (3, w) directions in the world.
        starts: (3, w) origins in the world, m; used for sweeps from several poses only.
        local_starts: (3, w) the same origins in a geom's frame, m.
        reach: (w,) distances to one geom, m.
        best: (w + 1,) nearest ones so far, m, and the farthest of these.
        best_bits: (w + 1,) the same memory as integers.
        best_geom: (w,) rows of `Geoms`.
        walls: (5, 3) normals of the planes about a tile, by `enclose`.
        slack: (g,) angular slack of each view, by `select_views`.
        block_views: (6, g) views of the geoms that a block may meet.
        block_rows: (g,) rows of `Geoms` of these.
        chosen: (g + 1,) indices of views, by `select_views`.
    """

    v: Array
    starts: Array
    local_starts: Array
    reach: Array
    best: Array
    best_bits: NDArray[np.int64]
    best_geom: NDArray[np.int64]
    walls: Array
    slack: Array
    block_views: Array
    block_rows: NDArray[np.int64]
    chosen: NDArray[np.int64]
