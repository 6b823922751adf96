import itertools

import numpy as np

from wayproof.maps.kernels import grid2d as kernels


def test_clipping_and_tracing_are_alike_compiled_and_as_python():
    heights = range(-7, 8, 2)
    for start, end in itertools.product(heights, heights):
        clip = kernels.clip_to_band(start, end, (-4, 2))
        assert clip == kernels.clip_to_band.py_func(start, end, (-4, 2))
        inside = [z for z in range(min(start, end), max(start, end) + 1) if -4 <= z <= 2]
        span = len(inside) - 1 if start != end else len(inside)
        assert max(clip[1] - clip[0], 0) == max(span, 0)
    inside = np.array([[0, 0], [9, 9]])
    for start, end in [((511, 513), (8001, 3001)), ((8001, 3001), (77, 8999)), ((9, 9), (9, 9))]:
        marks = np.zeros((2, 9, 9), np.uint8)
        kernels.trace_flat(start, end, inside, marks[0])
        kernels.trace_flat.py_func(start, end, inside, marks[1])
        assert marks[0].sum() > 0
        assert (marks[0] == marks[1]).all()
