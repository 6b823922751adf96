"""Kernel of decay for maps that are kept in blocks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel


class FadedBlocks(NamedTuple):
    """Changes of blocks by decay.

    Attributes:
        changed: (k,) whether any value changed.
        forgotten: (k,) whether any cell became unknown.
        alive: (k,) whether any cell is still known.
    """

    changed: NDArray[np.bool_]
    forgotten: NDArray[np.bool_]
    alive: NDArray[np.bool_]


@kernel
def fade_blocks(
    slots: NDArray[np.int64],  # (k,)
    rest: NDArray[np.int8],  # (128,) remainder of each magnitude
    spared: NDArray[np.int8],  # (128,) the same for a cell that the first tick leaves as it is
    evidence: NDArray[np.int8],  # (slots, cells) in, out
    fresh: NDArray[np.bool_],  # (slots, cells) updated since the last tick; false after
    faded: FadedBlocks,  # in, out: false before
) -> None:
    """Move the evidence of blocks toward none."""
    changed, forgotten, alive = faded
    for i in range(slots.shape[0]):
        slot = slots[i]
        for cell in range(evidence.shape[1]):
            value = int(evidence[slot, cell])
            if value == 0:
                continue
            magnitude = abs(value)
            left = int(spared[magnitude]) if fresh[slot, cell] else int(rest[magnitude])
            changed[i] |= left != magnitude
            forgotten[i] |= left == 0
            alive[i] |= left != 0
            evidence[slot, cell] = left if value > 0 else -left
            fresh[slot, cell] = False
