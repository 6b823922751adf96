"""State that a snapshot keeps, by the names of attributes."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from wayproof.models.arrays import Array


class Kept:
    """Keeps the attributes that a class names: arrays of floats, lists, numbers and booleans."""

    KEPT: ClassVar[tuple[str, ...]]
    """Names of the attributes; a snapshot has them without a leading underscore."""

    def state(self) -> dict[str, Array]:
        """Return copies of all that is kept."""
        return {name.lstrip("_"): np.array(getattr(self, name)) for name in self.KEPT}

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        for name in self.KEPT:
            before, value = getattr(self, name), state[name.lstrip("_")]
            own = np.array(value, np.float64) if isinstance(before, np.ndarray) else value.tolist()
            setattr(self, name, own)
