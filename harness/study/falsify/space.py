"""What is searched: when, where and how strongly a perturbation acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.perturbations import PERTURBATIONS, AnyPerturbation
from wayproof.harness.perturbations.perturbation import MAX_SEVERITY
from wayproof.harness.study.file import perturbation_at

LEAST = 0.05
"""Least severity that is tried."""


@dataclass(frozen=True)
class Space:
    """Perturbations of one kind, each acting within one window.

    Attributes:
        name: `KIND` or `KIND:MODE`.
        latest: Latest beginning of a window, s.
        length: Of a window, s.
        greatest: Greatest severity.
    """

    name: str
    latest: float
    length: float
    greatest: float = MAX_SEVERITY

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Bounds of each parameter: when, how strongly, and where if the kind has a direction."""
        bounds = {"begin": (0.0, self.latest), "severity": (LEAST, self.greatest)}
        if "direction" in PERTURBATIONS[self.name.partition(":")[0]].__struct_fields__:
            bounds["direction"] = (-180.0, 180.0)
        return bounds

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, parameters) thrown back from the bounds; a direction goes round.

        Cut off at the bounds instead, many would lie right on them.
        """
        low, high = np.array(list(self.parameters.values())).T
        folded = (points - low) % (2.0 * (high - low))
        kept = low + np.minimum(folded, 2.0 * (high - low) - folded)
        for column, name in enumerate(self.parameters):
            if name == "direction":
                kept[:, column] = (points[:, column] + 180.0) % 360.0 - 180.0
        return np.asarray(kept)

    def apart(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        """How far two points (parameters,) are apart, in parts of the space, at most."""
        low, high = np.array(list(self.parameters.values())).T
        parts = np.abs(one - other) / (high - low)
        around = np.array([name == "direction" for name in self.parameters])
        return float(np.where(around, np.minimum(parts, 1.0 - parts), parts).max())

    def perturbation(self, point: Sequence[float]) -> AnyPerturbation:
        """The perturbation at a point, in whole hundredths of a second, severity and degree."""
        told = {
            name: min(max(round(float(value), 2), low), high)
            for (name, (low, high)), value in zip(self.parameters.items(), point, strict=True)
        }
        begin, severity = told.pop("begin"), told.pop("severity")
        return changed(
            perturbation_at(self.name, severity),
            window=(begin, round(begin + self.length, 2)),
            **told,
        )


def changed(perturbation: AnyPerturbation | None, **fields: Any) -> AnyPerturbation:
    """A perturbation with some of its fields changed, checked."""
    assert perturbation is not None
    replaced: AnyPerturbation = msgspec.structs.replace(perturbation, **fields)
    return replaced
