"""Errors of an estimated trajectory: ATE and RPE, as evo computes them without alignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Track:
    """Poses T_world_base of n moments.

    Attributes:
        positions: (n, 3) m.
        quaternions: (n, 4) w x y z.
    """

    positions: Array
    quaternions: Array


def absolute_errors(estimate: Track, truth: Track) -> Array:
    """Return the distance between the positions of each moment, (n,) m.

    The two are in one frame already, so nothing is aligned: `evo_ape tum TRUE ESTIMATED`.
    """
    errors: Array = _length(estimate.positions - truth.positions)
    return errors


def relative_errors(estimate: Track, truth: Track) -> Array:
    """Return the difference of the motions from each moment to the next, (n - 1,) m.

    Length of the translation of (Q_i^-1 Q_i+1)^-1 (P_i^-1 P_i+1), P estimated and Q true (Sturm et
    al. 2012, IROS, equation 2): `evo_rpe tum TRUE ESTIMATED --delta 1 --delta_unit f`.
    """
    errors: Array = _length(_steps(estimate) - _steps(truth))
    return errors


def ate(estimate: Track, truth: Track) -> float | None:
    """Return the root mean square of the absolute errors, m; None without a moment."""
    return _rms(absolute_errors(estimate, truth))


def rpe(estimate: Track, truth: Track) -> float | None:
    """Return the root mean square of the relative errors, m; None for fewer than two moments."""
    return _rms(relative_errors(estimate, truth))


def _steps(track: Track) -> Array:  # (n - 1, 3)
    """Return the position of each moment in the body's frame of the one before, m."""
    moved = np.diff(track.positions, axis=0)
    steps: Array = np.einsum("nij,ni->nj", rotations(track.quaternions[:-1]), moved)
    return steps


def rotations(quaternions: Array) -> Array:  # (n, 3, 3)
    """Return the rotation matrices of quaternions (n, 4), w x y z, of any length but 0."""
    w, x, y, z = (quaternions / _length(quaternions)[:, None]).T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def _length(vectors: Array) -> Array:
    lengths: Array = np.sqrt(np.square(vectors).sum(axis=1))
    return lengths


def _rms(errors: Array) -> float | None:
    return float(np.sqrt(np.square(errors).mean())) if len(errors) else None
