"""Distances that are told only where they are wanted, and are anything elsewhere."""

import numpy as np

from wayproof.maps import Distances
from wayproof.maps.costmap.distance_field import BLOCK_ROWS
from wayproof.maps.costmap.lazy_distances import Reader


class Known:
    """Distances that are known all along; some blocks hold others until they are worked out.

    Attributes:
        worked_out: Blocks that were, so far.
    """

    def __init__(self, true: np.ndarray, seed: int, share: float = 1.0) -> None:
        """Spoil a share of the blocks."""
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
        """Tell the truth in some blocks, or in all."""
        for b, x in np.argwhere(self.stale if wanted is None else self.stale & wanted):
            rows = slice(b * BLOCK_ROWS, (b + 1) * BLOCK_ROWS)
            self.squared[x, rows] = self.true[x, rows]
            self.stale[b, x] = False
            self.worked_out += 1


def told(true: list[np.ndarray], seed: int, share: float) -> list[Distances]:
    """Several of one window; of each a share of the blocks is spoilt."""
    readers: list[Reader] = []
    sources = [Known(one, seed + n, share) for n, one in enumerate(true)]
    return [Distances(source, source.true.shape, readers) for source in sources]
