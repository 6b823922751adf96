"""Order of stamps that may jump, repeat, or run backwards."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray


def in_order(stamps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return indices (k,) of a longest strictly increasing subsequence of stamps (n,).

    So one stamp far off, be it early or late, loses itself alone, and a clock that was set back
    loses the shorter side. The method is patience sorting (Fredman, "On computing the length of
    longest increasing subsequences", 1975), n log n.
    """
    steps = np.diff(stamps)
    if (steps > 0).all():
        return np.arange(len(stamps))
    tails: list[int] = []  # least last stamp of a subsequence of each length
    places: list[int] = []  # its index
    before = np.full(len(stamps), -1)
    for place, stamp in enumerate(stamps.tolist()):
        length = bisect_left(tails, stamp)
        if length == len(tails):
            tails.append(stamp)
            places.append(place)
        else:
            tails[length] = stamp
            places[length] = place
        before[place] = places[length - 1] if length else -1
    kept = np.empty(len(tails), np.int64)
    place = places[-1] if places else -1
    for k in range(len(tails) - 1, -1, -1):
        kept[k] = place
        place = before[place]
    return kept
