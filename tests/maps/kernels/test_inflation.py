import numpy as np

from wayproof.maps.costmap.inflation import inflate
from wayproof.maps.kernels import inflation as kernels


def packed(cells):
    nx, ny, nz = cells.shape
    weights = np.uint64(1) << np.arange(64, dtype=np.uint64)
    return (cells.reshape(nx, ny, nz // 64, 64) * weights).sum(axis=3, dtype=np.uint64)


def test_compiled_inflation_equals_its_python(monkeypatch):
    words = packed(np.random.default_rng(1).random((6, 5, 128)) < 0.01)
    compiled = inflate(words, 11)
    for name in ("grow_along_z", "unite", "inflate_planes"):
        monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    np.testing.assert_array_equal(inflate(words, 11), compiled)
