"""Where the robot came along, and the way back on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.stack.types import Array, Memory, View, distance, length
from wayproof.planners import TrajectorySample, truncate

STEP = 0.1
"""Places of a trail are so far apart, m."""

SPARE = 2
"""Places kept beyond what the longest way back needs."""


def trodden(memory: Memory, view: View) -> Memory:
    """The memory with the place where the robot is, if that is a step from the last one."""
    if len(memory.trail) and distance(memory.trail[-1], view.position) < STEP:
        return memory
    places = int(view.behaviour.backup_length / STEP) + SPARE
    return replace(memory, trail=np.vstack([memory.trail, view.position])[-places:])


def way_back(view: View, memory: Memory, now: TrajectorySample) -> Array | None:
    """The trail from its end backwards, shape (n, 3), as far as it is still admitted.

    None if it is too short to be worth it, or if the robot has gone back often enough.
    """
    if memory.backups >= view.behaviour.backups or len(memory.trail) == 0:
        return None
    back = memory.trail[::-1]
    # The way to a place right beside has no direction that a long body could lie in.
    away = np.flatnonzero(np.sqrt(np.square(back - now.position).sum(axis=1)) >= STEP)
    if len(away) == 0:
        return None
    path = np.vstack([now.position, back[away[0] :]])
    path = path[np.append(True, np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-6)]
    admitted = min(view.admitted.free_length(path), view.behaviour.backup_length, length(path))
    return None if admitted < view.behaviour.least_advance else truncate(path, admitted)
