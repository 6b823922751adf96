"""Result of registering one sweep."""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.models.arrays import Array


@dataclass(frozen=True)
class Registration:
    """How a sweep lies in the map.

    Attributes:
        correction: (4,) shift from the predicted position, m, and turn about the vertical, rad.
        information: (3,) eigenvalues of the mean of n n' over the normals of the registered points;
            they sum to 1, and all are 0 where too few were registered.
        unheld: (k, 3) unit directions along which the scene does not hold the pose.
        inliers: Number of registered points.
    """

    correction: Array
    information: Array
    unheld: Array
    inliers: int
