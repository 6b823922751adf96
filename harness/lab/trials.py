"""Maps of other settings on the same sweeps: memory, time, cells, ghosts, and agreement."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.bounds import check_fields
from wayproof.harness.inputs import WorldSweep
from wayproof.harness.lab.source import Source
from wayproof.maps import FREE, MAPS, OCCUPIED, MapConfig, Representation, VoxelMap, states_in

RESOLUTIONS = (0.01, 0.05, 0.1, 0.2)
"""Resolutions that are compared, m."""

CLAMPS = ((0.12, 0.97), (0.02, 0.98), (0.3, 0.7))
"""Clamping thresholds that are compared: the default, wide, and narrow."""

HALF_LIVES = (0.0, 5.0, 30.0)
"""Half-lives that are compared, s; 0 is none."""

WALL_SWEEPS = 50
"""Sweeps that see the thing before it leaves, in the trial of ghosts."""

MOST_MISSES = 1000

MOST_CELLS = 1e8
"""Maximum number of cells of a region, about; beyond it all space is mapped."""

RAYS = 64
"""Directions of the rays that are cast from the last origin."""

RAY_RANGE = 10.0
"""Their range, m."""

OCTOMAP = "octomap"


@dataclass(frozen=True)
class Trial:
    """One map of the lab.

    Attributes:
        group: Setting that is varied: `resolution`, `clamps`, `decay`, or `peer`.
        setting: The setting, in words.
        kind: Kind of the map.
        ms_p50: Median wall time to integrate a sweep, ms.
        ms_p99: 99th percentile, ms.
        memory_mib: Memory of the map at the end, MiB.
        occupied: Number of occupied cells at the end.
        free: Number of free cells.
        misses_to_free: Sweeps that must see through a cell until it is free again, after something
            stood in it for 50 sweeps; None if it never is.
        agreement: Share of the cells known to either that are the same in OctoMap; None without.
        ghosts: Times that an occupied cell of these sweeps became free again.
        sweeps_to_free: Median number of sweeps from the last hit of such a cell until it was free;
            None without one.
    """

    group: str
    setting: str
    kind: str
    ms_p50: float
    ms_p99: float
    memory_mib: float
    occupied: int
    free: int
    misses_to_free: int | None
    agreement: float | None = None
    ghosts: int | None = None
    sweeps_to_free: float | None = None


@dataclass(frozen=True)
class Rays:
    """Outcomes of rays from the last sensor's place through the map of the default settings.

    Attributes:
        occupied: Share that stop at an occupied cell.
        unknown: Share that, stopped by unknown cells, end at one before it.
        mean_free_m: Mean length up to the first occupied or unknown cell, m.
    """

    occupied: float
    unknown: float
    mean_free_m: float


def variants(base: MapConfig) -> Iterator[tuple[str, str, MapConfig]]:
    """Yield group, setting in words, and config of each map."""
    for resolution in RESOLUTIONS:
        yield "resolution", f"{100 * resolution:g} cm", replace(base, resolution=resolution)
    for low, high in CLAMPS:
        yield "clamps", f"{low:g} to {high:g}", replace(base, prob_min=low, prob_max=high)
    for half_life in HALF_LIVES:
        words = f"{half_life:g} s" if half_life else "none"
        yield "decay", words, replace(base, half_life=half_life)


def run_trial(source: Source, group: str, setting: str, config: MapConfig) -> Trial:
    """Integrate all sweeps of a source into one map.

    Raises:
        ValueError: The map cannot have these settings, or not on these sweeps.
    """
    ghosts = GhostWatch(config.resolution)
    a_map, spent = build(source, config, ghosts)
    return replace(
        _trial(group, setting, config, a_map, spent),
        ghosts=len(ghosts.cleared),
        sweeps_to_free=float(np.median(ghosts.cleared)) if ghosts.cleared else None,
    )


def _trial(
    group: str, setting: str, config: MapConfig, a_map: Representation, spent: list[float]
) -> Trial:
    """Return the figures of a map and of the wall times of its sweeps, ms."""
    counts = a_map.counts()
    p50, p99 = np.percentile(spent, [50, 99]).tolist()
    return Trial(
        group=group,
        setting=setting,
        kind=config.kind,
        ms_p50=p50,
        ms_p99=p99,
        memory_mib=a_map.memory_bytes() / 2**20,
        occupied=counts.get("occupied", 0),
        free=counts.get("free", 0),
        misses_to_free=misses_to_free(config),
    )


def build(
    source: Source, config: MapConfig, ghosts: GhostWatch | None = None
) -> tuple[Representation, list[float]]:
    """Integrate all sweeps of a source; return the map, and the wall time of each, ms."""
    check_fields(config, "map.")
    a_map = _empty(source, config)
    spent = []
    for one in source.sweeps:
        sweep = one.sweep
        if config.no_return == "ignored":
            sweep = sweep.without_no_returns()
        longest = min(one.range_m, 2046.0 * config.resolution)
        began = time.perf_counter()
        a_map.integrate(
            sweep.origins,
            sweep.directions,
            sweep.ranges_mm,
            longest,
            one.time_ns,
            sweep.moments,
            sweep.spared,
        )
        spent.append((time.perf_counter() - began) * 1e3)
        if ghosts is not None:
            ghosts.watch(sweep, longest, a_map)
    return a_map, spent


def _empty(source: Source, config: MapConfig) -> Representation:
    """Make an empty map of the source's region; of all space if fine cells make it too large."""
    low, high = np.array(source.low), np.array(source.high)
    if float(np.prod((high - low) / config.resolution)) > MOST_CELLS:
        return MAPS[config.kind](config)
    return MAPS[config.kind](config, source.low, source.high)


def misses_to_free(config: MapConfig) -> int | None:
    """Return how many sweeps must cross a cell until it is free, seen as solid in 50.

    Measured on a map of this kind, without decay: one beam along x at a height of 0.3 m.
    """
    a_map = MAPS[config.kind](replace(config, half_life=0.0), (-4, -4, -1), (4, 4, 2))
    size = config.resolution
    origin = np.array([0.5 * size, 0.5 * size, 0.3])
    beam, place = np.array([[1.0, 0.0, 0.0]]), np.array([[1.0 + 0.5 * size, 0.5 * size, 0.3]])
    met = np.array([round(1000 * float(place[0, 0] - origin[0]))], np.uint16)
    beyond = np.array([2000], np.uint16)
    now = 0
    for _ in range(WALL_SWEEPS):
        a_map.integrate(origin, beam, met, 3.0, now)
        now += 100_000_000
    if a_map.state_at(place)[0] != OCCUPIED:
        return None
    for misses in range(1, MOST_MISSES + 1):
        a_map.integrate(origin, beam, beyond, 3.0, now)
        now += 100_000_000
        if a_map.state_at(place)[0] == FREE:
            return misses
    return None


def against_octomap(source: Source) -> tuple[Trial, Trial] | None:
    """Compare our map and OctoMap on the same sweeps, without decay and without the floor's guard.

    Returns:
        Ours with the agreement, and OctoMap's; None if pyoctomap is not installed.
    """
    settings = replace(
        source.config,
        kind="voxel",
        half_life=0.0,
        no_decay_radius=0.0,
    )
    source = _sparing_none(source)
    try:
        peer, peer_ms = build(source, replace(settings, kind=OCTOMAP))
    except ValueError as error:
        if "pyoctomap" in str(error):
            return None
        raise
    ours, ours_ms = build(source, settings)
    share = agreement(source, ours, peer)
    made = [
        _trial("peer", "no decay", replace(settings, kind=kind), a_map, spent)
        for a_map, kind, spent in ((ours, "voxel", ours_ms), (peer, OCTOMAP, peer_ms))
    ]
    return replace(made[0], agreement=share), replace(made[1], agreement=share)


def _sparing_none(source: Source) -> Source:
    """Return a source whose beams clear all layers alike."""
    bare = [replace(one, sweep=replace(one.sweep, spared="none")) for one in source.sweeps]
    return replace(source, sweeps=tuple(bare))


def agreement(source: Source, ours: Representation, peer: Representation) -> float | None:
    """Share of the cells in the region that either map knows and that both hold alike."""
    mine = states_in(ours, source.low, source.high)
    theirs = states_in(peer, source.low, source.high)
    known = (mine != 0) | (theirs != 0)
    return float((mine[known] == theirs[known]).mean()) if known.any() else None


def cast_rays(source: Source) -> Rays | None:
    """Cast rays from the last origin in a voxel map of the source's settings."""
    if not source.sweeps:
        return None
    a_map, _ = build(source, replace(source.config, kind="voxel"))
    assert isinstance(a_map, VoxelMap)
    origin = source.sweeps[-1].sweep.origins[-1]
    hits, before, lengths = 0, 0, []
    for angle in np.linspace(0.0, 2.0 * np.pi, RAYS, endpoint=False):
        toward = np.array([np.cos(angle), np.sin(angle), 0.0])
        stopped = a_map.cast_ray(origin, toward, RAY_RANGE)
        first = a_map.cast_ray(origin, toward, RAY_RANGE, stop_at_unknown=True)
        hits += stopped is not None
        before += first is not None and first.state != OCCUPIED
        lengths.append(RAY_RANGE if first is None else first.distance)
    return Rays(hits / RAYS, before / RAYS, float(np.mean(lengths)))


class GhostWatch:
    """Watch of the cells of one map that a sweep has hit and that were occupied then.

    Attributes:
        cleared: Sweeps from the last hit to the sweep after which the cell was free, one entry each
            time that a cell became free.
    """

    def __init__(self, size: float) -> None:
        """Start before the first sweep.

        Args:
            size: Cells of the map, m.
        """
        self.cleared: list[int] = []
        self._size = size
        self._hit: dict[tuple[int, ...], int] = {}  # cell -> number of the sweep that last hit it
        self._points: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self._sweep = 0

    def watch(self, sweep: WorldSweep, range_m: float, a_map: Representation) -> None:
        """Look at the watched cells after a sweep was integrated.

        Args:
            sweep: The sweep.
            range_m: Returns beyond do not count, m.
            a_map: The map that holds it.
        """
        self._sweep += 1
        self._leave(a_map)
        points = sweep.points_within(range_m)
        cells = np.floor(points / self._size).astype(np.int64)
        _, first = np.unique(cells, axis=0, return_index=True)
        if len(first) == 0:
            return
        occupied = a_map.state_at(points[first]) == OCCUPIED
        for index in first[occupied].tolist():
            cell = tuple(cells[index].tolist())
            self._hit[cell] = self._sweep
            self._points.setdefault(cell, points[index])

    def _leave(self, a_map: Representation) -> None:
        """Note the watched cells that are free now, and watch them no more."""
        if not self._points:
            return
        names = list(self._points)
        free = a_map.state_at(np.array([self._points[name] for name in names])) == FREE
        for place in np.flatnonzero(free).tolist():
            self.cleared.append(self._sweep - self._hit.pop(names[place]))
            del self._points[names[place]]
