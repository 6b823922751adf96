"""Insides of closed meshes, which are solid though cells show their surface alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh

MOST_HOLLOWS = 400
"""Maximum number of hollows of a mesh that are looked at, largest first."""

LEAST_HOLLOW = 8
"""Number of cells from which a hollow is looked at."""

HALF = 0.5
"""Winding number from which a place is inside: 1 within one closed surface, 0 outside."""


def is_closed(faces: NDArray[np.int64]) -> bool:
    """Return whether each edge of triangles (m, 3) is run once in each direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ahead, back = (np.unique(run, axis=0) for run in (edges, edges[:, ::-1]))
    return len(ahead) == len(edges) and np.array_equal(ahead, back)


def fill_inside(
    occupied: NDArray[np.bool_], mesh: Mesh, low: NDArray[np.float64], cell: float
) -> None:
    """Occupy the hollows of a grid that lie inside of a closed mesh.

    A hollow is a connected part of the free cells that does not reach the border of the grid. One
    that the triangles face, such as a room with its door shut, stays free.

    Args:
        occupied: (nx, ny, nz) cells that the surface passes through; changed.
        mesh: Closed, its triangles counter-clockwise from outside.
        low: (3,) low corner of the grid, m.
        cell: Side of a cell, m.
    """
    from scipy import ndimage

    labels, count = ndimage.label(~occupied)
    if not count:
        return
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    for axis in range(3):
        for side in (0, -1):
            sizes[labels.take(side, axis)] = 0  # it reaches the border
    largest = np.argsort(-sizes, kind="stable")[:MOST_HOLLOWS]
    hollows = [int(label) for label in largest if sizes[label] >= LEAST_HOLLOW]
    if not hollows:
        return
    places = np.array([_deepest(labels == label) for label in hollows])
    inside = winding_numbers(mesh, low + (places + 0.5) * cell) > HALF
    solid = np.zeros(count + 1, np.bool_)
    solid[np.array(hollows)[inside]] = True
    occupied |= solid[labels]


def _deepest(hollow: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the cell of a hollow that is about farthest from its surroundings."""
    from scipy import ndimage

    around = ndimage.find_objects(hollow.astype(np.int8))[0]
    depth = ndimage.distance_transform_cdt(np.pad(hollow[around], 1))
    place = np.unravel_index(int(np.argmax(depth)), depth.shape)
    return tuple(int(n) - 1 + part.start for n, part in zip(place, around, strict=True))


def winding_numbers(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.float64]:  # (n,)
    """Return how often a surface winds around points (n, 3).

    Source: the solid angle of a triangle by Van Oosterom and Strackee (1983), "The Solid Angle of a
    Plane Triangle", IEEE Transactions on Biomedical Engineering 30(2).
    """
    corners = mesh.vertices[mesh.faces]  # (m, 3, 3)
    numbers = np.empty(len(points))
    for n, point in enumerate(points):
        a, b, c = (corners[:, k] - point for k in range(3))
        la, lb, lc = (np.sqrt((v * v).sum(axis=1)) for v in (a, b, c))
        volume = (a * np.cross(b, c)).sum(axis=1)
        below = la * lb * lc + (a * b).sum(axis=1) * lc
        below += (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
        numbers[n] = float(np.arctan2(volume, below).sum()) / (2.0 * np.pi)
    return numbers
