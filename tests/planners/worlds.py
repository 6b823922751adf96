import dataclasses

import numpy as np
from scipy.ndimage import distance_transform_edt

from wayproof.planners import Body, FreeSpace

TRUNCATION = 200
BLOCKED_AT_OR_BELOW = 4

LONG = Body(offsets=(-0.3, 0.0, 0.3), radii=(0.2, 0.2, 0.2))


def make_space(blocked: np.ndarray, resolution: float = 0.1) -> FreeSpace:
    """A space whose field is the exact truncated distance to the blocked cells, shape (x, y, z)."""
    distance = distance_transform_edt(~blocked) if blocked.any() else np.full(blocked.shape, 1e3)
    field = np.minimum(np.rint(distance**2), TRUNCATION).astype(np.uint16)
    cost = np.exp(-0.5 * (np.sqrt(np.arange(TRUNCATION + 1.0)) - 2.0)).clip(0.0, 1.0)
    cost[-1] = 0.0
    return FreeSpace(field, np.array([-1.0, -2.0, 0.5]), resolution, BLOCKED_AT_OR_BELOW, cost)


def point(space: FreeSpace, i: float, j: float, k: float = 0.5) -> np.ndarray:
    """World point of continuous cell coordinates."""
    return space.origin + space.resolution * np.array([i, j, k])


def make_maze() -> FreeSpace:
    """60 x 40 cells, two walls with a gap at opposite ends."""
    blocked = np.zeros((60, 40, 1), dtype=bool)
    blocked[20, :30] = True
    blocked[40, 10:] = True
    return make_space(blocked)


def make_boxes() -> FreeSpace:
    """60 x 40 x 25 cells, ten random boxes away from both ends."""
    blocked = np.zeros((60, 40, 25), dtype=bool)
    rng = np.random.default_rng(4)
    for low in rng.integers([12, 0, 0], [42, 34, 18], size=(10, 3)):
        blocked[tuple(slice(corner, corner + 7) for corner in low)] = True
    return make_space(blocked)


def make_room() -> FreeSpace:
    """200 x 200 free cells: nothing limits the path."""
    return make_space(np.zeros((200, 200, 1), dtype=bool))


def long_space(blocked: np.ndarray, body: Body = LONG) -> FreeSpace:
    """A space for a body of several discs in the plane, or of balls in space."""
    space = make_space(blocked)
    discs = body.discs(margin=0.0, resolution=space.resolution, flat=space.flat)
    least = min(disc.collision_distance_sq for disc in discs)
    return dataclasses.replace(space, collision_distance_sq=least, discs=discs)


def random_space(seed: int, shape: tuple[int, int, int], share: float = 0.1) -> FreeSpace:
    """Every cell's field is drawn: 0 (forbidden at threshold 0) or a squared distance up to 9."""
    rng = np.random.default_rng(seed)
    field = rng.integers(1, 10, size=shape).astype(np.uint16)
    field[rng.random(shape) < share] = 0
    return FreeSpace(field, np.array([0.5, -0.25, 2.0]), 0.25, 0, 1.0 / np.arange(1.0, 11.0))


def random_points(rng: np.random.Generator, space: FreeSpace, count: int) -> np.ndarray:
    """Points inside the grid and a little around it; some on faces, edges and corners of cells."""
    cells = rng.uniform(-0.5, np.array(space.distances.shape) + 0.5, size=(count, 3))
    on_face = rng.random((count, 3)) < 0.3
    return space.origin + space.resolution * np.where(on_face, np.rint(cells), cells)


def row_of_cells(values: list[int]) -> FreeSpace:
    """1 m cells along x at y = z = 0.5; forbidden at 1 or below; costs 0, 0, 0.5, 0.25, 0."""
    field = np.array(values, dtype=np.uint16).reshape(-1, 1, 1)
    return FreeSpace(field, np.zeros(3), 1.0, 1, np.array([9.0, 9.0, 0.5, 0.25, 0.0]))


def random_poses(space: FreeSpace, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    cells = rng.uniform(5.0, 55.0, (count, 2))
    points = np.array([point(space, x, y) for x, y in cells])
    return np.column_stack((points, rng.uniform(-4.0, 4.0, count)))
