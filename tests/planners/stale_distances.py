"""Lazy distances over a source that is wrong wherever it was not brought up to date."""

import numpy as np

from wayproof.maps import Distances
from wayproof.maps.costmap.distance_field import BLOCK_ROWS
from wayproof.maps.costmap.lazy_distances import Reader


class StaleSource:
    """A source of distances, some blocks of which are wrong until they are brought up to date.

    Attributes:
        true: The distances.
        worked_out: Number of blocks that were brought up to date so far.
    """

    def __init__(self, true: np.ndarray, seed: int, share: float = 1.0) -> None:
        """Make a share of the blocks wrong."""
        rng = np.random.default_rng(seed)
        self.true, self.squared = true, true.copy()
        self.stale = rng.random((-(-true.shape[1] // BLOCK_ROWS), true.shape[0])) < share
        self.worked_out = 0
        for b, x in np.argwhere(self.stale):
            block = self.squared[x, b * BLOCK_ROWS : (b + 1) * BLOCK_ROWS]
            spoilt = rng.permutation(block.reshape(-1)).reshape(block.shape)
            block[:] = (0, true.max(), spoilt, rng.choice(true.reshape(-1), block.shape))[
                rng.integers(4)
            ]

    def bring_up_to_date(self, wanted: np.ndarray | None = None) -> None:
        """Correct some blocks, or all."""
        for b, x in np.argwhere(self.stale if wanted is None else self.stale & wanted):
            rows = slice(b * BLOCK_ROWS, (b + 1) * BLOCK_ROWS)
            self.squared[x, rows] = self.true[x, rows]
            self.stale[b, x] = False
            self.worked_out += 1


def lazy_windows(true: list[np.ndarray], seed: int, share: float) -> list[Distances]:
    """Lazy distances of one window, a share of the blocks of each source wrong."""
    readers: list[Reader] = []
    sources = [StaleSource(field, seed + n, share) for n, field in enumerate(true)]
    return [Distances(source, source.true.shape, readers) for source in sources]
