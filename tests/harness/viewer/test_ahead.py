"""Items made ahead by a thread."""

from threading import Event

import pytest

from wayproof.harness.viewer.ahead import Ahead


def test_prefetched_items_keep_their_order_and_raise_in_their_place():
    def items():
        yield from range(20)
        raise ValueError("here")

    got = []
    with pytest.raises(ValueError, match="here"):
        got.extend(Ahead(items(), 8))  # what came before is kept by extend
    assert got == list(range(20))
    assert list(Ahead(iter(()), 8)) == []


def test_prefetching_is_bounded_and_stops_when_closed():
    made, closed, enough = [], [], Event()

    def items():
        try:
            for item in range(100):
                made.append(item)
                if item == 2:
                    enough.set()
                yield item
        finally:
            closed.append(True)

    coming = Ahead(items(), 3)
    assert enough.wait(10.0)
    coming.close()
    assert made == [0, 1, 2]
    assert closed == [True]
