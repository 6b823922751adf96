from wayproof.maps.kernels import tsdf as kernels


def test_scores_encode_distances_and_order_them():
    distances = list(range(-1023, 1025))
    assert [kernels.distance_of(kernels.score_of(d)) for d in distances] == distances
    for kernel, inputs in (
        (kernels.score_of, distances),
        (kernels.weight_of, distances),
        (kernels.distance_of, range(2000, 8192)),
    ):
        assert [kernel(i) for i in inputs] == [kernel.py_func(i) for i in inputs]
    order = sorted(distances, key=kernels.score_of, reverse=True)
    assert order[:5] == [0, -1, 1, -2, 2]
    assert order[-1] == -1023
    assert order.index(1024) < order.index(-223)  # seen before hidden
    assert min(kernels.score_of(d) for d in distances) > 0
