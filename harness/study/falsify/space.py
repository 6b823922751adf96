"""Space of perturbations that is searched: their time, direction and severity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.perturbations import PERTURBATIONS, AnyPerturbation
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.plan import perturbation_at

LEAST = 0.05
"""Least severity."""


@dataclass(frozen=True)
class Space:
    """Perturbations of one kind, each acting within one window.

    Attributes:
        name: `KIND` or `KIND:MODE`.
        latest: Latest beginning of a window, s.
        length: Length of a window, s.
        greatest: Greatest severity.
    """

    name: str
    latest: float
    length: float
    greatest: float = MAX_SEVERITY

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Bounds of each parameter: beginning, severity, and direction if the kind has one."""
        bounds = {"begin": (0.0, self.latest), "severity": (LEAST, self.greatest)}
        if "direction" in PERTURBATIONS[self.name.partition(":")[0]].__struct_fields__:
            bounds["direction"] = (-180.0, 180.0)
        return bounds

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, parameters) reflected at the bounds, with directions wrapped.

        Clipping would put many points right on the bounds.
        """
        low, high = np.array(list(self.parameters.values())).T
        folded = (points - low) % (2.0 * (high - low))
        kept = low + np.minimum(folded, 2.0 * (high - low) - folded)
        for column, name in enumerate(self.parameters):
            if name == "direction":
                kept[:, column] = (points[:, column] + 180.0) % 360.0 - 180.0
        return np.asarray(kept)

    def apart(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        """Return the greatest distance in any parameter of two points, as a share of the space."""
        low, high = np.array(list(self.parameters.values())).T
        parts = np.abs(one - other) / (high - low)
        around = np.array([name == "direction" for name in self.parameters])
        return float(np.where(around, np.minimum(parts, 1.0 - parts), parts).max())

    def perturbation(self, point: Sequence[float]) -> AnyPerturbation:
        """Return the perturbation at a point, rounded to hundredths of each unit."""
        values = {
            name: min(max(round(float(value), 2), low), high)
            for (name, (low, high)), value in zip(self.parameters.items(), point, strict=True)
        }
        begin, severity = values.pop("begin"), values.pop("severity")
        return changed(
            perturbation_at(self.name, severity),
            window=(begin, round(begin + self.length, 2)),
            **values,
        )


def changed(perturbation: AnyPerturbation | None, **fields: Any) -> AnyPerturbation:
    """Return a perturbation with some fields changed and checked."""
    assert perturbation is not None
    replaced: AnyPerturbation = msgspec.structs.replace(perturbation, **fields)
    return replaced
