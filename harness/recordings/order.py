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
"""Step back of a stream that is a clock set back whatever it goes through again, ns."""

MOST_AGAIN = 10_000
"""Greatest number of messages on either side that are looked at for times that come again."""


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


def set_backs(stamps: NDArray[np.int64]) -> list[int]:
    """Return where a clock was set back: indices of the first stamps (n,) after it.

    Stamps in the order of the file go back, and the time that they go through again has about twice
    the messages that it should have. Where messages are exchanged, or one stamp is far off, it has
    no more of them. A step back of a second or more, of a stream with a gap, counts by its
    neighbours alone. Steps of less than five periods may pass for a
    driver's jitter.
    """
    back = np.flatnonzero(np.diff(stamps) < 0) + 1
    if not len(back):
        return []
    blocks = stamps[: len(stamps) // WINDOW * WINDOW].reshape(-1, WINDOW)
    blocks = blocks if len(blocks) else stamps[None]
    spans = blocks.max(axis=1) - blocks.min(axis=1)
    period = max(float(np.median(spans)) / (blocks.shape[1] - 1), 1.0)
    found: list[tuple[int, int]] = []  # place, and by how much its neighbours go back
    for k in back.tolist():
        before, after = stamps[max(k - 5, 0) : k], stamps[k : k + 5]
        if min(len(before), len(after)) < 3:
            continue
        fall = int(np.median(before) - np.median(after))
        again = fall > SET_BACK_NS or _is_passed_again(stamps, k, period)
        if not again:
            continue
        if found and k - found[-1][0] <= 2 * WINDOW:  # the same one
            found[-1] = max(found[-1], (k, fall), key=lambda one: one[1])
        else:
            found.append((k, fall))
    return [k for k, _ in found]


def _is_passed_again(stamps: NDArray[np.int64], k: int, period: float) -> bool:
    """Return whether the time from a stamp to the highest before it has twice its messages.

    It is so where two publish the same, one behind the other: then not all messages lie in it.
    """
    low, high = int(stamps[k]), int(stamps[max(k - WINDOW, 0) : k].max())
    should = (high - low) / period + 1.0
    reach = int(min(1.5 * should, MOST_AGAIN)) + 10
    near = stamps[max(k - reach, 0) : k + reach]
    inside = int(((near >= low) & (near <= high)).sum())
    usual = int(((near >= 2 * low - high) & (near < low)).sum())
    count = int(should)
    whole = min(
        float((stamps[max(k - count, 0) : k] >= low).mean()),
        float((stamps[k : k + count] <= high).mean()),
    )
    enough = 1.5 * max(should, min(usual, 2.0 * should)) + 0.9
    return should >= 2.5 and inside >= enough and whole >= 0.7


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
