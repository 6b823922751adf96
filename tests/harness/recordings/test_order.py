import numpy as np
import pytest

from wayproof.harness.recordings.order import in_order


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
