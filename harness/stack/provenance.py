"""Provenance of the evidence: the measured map, and layers that were not measured.

The stages of the evidence are the measured map, then that map laid over each layer in turn. Each
stage has a costmap, and what is free by a stage and by none before it rests on that stage's layer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.decision import GRAIN
from wayproof.harness.geometry import polyline_length
from wayproof.harness.inputs import Inputs
from wayproof.harness.mission import Mission
from wayproof.harness.prediction_config import NO_PREDICTOR
from wayproof.harness.prior.cells import prior_layer
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.prediction import predicted_layer
from wayproof.harness.stack.types import Array, EvidenceSpace, Provenance
from wayproof.maps import Costmap
from wayproof.maps.columns import ColumnMap
from wayproof.maps.overlay import CellLayer, Overlaid
from wayproof.planners import arc_lengths

SPACING = 0.5
"""Distance of the places along a path at which its evidence is looked up, cells."""

FIELDS: dict[Provenance, Literal["measured_m", "prior_m", "predicted_m"]] = {
    "measured": "measured_m",
    "prior": "prior_m",
    "predicted": "predicted_m",
}
"""Field of `Evidence` by provenance."""


class Layer(NamedTuple):
    """A layer of evidence that was not measured.

    Attributes:
        provenance: `prior` or `predicted`.
        cells: Its states.
        admits: Whether its free cells admit the body.
        follow: Brings it up to date with the measured map and the inputs of a decision; None of a
            layer that does not change.
    """

    provenance: Provenance
    cells: CellLayer
    admits: bool = False
    follow: Callable[[ColumnMap, Inputs], None] | None = None


class Stage(NamedTuple):
    """The evidence up to a provenance.

    Attributes:
        provenance: Provenance of what this stage has more than the one before.
        costmap: Costmap of the evidence of this stage and of all before it.
    """

    provenance: Provenance
    costmap: Costmap


class Stages(NamedTuple):
    """All stages of the evidence of one mission.

    Attributes:
        all: The measured one first.
        admitted: The costmap that admits the body: of the measured stage, unless layers admit.
        guide: The costmap of all evidence; None if it is the one that admits.
    """

    all: tuple[Stage, ...]
    admitted: Costmap
    guide: Costmap | None


def layers_of(config: Config, mission: Mission) -> tuple[Layer, ...]:
    """Return the layers that a config has, those that admit first.

    Raises:
        ValueError: A prior map is none, or a predictor is for other cells.
    """
    layers: list[Layer] = []
    if (cells := prior_layer(config, mission)) is not None:
        layers.append(Layer("prior", cells, admits=config.prior.policy == "admit"))
    if config.prediction.source != NO_PREDICTOR and config.prediction.policy == "guide":
        predicted = predicted_layer(config, mission)
        layers.append(Layer("predicted", predicted.cells, follow=predicted.follow))
    return tuple(layers)


def stages_of(
    measured: ColumnMap, layers: Sequence[Layer], make: Callable[[ColumnMap], Costmap]
) -> Stages:
    """Return the stages of a measured map over some layers.

    Args:
        measured: The map.
        layers: Layers of the map, those that admit first.
        make: Makes the costmap of a map.
    """
    stages, above = [Stage("measured", make(measured))], measured
    for layer in layers:
        above = Overlaid(above, layer.cells)
        stages.append(Stage(layer.provenance, make(above)))
    admitted = stages[len([layer for layer in layers if layer.admits])].costmap
    guide = stages[-1].costmap
    return Stages(tuple(stages), admitted, None if guide is admitted else guide)


def evidence_along(path: Array | None, spaces: Sequence[EvidenceSpace]) -> pb.Evidence:
    """Return the lengths of a path (n, 3) at which the body is free by each provenance, m.

    By its circumscribed disc or ball, or by the smallest of its discs where it is planned for by
    them. What no stage has free is unproven: unknown, or inside the inflation.
    """
    evidence = pb.Evidence()
    total = 0.0 if path is None else polyline_length(path)
    if path is None or total == 0.0:
        return evidence
    count = max(math.ceil(total / (SPACING * spaces[0].known_free.resolution)), 1)
    found = dict.fromkeys((*FIELDS.values(), "unproven_m"), 0)
    for point in places_along(path, (np.arange(count) + 0.5) * total / count):
        found[_field_at(point, spaces)] += 1
    for name, places in found.items():
        setattr(evidence, name, float(np.rint(places * total / count / GRAIN) * GRAIN))
    return evidence


def places_along(path: Array, s: Array) -> Array:
    """Return points (m, 3) of a path (n, 3) at arc lengths (m,), m, as `point_at` does one."""
    arcs = arc_lengths(path)
    places = np.repeat(path[-1:], len(s), axis=0)
    (before,) = np.nonzero(s < arcs[-1])
    here = np.maximum(np.searchsorted(arcs, s[before], side="right") - 1, 0)
    share = (np.maximum(s[before], 0.0) - arcs[here]) / (arcs[here + 1] - arcs[here])
    places[before] = path[here] + share[:, None] * (path[here + 1] - path[here])
    return places


def _field_at(point: Array, spaces: Sequence[EvidenceSpace]) -> str:
    for provenance, space in spaces:
        if space.is_free(point):
            return FIELDS[provenance]
    return "unproven_m"
