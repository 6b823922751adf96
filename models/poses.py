"""Trails of poses, and interpolation between their samples.

Nothing here needs the simulator. Sums, products, quotients and square roots only, which IEEE 754
rounds alike everywhere: a replay finds the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Trail:
    """Poses T_world_base at equal steps of time; the last one is now.

    Attributes:
        positions: (k, 3) m.
        quaternions: (k, 4) w x y z.
        period: Time between two poses, s.
    """

    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]
    period: float

    def __post_init__(self) -> None:
        """Refuse trails without a pose, of unequal arrays, or without time between poses."""
        count = len(self.positions)
        shapes = self.positions.shape, self.quaternions.shape
        if count == 0 or shapes != ((count, 3), (count, 4)):
            raise ValueError(f"trail: got shapes {shapes}, expected (k, 3) and (k, 4), k >= 1")
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"trail: got a period of {self.period:g} s, expected more than 0")

    def before_now(
        self, ages: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions (m, 3) and rotations (m, 3, 3) at ages (m,) >= 0 before now, s.

        Between samples both are interpolated linearly and the quaternion scaled to unit length
        again, which for the hundredths of a radian between samples is a rotation at constant speed.
        Before the first sample the body stood there.
        """
        last = len(self.positions) - 1
        place = np.clip(last - ages / self.period, 0.0, last)
        early = np.minimum(place.astype(np.int64), max(last - 1, 0))
        late = np.minimum(early + 1, last)
        share = (place - early)[:, None]
        positions = _between(self.positions[early], self.positions[late], share)
        first, second = self.quaternions[early], self.quaternions[late]
        # q and -q are one rotation: take the one on this side, or the way between leads round.
        away = (first * second).sum(axis=1, keepdims=True) < 0.0
        quaternions = _between(first, np.where(away, -second, second), share)
        quaternions /= np.sqrt((quaternions * quaternions).sum(axis=1, keepdims=True))
        return positions, rotation_matrices(quaternions)

    def every(self, stride: int) -> Trail:
        """Return each `stride`-th pose, counted back from now."""
        return Trail(
            self.positions[::-1][::stride][::-1],
            self.quaternions[::-1][::stride][::-1],
            self.period * stride,
        )


def rotation_matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:  # (m, 3, 3)
    """Return the rotations of unit quaternions (m, 4) w x y z."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.array(rows).transpose(2, 0, 1))


def _between(
    first: NDArray[np.float64], second: NDArray[np.float64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    between: NDArray[np.float64] = first + share * (second - first)
    return between
