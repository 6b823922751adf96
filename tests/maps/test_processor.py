import sys
import threading

import numba
import numpy as np
import pytest

from wayproof.maps.kernels import distance_field as kernels
from wayproof.maps.kernels.intrinsics import new_queue, prefetch, take
from wayproof.maps.parallel import ThreadTeam


def test_a_prefetch_is_compiled_into_a_kernel_and_changes_nothing():
    @numba.njit
    def ask(cells):
        prefetch(cells, np.uint64(3))
        prefetch(cells, np.uint64(1 << 40))  # far beyond them
        return cells.sum()

    cells = np.arange(9, dtype=np.uint16)
    assert ask(cells) == ask.py_func(cells) == 36
    (code,) = ask.inspect_llvm().values()
    assert "call void @llvm.prefetch" in code
    np.testing.assert_array_equal(cells, np.arange(9))


def count_taken(queue, taken):
    item = take(queue, 1)
    while item < taken.shape[0]:
        taken[item] += 1
        item = take(queue, 1)


@pytest.mark.parametrize(
    ("way", "items"),
    [(numba.njit(nogil=True)(count_taken), 300_000), (count_taken, 20_000)],
    ids=["compiled", "interpreted"],
)
def test_threads_that_take_at_once_never_get_the_same(way, items):
    way(new_queue(), np.zeros(3, np.int64))  # compiles it
    queue, taken, all_ready = new_queue(), np.zeros(items, np.int64), threading.Barrier(3)
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # interpreted threads take turns at any place

    def work(_):
        all_ready.wait(10)
        way(queue, taken)

    try:
        ThreadTeam(3).run_all(work)
    finally:
        sys.setswitchinterval(before)
    assert (taken == 1).all()


@pytest.mark.parametrize("take_part", [kernels.take_part, kernels.take_part.py_func])
@pytest.mark.parametrize("threads", [1, 2, 7])
@pytest.mark.parametrize("count", [0, 1, 5, 400])
def test_the_parts_taken_follow_each_other_and_become_smaller(take_part, threads, count):
    queue, end, sizes = new_queue(), 0, []
    while (part := take_part(queue, count, threads))[0] < part[1]:
        assert part[0] == end
        end = part[1]
        sizes.append(part[1] - part[0])
    assert end == count
    assert sizes == sorted(sizes, reverse=True)
    if count == 400:
        assert sizes[0] == 400 // (kernels.SHARES * threads)
        assert sizes[-1] == 1
    assert take_part(queue, count, threads) == (count, count)
