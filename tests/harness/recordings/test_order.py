import numpy as np
import pytest

from wayproof.harness.recordings.order import in_order, set_backs


@pytest.mark.parametrize(
    ("stamps", "kept"),
    [
        ([], []),
        ([5], [5]),
        ([1, 2, 3], [1, 2, 3]),
        ([1, 2, 2, 3], [1, 2, 3]),
        ([1, 9, 2, 3, 4], [1, 2, 3, 4]),  # one far ahead loses itself alone
        ([5, 6, 0, 7, 8], [5, 6, 7, 8]),  # and one far behind
        ([7, 8, 1, 2, 3, 4], [1, 2, 3, 4]),  # a clock set back loses the shorter side
    ],
)
def test_a_longest_increasing_part_is_kept(stamps, kept):
    stamps = np.array(stamps, np.int64)
    assert stamps[in_order(stamps)].tolist() == kept


def test_against_every_choice_of_short_sequences():
    rng = np.random.default_rng(0)
    for _ in range(200):
        stamps = rng.integers(0, 8, 8)
        chosen = stamps[in_order(stamps)]
        assert (np.diff(chosen) > 0).all()
        parts = (stamps[[k for k in range(8) if mask >> k & 1]] for mask in range(256))
        assert len(chosen) == max(len(part) for part in parts if (np.diff(part) > 0).all())


@pytest.mark.parametrize("back", [0, 10, 40, 200])
@pytest.mark.parametrize("exchanged", [0, 3, 8])
def test_a_clock_set_back_is_told_from_an_exchanged_order(back, exchanged):
    rng = np.random.default_rng(0)
    for _ in range(20):
        clock = 1000 * np.concatenate([np.arange(200), np.arange(200, 400) - back])
        clock += rng.integers(-200, 200, 400)
        sent = np.argsort(np.arange(400) + rng.uniform(0, exchanged, 400), kind="stable")
        found = set_backs(clock[sent])
        assert len(found) == (back > 0)
        assert all(abs(place - 200) <= exchanged for place in found)


def test_two_who_publish_the_same_are_no_clock_set_back():
    stamps = np.stack([np.arange(100), np.arange(100) - 7], axis=1).ravel()
    assert set_backs(stamps) == []
