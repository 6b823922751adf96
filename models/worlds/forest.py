"""A wood: trunks that lean a little, branches between knee and head, bushes; a hedge around it."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    FEW_PLACEMENTS,
    LOW,
    Group,
    between,
    opposite_ends,
    room,
    with_groups,
)
from wayproof.models.worlds.solids import Capsule, Cylinder, Sphere
from wayproof.models.worlds.world import World

SIZE = (17.0, 12.0)
END_DISTANCE = 1.4
"""Distance of start and goal from the outside of the hedge, m."""

TRUNKS = (12, 44)
BUSH_COUNTS = (2, 8)
"""Number of bushes at difficulty 0 and 1; those that fit nowhere are left out."""

TRUNK_HEIGHT = 3.4
MAX_BRANCHES = 3
"""Maximum number of branches of a tree; their share grows with the difficulty."""


@generated
def forest(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a wood of 17 x 12 m, start and goal at its two ends.

    Difficulty raises the number of trees, of branches that a ground robot passes under and a drone
    does not, and of bushes.
    """
    ends = opposite_ends(rng, SIZE, inset=END_DISTANCE, side_inset=END_DISTANCE)
    clearing = room(rng, SIZE, ends, kind="hedge")
    trunks, bushes = (round(between(counts, difficulty)) for counts in (TRUNKS, BUSH_COUNTS))
    branches = 0.2 + 0.5 * difficulty

    def growth() -> Iterator[Iterator[Group]]:
        for _ in range(trunks):
            yield (_tree(rng, branches) for _ in range(FEW_PLACEMENTS))
        for _ in range(bushes):
            yield (_bush(rng) for _ in range(FEW_PLACEMENTS))

    return with_groups(clearing, growth(), parameters.passage_radius)


def _tree(rng: np.random.Generator, branch_share: float) -> Group:
    x, y = np.round(rng.uniform(LOW[:2], SIZE), 3).tolist()
    radius = round(rng.uniform(0.08, 0.22), 3)
    lean, bearing = rng.uniform(0.0, 0.08), rng.uniform(0.0, 2 * pi)  # a tangent, rad
    ahead = (lean * cos(bearing), lean * sin(bearing))

    def at(height: float) -> Vector3:
        return (round(x + ahead[0] * height, 3), round(y + ahead[1] * height, 3), round(height, 3))

    trunk = Cylinder(at(0.0), at(TRUNK_HEIGHT), radius, "trunk")
    branches = []
    for _ in range(int(rng.binomial(MAX_BRANCHES, branch_share))):
        root = at(rng.uniform(0.7, 2.4))
        length, turn, rise = rng.uniform(0.4, 0.9), rng.uniform(0.0, 2 * pi), rng.uniform(0.0, 0.6)
        step = np.multiply(length, (cos(turn), sin(turn), rise))
        end_x, end_y, end_z = np.round(np.add(root, step), 3).tolist()
        thickness = round(rng.uniform(0.015, 0.04), 3)
        branches.append(Capsule(root, (end_x, end_y, end_z), thickness, "branch"))
    return (trunk, *branches)


def _bush(rng: np.random.Generator) -> Group:
    x, y = np.round(rng.uniform(LOW[:2], SIZE), 3).tolist()
    radius = round(rng.uniform(0.2, 0.4), 3)
    return (Sphere((x, y, round(0.7 * radius, 3)), radius, "hedge"),)
