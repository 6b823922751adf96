"""Points along paths."""

import numpy as np

from wayproof.harness.log.paths import densely


def test_points_lie_densely():
    path = densely(np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0]]), 0.3)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.3
    assert path[[0, 4, -1]].tolist() == [[0, 0, 0], [1, 0, 0], [1, 0.5, 0]]
