"""Feet of a model: the end of a leg's last link as a sphere."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.source import Source
from wayproof.models.robots.custom.writing import mesh_points

Kinds = mujoco.mjtGeom

TIP = 0.05
"""Share of a mesh's reach from the joint that its end is fitted over."""

MAX_RADIUS = 0.25
"""Maximum radius of a sphere fitted to a mesh's end, as a share of the reach."""


class FootSphere(NamedTuple):
    """A sphere at the end of a leg.

    Attributes:
        geom: Id of the geom that it is, or is the end of.
        place: (3,) centre in the world, m.
        radius: m.
        whole: Whether the geom is this sphere and nothing more.
    """

    geom: int
    place: Array
    radius: float
    whole: bool


def foot_sphere(source: Source, link: int) -> FootSphere | None:
    """Return the foot of a moving body that hangs on one joint.

    The lowest sphere that collides, or lowest end of a capsule; of a body with neither, the sphere
    fitted to the end of its colliding meshes that is farthest from its joint.

    Returns:
        None if the body has none of these.
    """
    model, data = source.model, source.data
    found: list[tuple[float, int, FootSphere]] = []
    for geom in source.colliding(link):
        radius, half = model.geom_size[geom, :2].tolist()
        at, axis = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)[:, 2]
        whole = bool(model.geom_type[geom] == Kinds.mjGEOM_SPHERE)
        if whole:
            ends = [at]
        elif model.geom_type[geom] == Kinds.mjGEOM_CAPSULE:
            ends = [at - half * axis, at + half * axis]
        else:
            continue
        found += [
            (float(end[2]) - radius, geom, FootSphere(geom, end.copy(), radius, whole))
            for end in ends
        ]
    return min(found, key=lambda one: one[:2])[2] if found else _mesh_end(source, link)


def _mesh_end(source: Source, link: int) -> FootSphere | None:
    """Fit a sphere to the end of a link's colliding meshes by least squares."""
    model, data = source.model, source.data
    joint = int(model.body_jntadr[link])
    meshes = [g for g in source.colliding(link) if model.geom_type[g] == Kinds.mjGEOM_MESH]
    if joint < 0 or not meshes:
        return None
    points = np.concatenate(
        [
            mesh_points(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            for geom in meshes
        ]
    )
    arms = points - data.xanchor[joint]
    axis = data.xaxis[joint]
    across = arms - np.outer(arms @ axis, axis)
    distance = np.linalg.norm(across, axis=1)
    farthest, reach = int(distance.argmax()), float(distance.max())
    if not reach > 0.0:
        return None
    along = arms @ (across[farthest] / reach)
    tip = points[along >= (1.0 - TIP) * reach]
    middle = tip.mean(axis=0)
    # |p - c|^2 = r^2 is linear in c and r^2 - |c|^2 (Coope 1993)
    offsets = tip - middle
    unknowns = np.column_stack([2.0 * offsets, np.ones(len(offsets))])
    solved, _, rank, _ = np.linalg.lstsq(unknowns, (offsets**2).sum(axis=1), rcond=None)
    square = float(solved[3] + solved[:3] @ solved[:3])
    if rank < 4 or not 0.0 < square < (MAX_RADIUS * reach) ** 2:
        return None
    geom = next(
        g for g, n in zip(meshes, np.cumsum([len(mesh_points(model, g)) for g in meshes]),
                          strict=True) if farthest < n
    )  # fmt: skip
    return FootSphere(geom, middle + solved[:3], float(np.sqrt(square)), whole=False)
