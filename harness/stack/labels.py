"""Semantic labels: votes of sweeps in a layer, and margins of classes in the costmap."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import WorldSweep
from wayproof.maps import ClassMargins, MapConfig, Representation, SemanticLayer
from wayproof.maps.semantic import UNLABELLED
from wayproof.models.classes import CLASSES, UNKNOWN_CLASS

VOTE_PARTS = 4
"""Number of parts of a sweep; each sweep votes with one of them, as classes do not change."""


def make_layer(config: MapConfig, semantics: bool) -> SemanticLayer | None:
    """Make a layer without votes for a map, if sweeps have classes."""
    return SemanticLayer(config.resolution, len(CLASSES)) if semantics else None


def with_class_margins(
    a_map: Representation, layer: SemanticLayer | None, margins: Mapping[str, float]
) -> Representation | ClassMargins:
    """Return the map with the margins of its classes, if there are any, for a costmap."""
    if layer is None or not margins:
        return a_map
    by_class = {CLASSES.index(name): margin for name, margin in margins.items()}
    return ClassMargins(a_map, layer, by_class)


def vote(
    layer: SemanticLayer,
    placed: WorldSweep,
    classes: NDArray[np.uint8],
    limits: tuple[float, float],
    sequence: int,
) -> None:
    """Count the votes of a sweep.

    Args:
        layer: Counts them.
        placed: Beams of the sweep in the world.
        classes: (n,) classes of what the beams hit; an unknown class is no vote.
        limits: Minimum and maximum range of a vote, m.
        sequence: Number of the sweep.
    """
    # Consecutive beams hit the same cells, so a run of them costs little.
    edges = [len(classes) * k // VOTE_PARTS for k in range(VOTE_PARTS + 1)]
    part = slice(edges[sequence % VOTE_PARTS], edges[sequence % VOTE_PARTS + 1])
    voted = classes[part]
    labels = np.where(voted == UNKNOWN_CLASS, np.uint8(UNLABELLED), voted)
    layer.integrate_sweep(
        placed.origins,
        placed.directions[part],
        placed.ranges_mm[part].astype(np.uint16, copy=False),  # of a sensor with tables
        limits,
        labels,
        placed.moments[part],
    )


def combined_version(version: str, layer: SemanticLayer | None) -> str:
    """Return the hash of the versions of a map and of its labels, 32 hex digits."""
    if layer is None:
        return version
    both = (version + layer.version()).encode()
    return hashlib.blake2b(both, digest_size=16).hexdigest()
