import numpy as np
import pytest

from wayproof.maps.kernels import column_masks as kernels


@pytest.mark.parametrize("run", [kernels.next_run, kernels.next_run.py_func])
def test_the_lowest_run_of_set_bits(run):
    rng = np.random.default_rng(1)
    for _ in range(200):
        low = int(rng.integers(0, 64))
        high = int(rng.integers(low, 64))
        bits = (2 ** (high + 1) - 2**low) | int(rng.integers(0, 2**20)) << (high + 2)
        with np.errstate(over="ignore"):
            assert run(np.uint64(bits & (2**64 - 1))) == (low, high)
