"""Items made ahead by a thread."""

from threading import Event

import pytest

from wayproof.harness.viewer.ahead import Ahead


def test_what_is_made_ahead_comes_in_order_and_its_failure_at_its_place():
    def items():
        yield from range(20)
        raise ValueError("here")

    got = []
    with pytest.raises(ValueError, match="here"):
        got.extend(Ahead(items(), 8))  # what came before is kept by extend
    assert got == list(range(20))
    assert list(Ahead(iter(()), 8)) == []


def test_what_is_made_ahead_is_no_more_than_asked_for_and_lets_go_when_closed():
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
