"""Points along paths."""

import numpy as np

from wayproof.harness.log.paths import densely, refined


def test_points_lie_densely():
    path = densely(np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0]]), 0.3)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.3
    assert path[[0, 4, -1]].tolist() == [[0, 0, 0], [1, 0, 0], [1, 0.5, 0]]


def test_a_thinned_path_gets_the_corners_of_the_path_along_it():
    whole = np.array([[0.05 * n, 0.0, 0.0] for n in range(20)] + [[0.95, 0.5, 0.0]])
    beyond = np.array([[0.95, 1.0, 0.0], [2.0, 1.0, 0.0]])
    thinned = np.concatenate([whole[[0, 5, 10, 15]], beyond])
    np.testing.assert_array_equal(refined(thinned, whole), np.concatenate([whole, beyond]))
    np.testing.assert_array_equal(refined(thinned[:4], whole), whole)
    elsewhere = thinned + np.array([0.0, 0.1, 0.0])
    np.testing.assert_array_equal(refined(elsewhere, whole), elsewhere)
    assert len(refined(np.empty((0, 3)), whole)) == 0
