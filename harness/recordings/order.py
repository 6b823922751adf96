"""Order of stamps that may jump, repeat, or run backwards."""

from __future__ import annotations

import heapq
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

Payload = TypeVar("Payload")

WINDOW, WINDOW_BYTES = 32, 2**26
"""Number and bytes of messages within which an exchanged order is put right."""


def nearly_sorted(
    items: Iterable[tuple[int, int, Payload]],
) -> Iterator[tuple[int, int, Payload]]:
    """Yield (stamp, bytes, payload) in order of the stamps, as far as a window of them allows."""
    heap: list[tuple[int, int, int, Payload]] = []
    held = 0
    for place, (stamp, size, payload) in enumerate(items):
        heapq.heappush(heap, (stamp, place, size, payload))
        held += size
        while len(heap) > WINDOW or (held > WINDOW_BYTES and len(heap) > 1):
            first, _, bytes_, popped = heapq.heappop(heap)
            held -= bytes_
            yield first, bytes_, popped
    while heap:
        first, _, bytes_, popped = heapq.heappop(heap)
        yield first, bytes_, popped


SET_BACK_NS = 10**9
"""Least step back of the stamps that is a clock set back, ns."""


class Order(NamedTuple):
    """The order in which messages of a topic are to be read.

    Attributes:
        is_sorted: Whether it is that of the file.
        kept: (n,) whether each message, by its place in the file, is read.
    """

    is_sorted: bool
    kept: NDArray[np.bool_]


def order_of(stamps: NDArray[np.int64], sizes: NDArray[np.int64]) -> Order:
    """Return the order of messages by their stamps (n,), ns, and sizes (n,), bytes."""
    if (np.diff(stamps) > 0).all():
        return Order(True, np.ones(len(stamps), bool))
    items = zip(stamps.tolist(), sizes.tolist(), range(len(stamps)), strict=True)
    places = np.array([place for _, _, place in nearly_sorted(items)])
    kept = np.zeros(len(stamps), bool)
    kept[places[in_order(stamps[places])]] = True
    return Order(False, kept)


def set_back(stamps: NDArray[np.int64]) -> int:
    """Return by how much a clock was set back between stamps (n,) in the order of the file, ns.

    0 where it never was by a second or more: a few stamps far off are no other clock.
    """
    for k in (np.flatnonzero(np.diff(stamps) < -SET_BACK_NS) + 1).tolist():
        before, after = stamps[max(k - 5, 0) : k], stamps[k : k + 5]
        if min(len(before), len(after)) >= 3 and np.median(after) < np.median(before):
            return int(stamps[k - 1] - stamps[k])
    return 0


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
