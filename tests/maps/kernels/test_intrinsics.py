import sys
import threading

import numba
import numpy as np
import pytest

from wayproof.maps.kernels.intrinsics import fetch_add, prefetch_for_write
from wayproof.maps.parallel import ThreadTeam


def test_a_prefetch_changes_nothing_within_an_array_or_far_beyond_it():
    @numba.njit
    def total(cells):
        prefetch_for_write(cells, np.uint64(3))
        prefetch_for_write(cells, np.uint64(1 << 40))
        return cells.sum()

    cells = np.arange(9, dtype=np.uint16)
    assert total(cells) == total.py_func(cells) == 36
    np.testing.assert_array_equal(cells, np.arange(9))


@pytest.mark.parametrize(
    "kind", [numba.njit, lambda function: function], ids=["compiled", "python"]
)
def test_an_atomic_add_returns_the_value_before(kind):
    @kind
    def add_twice(counter):
        return fetch_add(counter, 5), fetch_add(counter, -2)

    counter = np.array([7])
    assert add_twice(counter) == (7, 12)
    assert counter[0] == 10


def count_items(counter, times_taken):
    item = fetch_add(counter, 1)
    while item < times_taken.shape[0]:
        times_taken[item] += 1
        item = fetch_add(counter, 1)


@pytest.mark.parametrize(
    ("count", "items"),
    [(numba.njit(nogil=True)(count_items), 300_000), (count_items, 20_000)],
    ids=["compiled", "python"],
)
def test_threads_that_add_at_once_never_get_the_same_value(count, items):
    count(np.zeros(1, np.int64), np.zeros(3, np.int64))  # compiles it
    counter, times_taken = np.zeros(1, np.int64), np.zeros(items, np.int64)
    all_ready, before = threading.Barrier(3), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # interpreted threads take turns at any place

    def work(_):
        all_ready.wait(10)
        count(counter, times_taken)

    try:
        ThreadTeam(3).run_all(work)
    finally:
        sys.setswitchinterval(before)
    assert (times_taken == 1).all()
