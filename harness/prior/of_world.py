"""Prior maps made of the geometry of a world: its cells, or a splat as a reconstruction has it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.prior.grid import Grid, States
from wayproof.harness.prior.splats import Gaussians
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.models.random_streams import stream
from wayproof.models.worlds import World
from wayproof.models.worlds.solids import Solid

HALF_CELL = 0.49
"""Distance of a solid from the centre of a cell within which the cell is occupied, cells."""


def grid_of_world(world: World, resolution: float) -> Grid:
    """Return the states of the cells in the operating area of a world, without its movers.

    What is solid is occupied, and so is the layer of the floor; above it all else is free, and so
    is a hole in the floor. What lies below a floor is unknown.
    """
    window = Window.covering(world.low, world.high, resolution)
    states = np.full(window.shape, FREE, np.uint8)
    floor = FLOOR_LAYER - window.first[2]
    if floor >= 0:
        _lay_floor(states[:, :, : floor + 1], world, window)
    for solid in (*world.solids, *getattr(world, "terrain", ())):
        _fill(states, solid, window)
    return Grid(states, window.origin, resolution)


def _lay_floor(below: States, world: World, window: Window) -> None:
    """Set the layers (nx, ny, n) up to that of the floor: a plane, or slabs with holes."""
    if world.floor is None:
        below[:] = UNKNOWN
        below[:, :, -1] = OCCUPIED
        return
    nx, ny, _ = below.shape
    x, y = np.meshgrid(*((np.arange(n) + 0.5) * window.resolution for n in (nx, ny)), indexing="ij")
    points = window.origin + np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    points[:, 2] = 0.0
    borne = np.zeros(len(points), np.bool_)
    for slab in world.floor:
        borne |= slab.distance(points) <= HALF_CELL * window.resolution
    held = borne.reshape(nx, ny)
    below[held] = UNKNOWN
    below[held, -1] = OCCUPIED


def _fill(states: States, solid: Solid, window: Window) -> None:
    """Make the cells that a solid fills or cuts occupied."""
    size = window.resolution
    low = np.floor((np.array(solid.low) - window.origin) / size).astype(int) - 1
    end = np.ceil((np.array(solid.high) - window.origin) / size).astype(int) + 1
    low, end = np.clip(low, 0, window.shape), np.clip(end, 0, window.shape)
    if (low >= end).any():
        return
    cells = np.stack(np.meshgrid(*map(np.arange, low, end), indexing="ij"), axis=-1)
    centres = window.origin + (cells.reshape(-1, 3) + 0.5) * size
    inside = solid.distance(centres) <= HALF_CELL * size
    box = tuple(slice(a, b) for a, b in zip(low.tolist(), end.tolist(), strict=True))
    states[box][inside.reshape(cells.shape[:3])] = OCCUPIED


Array = NDArray[np.float64]

SPACING = 0.07
"""Distance of neighbouring Gaussians on a surface, m."""

FLATNESS = 0.01
"""Standard deviation across a surface, m."""

OPACITY = 0.95
FLOATER_SHARE, FLOATER_OPACITY = 0.02, 0.2
"""Share of the Gaussians that float in the air, as in real splats, and their opacity; chosen."""

PROBE = 1e-4
"""Length over which a distance is differentiated, m."""


def splat_of_world(world: World, spacing: float = SPACING) -> Gaussians:
    """Return gaussians on the surfaces of all solids and of the floor, and some that float.

    Each is a disc of the spacing, turned along the surface.
    """
    rng = stream(world.seed, "splat", 0)
    parts = [_on_surface(rng, solid, spacing) for solid in world.solids]
    parts.append(_on_floor(rng, world, spacing))
    points, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    floaters = round(FLOATER_SHARE * len(points))
    points = np.concatenate([points, rng.uniform(world.low, world.high, (floaters, 3))])
    normals = np.concatenate([normals, rng.standard_normal((floaters, 3))])
    deviations = np.tile([0.6 * spacing, 0.6 * spacing, FLATNESS], (len(points), 1))
    opacities = np.full(len(points), OPACITY)
    opacities[len(points) - floaters :] = FLOATER_OPACITY
    order = rng.permutation(len(points))
    return Gaussians(points[order], deviations, _facing(normals)[order], opacities[order])


def _on_surface(rng: np.random.Generator, solid: Solid, spacing: float) -> tuple[Array, Array]:
    """Return points on a solid's surface, and its normals there: (n, 3) each.

    The points of a jittered lattice within a spacing of the solid are drawn to it.
    """
    low, high = np.array(solid.low) - spacing, np.array(solid.high) + spacing
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    points = lattice + rng.uniform(0.0, spacing, lattice.shape)
    away = solid.distance(points)
    near = (away > PROBE) & (away < spacing)
    points, away = points[near], away[near]
    gradients = [
        (solid.distance(points + PROBE * np.eye(3)[axis]) - away) / PROBE for axis in range(3)
    ]
    normals = np.stack(gradients, axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return points - away[:, None] * normals, normals


def _on_floor(rng: np.random.Generator, world: World, spacing: float) -> tuple[Array, Array]:
    axes = [np.arange(a, b, spacing) for a, b in zip(world.low[:2], world.high[:2], strict=True)]
    flat = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    flat = flat + rng.uniform(0.0, spacing, flat.shape)
    points = np.column_stack([flat, np.zeros(len(flat))])
    if world.floor is not None:
        borne = np.zeros(len(points), np.bool_)
        for slab in world.floor:
            borne |= slab.distance(points) <= PROBE
        points = points[borne]
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def _facing(normals: Array) -> Array:
    """Return quaternions (n, 4), w x y z, that turn the z axis to directions (n, 3)."""
    x, y, z = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)).T
    turned = np.stack([1.0 + z, -y, x, np.zeros_like(z)], axis=1)
    turned[z < -1.0 + 1e-9] = [0.0, 1.0, 0.0, 0.0]
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))
