"""Snapshots of moments with copies of the map, which changes while they are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.explain.commanded import Commanded
from wayproof.harness.inputs import Pose
from wayproof.harness.interface.types import Grid
from wayproof.harness.log.reader import Log
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.viewer.evidence import Evidence, evidence_at
from wayproof.harness.viewer.layer import kinds, layer_at
from wayproof.harness.viewer.moments import Moment, moments, standing_low
from wayproof.harness.viewer.tiles import Tile, Tiles

MOST_HITS = 3000
"""Maximum number of shown end points of a sweep."""

SWEEP_PERIOD_NS = 200_000_000
CELLS_PERIOD_NS = 1_000_000_000
"""Simulated time between shown sweeps, and between checks for changed cells, ns."""

LAYER_PERIOD_NS, LONG_LAYER_PERIOD_NS = 200_000_000, 500_000_000
"""Simulated time between layers of a log, and of a long one, ns: each needs a costmap."""

EVIDENCE_PERIOD_NS = 1_000_000_000
"""Simulated time between layers with their evidence, ns: ages change everywhere, all the time."""

LONG_S = 30.0
"""Simulated time beyond which a log is long, s."""


@dataclass(frozen=True)
class Layer:
    """Layer of the costmap at the height of the robot.

    Attributes:
        kinds: (nx, ny) kinds of its cells, see `harness.viewer.layer`.
        corner: (2,) lower corner of its first cell, m, world.
        resolution: Edge of a cell, m.
        evidence: Age and probability of its cells, if they are shown.
    """

    kinds: NDArray[np.uint8]
    corner: NDArray[np.float64]
    resolution: float
    evidence: Evidence | None = None


@dataclass(frozen=True)
class Snapshot:
    """Data shown of one moment.

    Attributes:
        time_ns: Simulated time, ns.
        pose: Estimated pose.
        decision: Logged decision.
        truth: Ground truth.
        layer: Layer, if it is shown.
        hits: Function that returns end points of beams (n, 3), m, world, if the sweep is shown; it
            needs no map, so it runs when they are drawn.
        tiles: Tiles of the map that changed since the last check.
        commanded: Command of a stack on trial; None of the built-in stack.
        stack_costmap: Its own costmap, if it came with the command and is shown.
    """

    time_ns: int
    pose: Pose
    decision: pb.Decision
    truth: pb.Truth
    layer: Layer | None
    hits: Callable[[], NDArray[np.float64]] | None
    tiles: list[Tile]
    commanded: Commanded | None = None
    stack_costmap: Grid | None = None


def layer_period_ns(log: Log) -> int:
    """Return the simulated time between shown layers of a log, ns."""
    long = float(log.result.get("sim_time_s", 0.0)) > LONG_S
    return LONG_LAYER_PERIOD_NS if long else LAYER_PERIOD_NS


def snapshots(log: Log) -> Iterator[Snapshot]:
    """Yield a snapshot of each moment of a log in order; then the last again, with layer and cells.

    Raises:
        InputError: The log is damaged, or its sweeps were left out.
    """
    tiles, mission = tiles_of(log), log.mission
    layer, sweep = _Timer(layer_period_ns(log)), _Timer(SWEEP_PERIOD_NS)
    cells, own = _Timer(CELLS_PERIOD_NS), _Timer(layer_period_ns(log))
    evidence = _Timer(EVIDENCE_PERIOD_NS)
    moment = None
    for moment in moments(log):
        now = moment.time_ns
        yield _snapshot(
            moment,
            layer=_layer(moment, mission, evidence.due(now)) if layer.due(now) else None,
            hits=partial(moment.hits, MOST_HITS) if sweep.due(now) else None,
            tiles=tiles.changed(moment.map) if cells.due(now) else [],
            with_costmap=moment.stack_costmap is not None and own.due(now),
        )
    if moment is not None:
        last = _layer(moment, mission, with_evidence=True)
        yield _snapshot(moment, layer=last, hits=None, tiles=tiles.changed(moment.map))


def tiles_of(log: Log) -> Tiles:
    """Return the tiles for the occupied cells of the map of a log."""
    return Tiles(standing_low(log.mission), log.mission.high, log.config.map.resolution)


def _snapshot(
    moment: Moment,
    *,
    layer: Layer | None,
    hits: Callable[[], NDArray[np.float64]] | None,
    tiles: list[Tile],
    with_costmap: bool = False,
) -> Snapshot:
    own = moment.stack_costmap if with_costmap else None
    return Snapshot(
        time_ns=moment.time_ns,
        pose=moment.record.inputs.pose,
        decision=moment.decision,
        truth=moment.truth,
        layer=layer,
        hits=hits,
        tiles=tiles,
        commanded=moment.commanded,
        stack_costmap=None if own is None else own.grid,
    )


def _layer(moment: Moment, mission: Mission, with_evidence: bool) -> Layer:
    costmap, record = moment.costmap, moment.record
    index = layer_at(costmap, float(record.inputs.pose.position[2]))
    layer_kinds = kinds(costmap, index, record.decision.collision_distance_sq)
    evidence = None
    if with_evidence:
        evidence = evidence_at(
            moment.map, costmap, layer=index, mission=mission, time_ns=moment.time_ns
        )
    return Layer(layer_kinds, costmap.origin[:2], costmap.resolution, evidence)


class _Timer:
    """Timer of a period of simulated time."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._next_ns = 0

    def due(self, now_ns: int) -> bool:
        if now_ns < self._next_ns:
            return False
        self._next_ns = now_ns + self._period_ns
        return True
