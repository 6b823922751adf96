"""Estimators of the body's pose from its sensors, and what a snapshot keeps of them."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from wayproof.models.arrays import Array


class Kept:
    """Keeps the attributes that a class names: arrays of floats, numbers and booleans."""

    KEPT: ClassVar[tuple[str, ...]]
    """Names of the attributes; a snapshot has them without a leading underscore."""

    def state(self) -> dict[str, Array]:
        """Return copies of all that is kept."""
        return {name.lstrip("_"): np.array(getattr(self, name)) for name in self.KEPT}

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        for name in self.KEPT:
            before, value = getattr(self, name), state[name.lstrip("_")]
            own = np.array(value, np.float64) if isinstance(before, np.ndarray) else value.item()
            setattr(self, name, own)
