"""Snapshots of moments with copies of the map, which changes while they are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.log.reader import Log
from wayproof.harness.viewer.evidence import Evidence, evidence_at
from wayproof.harness.viewer.layer import kinds, layer_at
from wayproof.harness.viewer.moments import Moment, moments
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


class Layer(NamedTuple):
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


class Snapshot(NamedTuple):
    """Data shown of one moment.

    Attributes:
        moment: The decision; its map has changed since.
        layer: Layer, if it is shown.
        with_hits: Whether the end points of the sweep are shown.
        tiles: Tiles of the map that changed since the last check.
        with_costmap: Whether a stack's own costmap came with the command and is shown.
    """

    moment: Moment
    layer: Layer | None
    with_hits: bool
    tiles: list[Tile]
    with_costmap: bool = False


def layer_period_ns(log: Log) -> int:
    """Return the simulated time between shown layers of a log, ns."""
    long = float(log.result.get("sim_time_s", 0.0)) > LONG_S
    return LONG_LAYER_PERIOD_NS if long else LAYER_PERIOD_NS


def snapshots(log: Log) -> Iterator[Snapshot]:
    """Yield a snapshot of each moment of a log in order; then the last again, with layer and cells.

    Raises:
        InputError: The log is damaged, or its sweeps were left out.
    """
    tiles, due = tiles_of(log), _Timers()
    moment = None
    for moment in moments(log):
        due.now_ns, layer, own = moment.time_ns, None, moment.stack_costmap is not None
        if due("layer", layer_period_ns(log)):
            layer = _layer(log, moment, due("evidence", EVIDENCE_PERIOD_NS))
        hits, cells = due("sweep", SWEEP_PERIOD_NS), due("cells", CELLS_PERIOD_NS)
        changed = tiles.changed(moment.map) if cells else []
        yield Snapshot(moment, layer, hits, changed, own and due("own", layer_period_ns(log)))
    if moment is not None:
        yield Snapshot(moment, _layer(log, moment, True), False, tiles.changed(moment.map))


def tiles_of(log: Log) -> Tiles:
    """Return the tiles for the occupied cells of a log's map, above a walking body's steps."""
    x, y, z = log.mission.low
    low = x, y, max(z, log.mission.step_height)
    return Tiles(low, log.mission.high, log.config.map.resolution)


def _layer(log: Log, moment: Moment, with_evidence: bool) -> Layer:
    costmap = moment.costmap
    index = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    found = kinds(costmap, index, moment.decision.collision_distance_sq)
    evidence = None
    if with_evidence:
        evidence = evidence_at(moment.map, costmap, index, log.mission, moment.time_ns)
    return Layer(found, costmap.origin[:2], costmap.resolution, evidence)


class _Timers:
    """Timers of simulated time by name."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._next_ns: dict[str, int] = {}

    def __call__(self, name: str, period_ns: int) -> bool:
        """Return whether a timer is due, and start its next period if it is."""
        if self.now_ns < self._next_ns.get(name, 0):
            return False
        self._next_ns[name] = self.now_ns + period_ns
        return True
