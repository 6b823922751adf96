"""Checks of the evidence of paths: measured cells, and cells of the prior map.

By simple code on arrays of states; of the stack it shares the format of the prior map alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.judge.cells import reach_to
from wayproof.harness.log.paths import Array, densely, length
from wayproof.harness.prior.cells import PriorCells, logged_cells
from wayproof.harness.replay.audit.committed import Committed, Violation
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Representation
from wayproof.maps.columns import WORD_BITS, ColumnMap, pack, unpack

SHIFT_CELLS = 2.0
"""Tolerance of a length by provenance, cells: places are looked up half a cell apart, and a place
on the border of two cells may count to either."""

SETS_OUT = ("follow", "slow", "explore")
"""Actions whose paths are free; a stop may follow one that was measured before and forgotten."""

SHIFT_SHARE = 0.02
"""Tolerance of a length by provenance, as a share: each border that a path crosses may shift."""


@dataclass(frozen=True)
class Filtered:
    """Committed ways by what they are free by.

    Attributes:
        way_m: Length of the ways, m.
        filtered_m: Length of these that is free in the map, and not in that of the returns as they
            came: by the word of a filter of returns.
        decisions: Decisions with such a part, and its length, m.
        returns: Number of returns that each filter changed in all sweeps, by its name.
    """

    way_m: float
    filtered_m: float
    decisions: tuple[tuple[int, float], ...]
    returns: dict[str, int]


class AdmittedMap(ColumnMap):
    """A measured map with a prior map where it is unknown, as `prior.policy=admit` has it.

    Attributes:
        resolution: Edge of a cell, m.
    """

    def __init__(self, measured: Representation, prior: PriorCells) -> None:
        """Complete a map by the cells of a config, which are those of its lattice."""
        self.resolution = measured.resolution
        self._measured, self._prior = measured, prior

    def columns(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the occupied and the free cells of a box, (nx, ny, words) each."""
        layers = shape[2] * WORD_BITS
        occupied, free = self._measured.columns(low_cell, shape)
        states = unpack(free, layers) * np.uint8(FREE)
        states += unpack(occupied, layers) * np.uint8(OCCUPIED)
        low = np.array(low_cell) - self._prior.first
        first = np.maximum(low, 0)
        end = np.minimum(low + states.shape, self._prior.states.shape)
        if (first < end).all():
            there = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
            here = tuple(slice(a, b) for a, b in zip(first - low, end - low, strict=True))
            known = self._prior.states[there]
            states[here] = np.where(states[here] == UNKNOWN, known, states[here])
        return pack(states == OCCUPIED), pack(states == FREE)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where the measured map changed since a stamp, as it does."""
        return self._measured.changed(since)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when points (n, 3), m, were last observed, (n,) ns; -1 never."""
        return self._measured.observed_ns_at(points)


def prior_of(config: Config) -> PriorCells | None:
    """Return the cells of the prior map on the lattice of the map; None if they cannot admit.

    Raises:
        InputError: They are none, or on another lattice.
    """
    cells = logged_cells(config) if config.prior.policy == "admit" else None
    if cells is not None and cells.resolution != config.map.resolution:
        raise InputError(
            f"prior_map: cells of {cells.resolution:g} m, expected those of the map, "
            f"{config.map.resolution:g} m"
        )
    return cells


def check_evidence(committed: Committed) -> list[Violation]:
    """Check the lengths by provenance that a decision states, by the measured map and the prior."""
    decision, config = committed.decision, committed.config
    layered = config.has_layers
    stated = {
        name: getattr(decision, name)
        for name in ("committed_evidence", "global_evidence")
        if decision.HasField(name)
    }
    if not layered or committed.late:
        return [
            committed.broken("evidence", f"{name}: stated where nothing but measurements counts")
            for name in stated
        ]
    if len(stated) < 2:
        return [
            committed.broken("evidence", "no lengths by provenance, expected those of both paths")
        ]
    stated_evidence = decision.committed_evidence
    found = _differences(committed, "committed_evidence", stated_evidence, committed.path)
    unmeasured = stated_evidence.prior_m + stated_evidence.predicted_m
    strict = config.prior.policy == "guide" and committed.body.policy == "forbid"
    if strict and decision.action in SETS_OUT and unmeasured > 0.0:
        text = f"{unmeasured:.2f} m of the committed path rest on what was not measured"
        found.append(committed.broken("evidence", text))
    return found


def _differences(
    committed: Committed, name: str, stated: pb.Evidence, path: Array
) -> list[Violation]:
    """Compare the stated lengths of a path (n, 3) with those by the cells around it."""
    total = length(path)
    lengths = stated.measured_m, stated.prior_m, stated.predicted_m, stated.unproven_m
    slack = SHIFT_CELLS * committed.config.map.resolution + SHIFT_SHARE * total
    if not abs(math.fsum(lengths) - total) <= slack or min(lengths) < 0.0:
        text = f"{name}: {math.fsum(lengths):.2f} m in all, the path has {total:.2f} m"
        return [committed.broken("evidence", text)]
    if total == 0.0:
        return []
    measured = _free_length(committed, path, total)
    if abs(stated.measured_m - measured) <= slack:
        return []
    text = f"{name}: {stated.measured_m:.2f} m measured, by the map {measured:.2f} m"
    return [committed.broken("evidence", text)]


def _free_length(committed: Committed, path: Array, total: float) -> float:
    """Return the length of a path at which the disc or ball of the decision is measured free, m."""
    steps, free = _free_steps(committed, path, committed.measured)
    return float(steps[free].sum()) if total else 0.0


def filtered_length(committed: Committed) -> float:
    """Return the length of the committed path that is free by the word of a filter alone, m.

    The disc or ball of the decision is free there in the map, and not in that of the returns as
    they came.
    """
    assert committed.returns is not None
    if len(committed.path) < 2:
        return 0.0
    steps, free = _free_steps(committed, committed.path, committed.measured)
    _, as_measured = _free_steps(committed, committed.path, committed.returns)
    return float(steps[free & ~as_measured].sum())


def _free_steps(
    committed: Committed, path: Array, a_map: Representation
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the lengths of even steps of a path, (n,) m, and whether the body is free at each."""
    size, body = a_map.resolution, committed.body
    reach = reach_to(committed.decision.collision_distance_sq)
    points = densely(path, 0.5 * size)
    middles = 0.5 * (points[1:] + points[:-1])
    steps = np.sqrt(np.square(points[1:] - points[:-1]).sum(axis=1))
    cells = body.cells(a_map, path, reach * size)
    return steps, ~cells.within(cells.of(middles), cells.not_free, reach)
