"""The map bench: cost of a sweep, its dependence on the map's extent, and mapped content."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.bench.micro.map_entrants import (
    SETTLING,
    THINNING,
    OctoMap,
    Ours,
    integrate,
    packed,
)
from wayproof.harness.bench.micro.map_fields import FieldTime, field_times
from wayproof.harness.bench.micro.map_trials import (
    Accuracy,
    Agreement,
    Ghost,
    accuracies,
    agreements_with_octomap,
    ghosts,
)
from wayproof.harness.bench.micro.map_workload import (
    HALL_SPACING,
    RANGE,
    RAYS,
    ROOM_POSES,
    Sweep,
    hall_sweeps,
    octomap_installed,
    room_sweeps,
)
from wayproof.harness.bench.table import Progress
from wayproof.maps import MapConfig, VoxelMap, warm_up
from wayproof.models import rays

RESOLUTIONS = (0.05, 0.1, 0.2)  # m
FINE, FINE_RANGE = 0.01, 3.0
"""Finest resolution and its range, m: at 1 cm the room has 1.2e9 cells, more than the memory of a
map. The peer is left out there, since it would take most of the time of the command."""

THREADS = (1, 2)
TURN = 4  # sweeps that go to one map before the next has its turn
SHORT, LONG = 10.0, 200.0  # m, of the trajectories whose cost is compared
MIB = 2.0**20

STILL = MapConfig(half_life=0.0)
WIDE = replace(STILL, prob_min=0.001, prob_max=0.999)
MODES = {
    "clamped": STILL,
    "clamped + decay": MapConfig(),
    "wide": WIDE,
    "wide + decay": replace(WIDE, half_life=30.0),
}
"""Name of each mode: OctoMap's clamps or the widest of a config, with decay or without."""


@dataclass(frozen=True, kw_only=True)
class MapRow:
    """One measurement; fields that do not apply to its part are None.

    Attributes:
        part: Key of `PARTS`.
        library: `wayproof`, `pyoctomap` or `edt`.
        mode: Key of `MODES`; of the peer, the way its points are thinned out.
        threads: Number of threads.
        rays: Number of rays in a sweep.
        resolution_m: Edge of a cell, m.
        ms_per_sweep: Wall time, median over sweeps, ms.
        ms_p99: 99th percentile of it, or the worst of few sweeps, ms.
        ratio_vs_pyoctomap: Median of the peer's fastest mode at this resolution over this one.
        map_mib: Memory of the map after the last sweep, MiB.
        range_m: Beyond which beams only clear, m.
        mean_ray_m: Mean length of the beams, m.
        ray_voxel_steps: Cells that the beams of a sweep cross, each counted for each beam.
        cells_updated: Different cells among them, median over sweeps.
        end_cells: Different cells that beams end in, mean over sweeps.
        trajectory_m: Length of the trajectory, m.
        clamp_high: Greatest probability of a cell.
        half_life_s: Half-life of the decay, s; 0 without decay.
        unseen_s: Time without a look at the place before the object was found gone, s.
        sweeps_to_free: Sweeps through the place of an object that left until all of it is free.
        sweeps_by_formula: Number of these sweeps by arithmetic: `map_trials.sweeps_by_formula`.
        floor_columns_lost: Share of the columns where beams met the floor that show no floor.
        false_free: Share of the cells where beams met a surface that are mapped free.
        agreement: Share of the cells known to this map or to OctoMap that have one state in both.
        agreement_above_floor: Agreement without the floor's layer, where ours guards the floor.
        ms: Wall time of distances over the room, median, ms.
        ms_worst: The longest of them, ms.
        ratio_vs_edt: Median of the `edt` package's exact transform over this one.
        cells_differ: Cells to which our distances and those of `edt` are not the same.
    """

    part: str
    library: str | None = None
    mode: str | None = None
    threads: int | None = None
    rays: int | None = None
    resolution_m: float | None = None
    ms_per_sweep: float | None = None
    ms_p99: float | None = None
    ratio_vs_pyoctomap: float | None = None
    map_mib: float | None = None
    range_m: float | None = None
    mean_ray_m: float | None = None
    ray_voxel_steps: float | None = None
    cells_updated: float | None = None
    end_cells: float | None = None
    trajectory_m: float | None = None
    clamp_high: float | None = None
    half_life_s: float | None = None
    unseen_s: float | None = None
    sweeps_to_free: int | None = None
    sweeps_by_formula: int | None = None
    floor_columns_lost: float | None = None
    false_free: float | None = None
    agreement: float | None = None
    agreement_above_floor: float | None = None
    ms: float | None = None
    ms_worst: float | None = None
    ratio_vs_edt: float | None = None
    cells_differ: int | None = None


class Lab(NamedTuple):
    """Sweeps and options shared by all parts of the benchmark."""

    room: Sequence[Sweep]
    repeats: int
    seed: int
    progress: Progress


def bench_map(repeats: int, seed: int, progress: Progress, only: str | None = None) -> list[MapRow]:
    """Measure the map; one flat row for each figure or pair of figures.

    Args:
        repeats: Number of timed sweeps.
        seed: Seed of the noise of the sweeps.
        progress: Called with a line about what is under way.
        only: Key of `PARTS` to measure; None for all.
    """
    progress("compiling kernels (some seconds the first time, then cached)")
    warm_up()
    rays.warm_up()
    progress("map: casting sweeps")
    lab = Lab(room_sweeps(seed), repeats, seed, progress)
    measured = PARTS.values() if only is None else [PARTS[only]]
    return [row for measure in measured for row in measure(lab)]


def _workloads(lab: Lab) -> Iterator[MapRow]:
    yield from (workload(lab.room, resolution) for resolution in RESOLUTIONS)


def _speeds(lab: Lab) -> Iterator[MapRow]:
    for resolution in RESOLUTIONS:
        lab.progress(f"map: speed at {resolution:g} m")
        yield from speed(lab.room, resolution, RANGE, lab.repeats, peers=octomap_installed())
    lab.progress(f"map: speed at {FINE:g} m")
    yield from speed(
        lab.room,
        resolution=FINE,
        range_limit=FINE_RANGE,
        sweeps=lab.repeats,
        modes={"clamped": STILL},
    )


def _extents(lab: Lab) -> Iterator[MapRow]:
    lab.progress(f"map: {SHORT:g} m and {LONG:g} m")
    yield from extent(lab.seed, SHORT, LONG, 0.05)


def _fields(lab: Lab) -> Iterator[MapRow]:
    lab.progress("map: distances")
    for found in field_times(lab.room, 0.05, lab.repeats):
        yield _found_row("fields", found)


def _ghosts(lab: Lab) -> Iterator[MapRow]:
    lab.progress("map: ghosts")
    yield from (_found_row("ghosts", ghost) for ghost in ghosts())


def _accuracies(lab: Lab) -> Iterator[MapRow]:
    for resolution in (0.05, 0.1):
        lab.progress(f"map: accuracy at {resolution:g} m")
        for found in accuracies(lab.room, resolution):
            yield _found_row("accuracy", found)


def _agreement(lab: Lab) -> Iterator[MapRow]:
    if octomap_installed():
        lab.progress("map: agreement")
        for found in agreements_with_octomap(lab.room, 0.1):
            yield _found_row("agreement", found)


PARTS: dict[str, Callable[[Lab], Iterator[MapRow]]] = {
    "workload": _workloads,
    "speed": _speeds,
    "extent": _extents,
    "fields": _fields,
    "ghosts": _ghosts,
    "accuracy": _accuracies,
    "agreement": _agreement,
}
"""Part -> function that measures it, in the order of the rows."""


def workload(room: Sequence[Sweep], resolution: float) -> MapRow:
    """Return the amount of work in the sweeps of the room."""
    lengths, steps, ends = [], [], []
    voxel_map = VoxelMap(replace(STILL, resolution=resolution))
    updated = [integrate(voxel_map, sweep, k, RANGE) for k, sweep in enumerate(room)]
    for sweep in room:
        length = np.minimum(sweep.ranges_mm / 1000.0, RANGE)
        first = np.floor(sweep.origin / resolution)
        last = np.floor((sweep.origin + sweep.directions * length[:, None]) / resolution)
        lengths.append(length.mean())
        steps.append(np.abs(last - first).sum() + len(last))
        ends.append(len(np.unique(packed(last))))
    return MapRow(
        part="workload",
        rays=RAYS,
        resolution_m=resolution,
        mean_ray_m=float(np.mean(lengths)),
        ray_voxel_steps=float(np.mean(steps)),
        cells_updated=float(np.median(updated)),
        end_cells=float(np.mean(ends)),
    )


def speed(
    room: Sequence[Sweep],
    resolution: float,
    range_limit: float,
    sweeps: int,
    modes: Mapping[str, MapConfig] = MODES,
    peers: bool = False,
) -> list[MapRow]:
    """Time every mode and the peer on the same sweeps, in turns, so that load meets them alike.

    A turn is a few sweeps, each turn in another order: a map in use finds in the caches what its
    last sweep left there, and not what nine others did.
    """
    ours = [
        Ours(name, threads, replace(config, resolution=resolution), range_limit)
        for name, config in modes.items()
        for threads in THREADS
    ]
    theirs = [OctoMap(name, resolution, range_limit) for name in THINNING] if peers else []
    entrants: list[Ours | OctoMap] = [*ours, *theirs]
    order = np.random.default_rng(sweeps)
    total = SETTLING + sweeps
    for first in range(0, total, TURN):
        for place in order.permutation(len(entrants)):
            for number in range(first, min(first + TURN, total)):
                entrants[place].take(room[number % ROOM_POSES], number)
    fastest = min((float(np.median(peer.timed())) for peer in theirs), default=None)
    return [
        replace(
            _timed_row("speed", entrant.timed(), fastest),
            library=entrant.library,
            mode=entrant.name,
            threads=entrant.threads,
            resolution_m=resolution,
            range_m=range_limit,
            map_mib=entrant.memory_bytes() / MIB,
        )
        for entrant in entrants
    ]


def extent(seed: int, short: float, long: float, resolution: float) -> list[MapRow]:
    """Time one long trajectory, and its every stretch again with a new map: the same work, twice.

    Args:
        seed: Seed of the noise.
        short: Length of a stretch, m.
        long: Length of the whole hall, m.
        resolution: Edge of a cell, m.
    """
    config = MapConfig(resolution=resolution)
    stretch = round(short / HALL_SPACING)
    whole = Ours("decay", 1, config, RANGE)
    parts: list[Ours] = []
    for number, sweep in enumerate(itertools.islice(hall_sweeps(seed), round(long / HALL_SPACING))):
        if number % stretch == 0:
            parts.append(Ours("decay", 1, config, RANGE))
        whole.take(sweep, number)
        parts[-1].take(sweep, number)
    both = (
        (short, [ms for part in parts for ms in part.timed()], parts[-1]),
        (long, whole.timed(), whole),
    )
    return [
        replace(
            _timed_row("extent", timed, None),
            library="wayproof",
            mode=entrant.name,
            threads=1,
            resolution_m=resolution,
            range_m=RANGE,
            trajectory_m=length,
            map_mib=entrant.memory_bytes() / MIB,
        )
        for length, timed, entrant in both
    ]


def _timed_row(part: str, ms: Sequence[float], fastest_peer_ms: float | None) -> MapRow:
    median = float(np.median(ms))
    ratio = None if fastest_peer_ms is None else float(fastest_peer_ms / median)
    return MapRow(
        part=part,
        rays=RAYS,
        ms_per_sweep=median,
        ms_p99=float(np.quantile(ms, 0.99)),
        ratio_vs_pyoctomap=ratio,
    )


def _found_row(part: str, found: FieldTime | Ghost | Accuracy | Agreement) -> MapRow:
    return MapRow(part=part, **asdict(found))
