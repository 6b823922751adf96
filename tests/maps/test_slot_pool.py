import numpy as np
import pytest

from wayproof.maps import slot_pool
from wayproof.maps.slot_pool import ChangeLog, Layer, SlotPool

KEYS = np.stack(np.indices((7, 7, 7)), axis=-1).reshape(-1, 3) - 3


def make(capacity=8, grows=False):
    return SlotPool(capacity, {"value": Layer(np.int16, (4,))}, grows)


def contents(pool):
    return lambda slots: [pool.keys[k].tobytes() + pool.layers["value"][k].tobytes() for k in slots]


@pytest.mark.parametrize("grows", [False, True])
def test_the_directory_finds_what_is_held(grows):
    rng = np.random.default_rng(1)
    pool, held = make(4 if grows else 512, grows), {}
    for turn in range(300):
        key = tuple(rng.integers(-3, 4, 3).tolist())
        if key in held and turn % 2:
            pool.release(np.array([held.pop(key)]), stamp=1)
        elif key not in held:
            slots, new = pool.reserve(np.array([key]), stamp=1)
            assert new.tolist() == slots.tolist()
            held[key] = int(slots[0])
            pool.layers["value"][slots] = key[0]
        expected = [held.get(tuple(key), -1) for key in KEYS.tolist()]
        assert pool.find(KEYS).tolist() == expected
        for (x, _, _), slot in held.items():
            assert (pool.layers["value"][slot] == x).all()
    assert sorted(held.values()) == pool.live().tolist()
    assert len(held) > 50


def test_a_full_pool_evicts_the_slot_observed_longest_ago_and_of_those_the_least_key():
    pool = make(capacity=4)
    keys = np.array([[2, 0, 0], [1, 0, 0], [0, 0, 0], [3, 0, 0]])
    pool.observed_ns[pool.reserve(keys, 1).slots] = [5, 5, 7, 6]
    slots, new = pool.reserve(np.array([[3, 0, 0], [9, 9, 9]]), 2)
    assert (slots[0], len(new)) == (pool.find(keys[3:])[0], 1)
    assert (pool.find(keys) >= 0).tolist() == [
        True,
        False,
        True,
        True,
    ]  # of equal age the least key
    assert pool.changed(1).tolist() == [[1, 0, 0]]
    assert not pool.layers["value"][new].any()


def test_keys_beyond_the_capacity_get_no_slot():
    pool = make(capacity=3)
    pool.reserve(np.array([[7, 7, 7]]), 1)
    slots, new = pool.reserve(KEYS[:5], 2)
    assert slots.tolist()[3:] == [-1, -1]
    assert sorted(new.tolist()) == [0, 1, 2]


def test_changes_after_a_stamp():
    pool = make()
    slots = pool.reserve(KEYS[:3], 1).slots
    pool.stamps[slots] = [1, 2, 3]
    assert pool.changed(0).tolist() == KEYS[:3].tolist()
    assert pool.changed(2).tolist() == KEYS[2:3].tolist()
    pool.release(slots[:1], 4)
    assert pool.changed(3).tolist() == KEYS[:1].tolist()
    assert pool.changed(0).tolist() == KEYS[1:3].tolist()
    assert pool.changed(4).tolist() == []


def test_a_change_log_that_overflowed_says_so(monkeypatch):
    monkeypatch.setattr(slot_pool, "MAX_LOGGED", 2)
    log = ChangeLog()
    log.note(KEYS[:2], 1)
    assert log.after(0).tolist() == KEYS[:2].tolist()
    log.note(KEYS[2:3], 2)
    assert log.after(1) is None
    log.note(KEYS[3:4], 3)
    assert log.after(2).tolist() == KEYS[3:4].tolist()


def test_the_digest_is_that_of_the_content_whatever_its_history():
    rng = np.random.default_rng(2)
    one, other = make(64), make(2, grows=True)
    for pool, keys in ((one, KEYS[:40]), (other, rng.permutation(KEYS[:40]))):
        for key in keys:
            slots = pool.reserve(key[None], 1).slots
            pool.layers["value"][slots] = key.sum()
            pool.dirty[slots] = True
    other.digest(contents(other))
    passing = other.reserve(KEYS[50:60], 2).slots
    other.dirty[passing] = True
    assert other.digest(contents(other)) != one.digest(contents(one))
    other.release(passing, 3)
    assert other.digest(contents(other)) == one.digest(contents(one)) != 0
    one.layers["value"][3] += 1
    assert other.digest(contents(other)) == one.digest(contents(one))  # not marked as dirty
    one.dirty[3] = True
    assert other.digest(contents(other)) != one.digest(contents(one))
    assert make().digest(lambda slots: []) == 0
