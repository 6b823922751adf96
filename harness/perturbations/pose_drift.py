"""Perturbation of the pose by a drift that the estimator does not report."""

from __future__ import annotations

import math
from typing import ClassVar

from wayproof.harness.perturbations.perturbation import Changes, Perturbation
from wayproof.models.pose_model import PoseError
from wayproof.models.random_streams import stream


class PoseDrift(Perturbation, frozen=True, tag="pose_drift"):
    """An error that grows with the distance travelled, in one seeded horizontal direction.

    Attributes:
        direction: About z from x, degrees; by the seed if none.
    """

    direction: float | None = None
    changes: ClassVar[Changes] = "pose"
    measured_in: ClassVar[str] = "m/m"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.001, 0.005, 0.02, 0.06, 0.09)

    def active_pose_error(self, seed: int, time_ns: int, travelled: float) -> PoseError:
        """Return the drift so far."""
        return along(direction(self.direction, seed, self.kind), self.amount * travelled)


def direction(given: float | None, seed: int, name: str) -> float:
    """Return a horizontal direction, given in degrees or chosen by the seed, rad."""
    if given is not None:
        return math.radians(given)
    return float(stream(seed, f"perturbation/{name}", 0).uniform(-math.pi, math.pi))


def along(direction: float, length: float) -> PoseError:
    """Return a shift of a length in a horizontal direction, in whole micrometres."""
    x, y = length * math.cos(direction), length * math.sin(direction)
    return PoseError((round(x, 6), round(y, 6), 0.0))
