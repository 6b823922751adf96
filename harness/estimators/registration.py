"""Result of registering one sweep."""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.models.arrays import Array


@dataclass(frozen=True)
class Registration:
    """Registration of a sweep in the map.

    Attributes:
        correction: (4,) shift from the predicted position, m, and turn about the vertical, rad.
        information: (3,) eigenvalues of the mean of n n' over the normals of the registered points;
            they sum to 1, and all are 0 where too few were registered.
        unheld: (k, 3) unit directions along which the scene does not hold the pose.
        inliers: Number of registered points.
        deviation: Standard deviation of their distances from the planes, by the median, m;
            infinite without any.
        moment: (4, 4) mean of g g' over these points, g the gradient of the distance by the pose:
            x, y, z and heading.
        scatter: (4, 4) mean of w^2 d^2 g g' over them by the square of the mean of w, m^2: d the
            distance, w its weight.
        anchors: (k, 4) share of the voxels that are by each sweep before, in what
            was measured of x, y, z and the heading; each column sums to 1, or is 0.
    """

    correction: Array
    information: Array
    unheld: Array
    inliers: int
    deviation: float
    moment: Array
    scatter: Array
    anchors: Array
