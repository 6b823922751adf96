import numpy as np
import pytest

from tests.maps.exact_distances import packed, scipy_squared
from wayproof.maps.costmap.distance_field import BLOCK_ROWS
from wayproof.maps.costmap.lazy_distances import Clearances, Distances

SHAPE = (40, 30, 12)
REACH = 6
EVERYWHERE = slice(0, SHAPE[0]), slice(0, SHAPE[1])


def drawn(rng, share):
    return rng.random(SHAPE) < share


def expected(free, occupied, edge, most):
    """The three kinds of distances by their definitions, from scipy's."""
    to_not_free = scipy_squared(~free, REACH)
    to_obstacles = scipy_squared(occupied, REACH)
    bounded = np.where(to_not_free < edge, np.minimum(to_obstacles, edge), to_obstacles)
    return [np.minimum(one, most) for one in (to_not_free, to_obstacles, bounded)]


@pytest.mark.parametrize("most", [REACH * REACH, 20])
def test_wherever_a_reader_caught_up_the_distances_are_true(most):
    rng = np.random.default_rng(1)
    clearances = Clearances(SHAPE, SHAPE, REACH)
    free, occupied = ~drawn(rng, 0.01), drawn(rng, 0.005)
    for step in range(25):
        free ^= drawn(rng, 0.0005)
        occupied ^= drawn(rng, 0.0003)
        clearances.take_over(packed(free), packed(occupied), *EVERYWHERE)
        clearances.begin(whole=step == 7)
        all_distances = [
            clearances.to_not_free(most),
            clearances.to_obstacles(most),
            clearances.optimistic(9, most),
        ]
        truth = expected(free, occupied, 9, most)
        looked = [rng.random(SHAPE[:2]) < 0.02 for _ in all_distances]
        for distances, places in zip(all_distances, looked, strict=True):
            for i, j in np.argwhere(places):
                distances.read_blocks[j // BLOCK_ROWS, i] = True
        clearances.catch_up()
        assert not clearances.catch_up()
        for distances, places, true in zip(all_distances, looked, truth, strict=True):
            np.testing.assert_array_equal(distances.cells[places], true[places])
    for distances, true in zip(all_distances, truth, strict=True):
        np.testing.assert_array_equal(distances.whole(), true)


def window_with_news(searched=None):
    """Distances of a window in which a cell has come where nobody has looked for long.

    Args:
        searched: Block in which the last search looked, if there was one.
    """
    clearances = Clearances(SHAPE, SHAPE, REACH)
    free = np.ones(SHAPE, np.bool_)
    clearances.take_over(packed(free), packed(~free), *EVERYWHERE)
    clearances.begin(whole=True)
    clearances.optimistic(9, REACH**2)
    if searched is not None:
        clearances.to_obstacles(REACH**2).searched[searched] = True
    free[20, 15, 6] = False
    clearances.take_over(packed(free), packed(~free), *EVERYWHERE, whole=False)
    clearances.begin(whole=False)
    return clearances


def test_limits_out_of_use_give_their_memory_to_others_and_nothing_else():
    """As the edge moves with the margin."""
    rng = np.random.default_rng(0)
    clearances = Clearances(SHAPE, SHAPE, REACH)
    free, occupied = ~drawn(rng, 0.01), drawn(rng, 0.005)
    clearances.take_over(packed(free), packed(occupied), *EVERYWHERE)
    clearances.begin(whole=True)
    nine = clearances.optimistic(9, REACH**2)
    clearances.begin(whole=False)
    twelve = clearances.optimistic(12, REACH**2)
    assert np.shares_memory(twelve.cells, nine.cells)
    for distances, edge in ((twelve, 12), (clearances.optimistic(9, REACH**2), 9)):
        true = expected(free, occupied, edge, REACH**2)[2]
        np.testing.assert_array_equal(distances.whole(), true)


def search(distances):
    """One that looks everywhere until nothing is stale, as a plan does."""
    distances.latch_stale_reads()
    while True:
        if distances.begin_search():
            distances.searched[:] = True
        if not distances.catch_up():
            return


@pytest.mark.parametrize("work_out", [search, Distances.whole, Distances.begin_search])
@pytest.mark.parametrize("kind", ["to_not_free", "to_obstacles", "optimistic"])
@pytest.mark.parametrize("other", ["to_not_free", "to_obstacles", "optimistic"])
def test_what_was_read_while_it_was_stale_is_read_anew_whoever_worked_it_out_since(
    work_out, kind, other
):
    clearances = window_with_news()
    limits = {"optimistic": (9, REACH**2)}
    reader, worker = (
        getattr(clearances, name)(*limits.get(name, (REACH**2,))) for name in (kind, other)
    )
    block = 15 // BLOCK_ROWS, 20
    reader.read_blocks[block] = True
    assert reader.outdated()
    clearances._searched_before[block] = True
    work_out(worker)
    assert clearances.catch_up()
    assert not clearances.catch_up()
    assert reader.cells[20, 15, 6] == 0
