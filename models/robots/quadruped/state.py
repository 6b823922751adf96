"""Records of the controller: the observation of a tick, and the memory between ticks.

numpy records, because numba reads and writes their fields by name, and because the bytes of
`MEMORY` are the whole state of the controller. Kernels that are called at every physics step take
them, and the parameters, as arrays of one record: numba unpacks such an array in 0.3 us, a record
in 3.6 us and a named tuple in 1 to 2 us, which was half the cost of control.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

OBSERVATION = np.dtype(
    [
        ("position", "f8", 3),  # base origin, world, m
        ("rotation", "f8", (3, 3)),  # R_world_body
        ("angles", "f8", 3),  # roll, pitch, yaw (z-y-x), rad
        ("angular_velocity", "f8", 3),  # world, rad/s
        ("lever", "f8", 3),  # base origin to centre of mass, world, m
        ("com", "f8", 3),  # centre of mass, world, m
        ("com_velocity", "f8", 3),  # world, m/s
        ("foot", "f8", (4, 3)),  # foot centres, world, m
        ("foot_velocity", "f8", (4, 3)),  # world, m/s
        ("jacobian", "f8", (4, 3, 3)),  # d foot / d joint, world axes, m/rad
    ],
    align=True,
)
"""Record of the observed state, rewritten every tick from the joints."""

MEMORY = np.dtype(
    [
        ("command", "f8", 3),  # slewed: forward m/s, left m/s, yaw rate rad/s
        ("walking", "?"),  # trots, else stands on four feet
        ("arrived", "?"),  # at a setpoint that rests
        ("phase", "f8"),  # of the cycle, [0, 1)
        ("calm_time", "f8"),  # since a command or imbalance last called for a step, s
        ("waited", "f8"),  # for a late foot, s
        ("reference", "f8", 3),  # base x, y (m) and yaw (rad), world
        ("ground_height", "f8"),  # under the base, from the standing feet, world, m
        ("ground_pitch", "f8"),  # nose down positive, rad
        ("ground_roll", "f8"),  # left side up positive, rad
        ("leg_phase", "f8", 4),  # [0, 1); a foot stands below the duty factor
        ("swinging", "i1", 4),  # 1 or 0, by schedule
        ("touching", "i1", 4),  # 1 or 0: has met the ground in this stance or late swing
        ("lift_off", "f8", (4, 3)),  # where the last swing began, world, m
        ("touch_down", "f8", (4, 3)),  # where the foot last stood, world, m
        ("foothold", "f8", (4, 3)),  # where the swing ends, world, m
        ("force", "f8", (4, 3)),  # ground on foot, world, N
    ],
    align=True,
)
"""Record of the controller's state, kept from tick to tick."""


def record(dtype: np.dtype[Any]) -> tuple[Any, NDArray[Any]]:
    """Return a zeroed record: as attributes for Python, and in an array (1,) for kernels."""
    array = np.zeros(1, dtype)
    return array.view(np.recarray)[0], array
