"""Compiled kernels of blocks: decay, the same for every representation that is kept in blocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel


@kernel
def fade_blocks(
    slots: NDArray[np.int64],  # (k,)
    part: tuple[int, int],  # first and one past the last of them to fade
    rest: NDArray[np.int8],  # (128,) what becomes of each magnitude
    spared: NDArray[np.int8],  # (128,) of one that the first tick leaves
    evidence: NDArray[np.int8],  # (slots, cells) in, out
    fresh: NDArray[np.bool_],  # (slots, cells) updated since the last tick; false after
    changed: NDArray[np.bool_],  # (k,) out: whether any value changed
    passed: NDArray[np.bool_],  # (k,) out: whether any cell became unknown
    alive: NDArray[np.bool_],  # (k,) out: whether any cell is known
) -> None:
    """Move the evidence of blocks toward none."""
    for i in range(part[0], part[1]):
        slot = slots[i]
        for cell in range(evidence.shape[1]):
            value = int(evidence[slot, cell])
            if value == 0:
                continue
            magnitude = abs(value)
            left = int(spared[magnitude]) if fresh[slot, cell] else int(rest[magnitude])
            changed[i] |= left != magnitude
            passed[i] |= left == 0
            alive[i] |= left != 0
            evidence[slot, cell] = left if value > 0 else -left
            fresh[slot, cell] = False
