"""Planar lasers whose beams stay at one height of the body, as in a map of columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wayproof.harness.recordings.recording import Recording
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import RecordedSweep
from wayproof.models.poses import rotation_matrices

MOST_TILT = np.radians(3.0)
"""Maximum angle of a level laser's plane to that of the body, rad.

In a map of columns a beam counts at all heights. At 3 degrees it is 5 cm off its height after 1 m,
half a cell of the default `map.resolution`; brackets levelled by hand are better than that.
"""


def level_lasers(
    recording: Recording, first: Mapping[str, Sequence[RecordedSweep]]
) -> frozenset[str]:
    """Return the names of the planar lasers that are level in each of their sweeps.

    Args:
        recording: Open; it is read to its end if one of them moves on the body.
        first: First sweeps by sensor; what has none decides nothing.

    Raises:
        InputError: The recording is damaged from some place on.
    """
    lasers = {one.name: one for one in recording.sensors if one.kind == "laser"}
    tilted = {
        name
        for name in lasers
        if not all(is_level(sweep.T_body_sensor) for sweep in first.get(name, ()))
    }
    moving = {name for name, one in lasers.items() if not one.mount_is_fixed} - tilted
    if moving:
        for sweep in recording.sweeps():
            if sweep.sensor in moving and not is_level(sweep.T_body_sensor):
                tilted.add(sweep.sensor)
                moving.discard(sweep.sensor)
            if not moving:
                break
    return frozenset(lasers) - tilted


def is_level(mount: Transform) -> bool:
    """Return whether the plane of a laser is that of the body, on either side up."""
    up = rotation_matrices(mount.quaternion[None])[0, 2, 2]
    return bool(abs(up) >= np.cos(MOST_TILT))
