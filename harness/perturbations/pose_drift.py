"""The pose drifts away while the estimator believes that it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from wayproof.harness.perturbations.perturbation import Perturbation
from wayproof.models.odometry import PoseError
from wayproof.models.random_streams import stream


class PoseDrift(Perturbation, frozen=True, tag="pose_drift"):
    """An error that grows with the distance travelled, in one seeded horizontal direction.

    Attributes:
        direction: In place of the seeded one, about z from x, degrees.
    """

    direction: float | None = None
    measured_in: ClassVar[str] = "m/m"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.001, 0.005, 0.02, 0.06, 0.09)

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """The pose."""
        return ("pose",)

    def active_pose_error(self, seed: int, time_ns: int, travelled: float) -> PoseError:
        """As far as it has drifted."""
        return along(direction(self.direction, seed, self.kind), self.amount * travelled)


def direction(given: float | None, seed: int, name: str) -> float:
    """A horizontal direction, given in degrees or chosen by the seed, rad."""
    if given is not None:
        return math.radians(given)
    return float(stream(seed, f"perturbation/{name}", 0).uniform(-math.pi, math.pi))


def along(direction: float, length: float) -> PoseError:
    """A shift of a length in a horizontal direction, in whole micrometres."""
    x, y = length * math.cos(direction), length * math.sin(direction)
    return PoseError((round(x, 6), round(y, 6), 0.0))
