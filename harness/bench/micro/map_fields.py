"""Cost of the distances of a whole window, as in a costmap."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.micro.map_workload import RANGE, ROOM, SWEEP_NS, Sweep
from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.columns import Window, unpack
from wayproof.maps.costmap.distance_field import (
    ALL_ONES,
    CellUpdate,
    DistanceField,
    update_together,
)
from wayproof.maps.parallel import ThreadTeam

REACH = 1.0  # m, of the distances
PEER_REPEATS = 3  # of a whole transform, which takes long
MAPPED = 5  # sweeps before the timed ones


@dataclass(frozen=True)
class FieldTime:
    """Time of one method of computing distances; see `MapRow`."""

    library: str
    mode: str
    threads: int
    resolution_m: float
    ms: float
    ms_worst: float
    ratio_vs_edt: float | None = None
    cells_differ: int | None = None


def edt_installed() -> bool:
    """Return whether the peer is installed."""
    return find_spec("edt") is not None


def field_times(room: Sequence[Sweep], resolution: float, repeats: int) -> Iterator[FieldTime]:
    """Time distances over the room, whole and after each sweep, and the peer.

    Blocked is what is not known to be free, and what lies outside. Everyone in turn for each sweep,
    so that load meets them alike.

    Args:
        room: Sweeps.
        resolution: Edge of a cell, m.
        repeats: Timed sweeps.
    """
    window = Window.covering((0.0, 0.0, 0.0), ROOM - [0.0, 0.0, resolution], resolution)
    voxel_map = VoxelMap(MapConfig(resolution=resolution, half_life=0.0))
    reach = round(REACH / resolution)
    teams = {threads: ThreadTeam(threads) for threads in (1, 2)}
    kept = {n: DistanceField(window.shape, reach, team) for n, team in teams.items()}
    for field in kept.values():  # all is unknown
        field.update(np.full((*window.shape[:2], 1), ~np.uint64(0)))
    times: dict[tuple[str, str, int], list[float]] = {}
    differ = 0

    def timed(library: str, mode: str, threads: int, began: float) -> None:
        ms = (time.perf_counter() - began) * 1e3
        times.setdefault((library, mode, threads), []).append(ms)

    stamp = 0
    for number in range(MAPPED + repeats):
        sweep = room[number % len(room)]
        voxel_map.integrate(
            sweep.origin, sweep.directions, sweep.ranges_mm, RANGE, number * SWEEP_NS
        )
        boxes, stamp = voxel_map.changed(stamp)
        _, changed = window.touched_by(boxes)
        _, free = voxel_map.columns(window.first, (*window.shape[:2], 1))
        if changed is None:
            continue
        update = CellUpdate((free,), (ALL_ONES,), (0, 0), *((s.start, s.stop) for s in changed))
        columns = ((0, count) for count in free.shape[:2])
        all_cells = CellUpdate((free,), (ALL_ONES,), (0, 0), *columns)
        for threads, team in teams.items():
            began = time.perf_counter()
            update_together([kept[threads]], update)
            if number < MAPPED:
                continue
            timed("wayproof", f"{REACH:g} m field, after a sweep", threads, began)
            whole = DistanceField(window.shape, reach, team)
            began = time.perf_counter()
            update_together([whole], all_cells)
            timed("wayproof", f"{REACH:g} m field, whole", threads, began)
            if edt_installed() and number < MAPPED + PEER_REPEATS:
                passable = unpack(free, window.shape[2])
                began = time.perf_counter()
                distances = _peer(passable, threads)
                timed("edt", "all distances, whole", threads, began)
                least = np.minimum(np.rint(distances), reach * reach)
                differ += int((least != kept[threads].squared).sum())
    yield from _rows(times, resolution, differ if edt_installed() else None)


def _peer(passable: NDArray[np.uint8], threads: int) -> NDArray[np.float32]:
    edt: Any = import_module("edt")
    squared: NDArray[np.float32] = edt.edtsq(passable, black_border=True, parallel=threads)
    return squared


def _rows(
    times: dict[tuple[str, str, int], list[float]], resolution: float, differ: int | None
) -> Iterator[FieldTime]:
    medians = {key: float(np.median(ms)) for key, ms in times.items()}
    peers = {key[2]: ms for key, ms in medians.items() if key[0] == "edt"}
    for key in sorted(times):
        library, mode, threads = key
        row = FieldTime(library, mode, threads, resolution, medians[key], ms_worst=max(times[key]))
        if threads in peers:
            row = replace(row, ratio_vs_edt=peers[threads] / medians[key], cells_differ=differ)
        yield row
