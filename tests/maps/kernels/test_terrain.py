import numpy as np
import pytest

from wayproof.maps.kernels import terrain as kernels


@pytest.mark.parametrize("python", [False, True])
def test_surfaces_of_a_column(python):
    names = "any_of", "all_of", "lowest_surface", "is_surface"
    run = [getattr(kernels, name).py_func if python else getattr(kernels, name) for name in names]
    column = np.array([0b1011_0100, 1], np.uint64)
    assert [run[0](column, *part) for part in ((0, 2), (2, 3), (63, 99))] == [False, True, True]
    assert [run[1](column, *part) for part in ((4, 6), (4, 7), (64, 65))] == [True, False, True]
    assert not run[1](column, 64, 999)
    assert [run[2](column, first, 9, kernels.Body(0, 1, 3)) for first in (0, 3, 8)] == [7, 7, -1]
    assert [run[3](column, z, kernels.Body(0, 1, 2)) for z in (2, 3, 4, 5)] == [
        True,
        False,
        False,
        True,
    ]
