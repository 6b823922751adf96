import numpy as np
import pytest

from wayproof.maps.kernels import update as kernels


def both(kernel):
    return pytest.mark.parametrize("run", [kernel, kernel.py_func], ids=["compiled", "python"])


@both(kernels.list_touched)
def test_bricks_that_hold_marks(run):
    touched = np.random.default_rng(3).uniform(size=(3, 4, 2)) < 0.5
    keys, offsets = np.empty((24, 3), np.int32), np.empty(24, np.int64)
    count = run(touched, (-1, 5, 2), keys, offsets)
    marked = np.argwhere(touched)
    np.testing.assert_array_equal(keys[:count], np.add(marked, [-1, 5, 2]))
    x, y, word = marked.T
    np.testing.assert_array_equal(offsets[:count], ((16 * x) * 64 + 16 * y) * 2 + word)


STEPS = [(27, 12, -60, 104), (29, 13, -64, 111), (100, 120, -127, 127), (1, 1, -2, 1)]


@both(kernels.update_column)
@pytest.mark.parametrize("steps", STEPS)
def test_a_column_is_updated_as_cell_by_cell(run, steps):
    hit, miss, low, high = steps
    rng = np.random.default_rng(hit)
    for _ in range(60 if run is kernels.update_column else 8):
        old = rng.integers(low, high + 1, 64).astype(np.int8)
        old[rng.random(64) < 0.2] = 0
        old[rng.random(64) < 0.2] = low
        hits, free = (
            int.from_bytes(np.packbits(rng.random(64) < p, bitorder="little").tobytes(), "little")
            for p in (0.1, rng.random())
        )
        free &= ~hits
        known = np.packbits((old == low) & (rng.random(64) < 0.5), bitorder="little")
        settled = int(known.view(np.uint64)[0])
        cells = old.copy()
        with np.errstate(over="ignore"):
            left, flags = run(
                cells,
                cells.view(np.uint64),
                np.uint64(settled),
                np.uint64(hits),
                np.uint64(free),
                steps,
            )
        new = old.astype(int)
        for z in range(64):
            if hits >> z & 1:
                new[z] = min(new[z] + hit, high)
            elif free >> z & 1:
                new[z] = max(new[z] - miss, low)
        np.testing.assert_array_equal(cells, new)
        bits = [int(left) >> z & 1 for z in range(64)]
        assert all(new[z] == low for z in range(64) if bits[z])
        crossed = [z for z in range(64) if free >> z & 1]
        assert all(bits[z] == (new[z] == low) for z in crossed)
        assert flags & 1 == np.any(new != old)
        assert flags >> 1 == np.any(np.sign(new) != np.sign(old))


@both(kernels.update_column)
def test_a_hit_that_makes_a_free_cell_unknown_changes_its_state(run):
    cells = np.full(64, -60, np.int8)
    cells[5] = -27
    words = (np.uint64(word) for word in (0, 1 << 5, 0))
    with np.errstate(over="ignore"):
        _, flags = run(cells, cells.view(np.uint64), *words, STEPS[0])
    assert cells[5] == 0
    assert flags == kernels.CONTENT_CHANGED | kernels.STATES_CHANGED


@both(kernels.digest_bricks)
def test_digests_differ_if_a_single_word_does(run):
    rng = np.random.default_rng(5)
    eights = np.repeat(rng.integers(0, 2**63, (1, 256, 8)).astype(np.uint64), 6, axis=0)
    eights[1, 0, 0] ^= np.uint64(1)
    eights[2, 255, 7] ^= np.uint64(1 << 63)
    eights[3, [0, 1]] = eights[3, [1, 0]]
    eights[4] = 0
    lanes, held = np.zeros((6, 8), np.uint64), np.zeros(6, np.bool_)
    with np.errstate(over="ignore"):
        run(np.arange(6), eights, lanes, held)
    assert len({lane.tobytes() for lane in lanes}) == 5
    assert lanes[0].tolist() == lanes[5].tolist()
    assert held.tolist() == [True, True, True, True, False, True]
    with np.errstate(over="ignore"):
        again = np.array(kernels.SEEDS)
        for column in eights[0]:
            again = (again ^ column) * kernels.FACTOR
            again ^= again >> np.uint64(32)
    assert again.tolist() == lanes[0].tolist()
