import numpy as np
import pytest

from wayproof.maps.kernels import edt, edt_field


@pytest.mark.parametrize("j", [1, 5, 17])
def test_planes_are_lowered_to_what_leads_through_those_around(j):
    reach, unit, planes = 19, edt.UNIT, 60
    rng = np.random.default_rng(j)
    sources = rng.integers(0, reach * reach, (planes, unit)).astype(np.uint16)
    before = rng.integers(0, reach * reach, (6, unit)).astype(np.uint16)
    for run in (edt_field.lower_planes, edt_field.lower_planes.py_func):
        target = before.copy()
        greatest = run(target.ravel(), unit, sources.ravel(), 28 * unit, j, reach)
        expected = before.astype(int)
        for plane in range(4):
            for distance in range(j, j + 4):
                nearer = np.minimum(*(sources[28 + plane + d] for d in (distance, -distance)))
                through = nearer.astype(int) + min(distance, reach) ** 2
                expected[1 + plane] = np.minimum(expected[1 + plane], through)
        np.testing.assert_array_equal(target, expected)
        assert greatest == expected[1:5].max()
