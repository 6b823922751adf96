import numpy as np
from scipy.ndimage import distance_transform_edt

from wayproof.planners import FreeSpace

TRUNCATION = 200
BLOCKED_AT_OR_BELOW = 4


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
