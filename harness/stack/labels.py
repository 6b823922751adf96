"""What things are, end to end: classes in sweeps, votes in a layer, margins in the costmap."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import PlacedSweep
from wayproof.maps import ClassMargins, MapConfig, Representation, SemanticLayer
from wayproof.maps.semantic import UNLABELLED
from wayproof.models.classes import CLASSES, UNKNOWN_CLASS

TURNS = 4
"""A sweep's beams vote in so many parts, one a sweep: what a thing is does not change."""


def make_layer(config: MapConfig, semantics: bool) -> SemanticLayer | None:
    """A layer without votes for a map, if sweeps tell classes."""
    return SemanticLayer(config.resolution, len(CLASSES)) if semantics else None


def widened(
    a_map: Representation, layer: SemanticLayer | None, margins: Mapping[str, float]
) -> Representation | ClassMargins:
    """The map as a costmap takes it: with the margins, if there are any."""
    if layer is None or not margins:
        return a_map
    by_class = {CLASSES.index(name): margin for name, margin in margins.items()}
    return ClassMargins(a_map, layer, by_class)


def vote(
    layer: SemanticLayer,
    placed: PlacedSweep,
    classes: NDArray[np.uint8],
    limits: tuple[float, float],
    sequence: int,
) -> None:
    """Count the votes of a sweep.

    Args:
        layer: That counts them.
        placed: The sweep's beams.
        classes: (n,) of what they met; what is not known is no vote.
        limits: Nearest and farthest return that counts, m.
        sequence: Number of the sweep.
    """
    # Beams that follow one another meet the same cells, so a run of them costs little.
    edges = [len(classes) * k // TURNS for k in range(TURNS + 1)]
    turn = slice(edges[sequence % TURNS], edges[sequence % TURNS + 1])
    told = classes[turn]
    labels = np.where(told == UNKNOWN_CLASS, np.uint8(UNLABELLED), told)
    layer.integrate_sweep(
        placed.origins,
        placed.directions[turn],
        placed.ranges_mm[turn],
        limits,
        labels,
        placed.moments[turn],
    )


def bound_version(version: str, layer: SemanticLayer | None) -> str:
    """The version of a map together with that of its labels, 32 hex digits."""
    if layer is None:
        return version
    both = (version + layer.version()).encode()
    return hashlib.blake2b(both, digest_size=16).hexdigest()
