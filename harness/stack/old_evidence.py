"""Old evidence on a way: a place that nothing has looked at for too long admits nobody."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayproof.harness.stack.provenance import places_along
from wayproof.harness.stack.types import Array, PlannerInput, arc_length

SPACING = 0.25
"""Distance of the places on a way at which the age of its evidence is looked up, m."""

COVERED = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], np.float64)
"""Points of a body at which its evidence is looked up, radii from its middle."""


class OldEvidence(NamedTuple):
    """The first place of a way whose evidence is older than `costmap.max_evidence_age`.

    Attributes:
        free_m: Length of the way before it, m.
        age_s: Age of the newest evidence of what a body covers there, s.
    """

    free_m: float
    age_s: float


def old_evidence(input: PlannerInput, path: Array) -> OldEvidence | None:
    """Return the first place of a path (n, 3), m, whose evidence is too old; None without one.

    What was never measured has no evidence that could be old: whether the body may go there is a
    matter of the unknown policy, or of a prior map.
    """
    length = arc_length(path)
    arcs = np.linspace(0.0, length, math.ceil(length / SPACING) + 1)
    radius = max(abs(offset) + radius for offset, radius in input.gait.discs)
    points = places_along(path, arcs)[:, None] + radius * COVERED
    newest = input.observed_ns(points.reshape(-1, 3)).reshape(len(arcs), -1).max(axis=1)
    ages = (input.time_ns - newest) * 1e-9
    (old,) = np.nonzero((newest >= 0) & (ages > input.config.costmap.max_evidence_age))
    return OldEvidence(float(arcs[old[0]]), float(ages[old[0]])) if len(old) else None
