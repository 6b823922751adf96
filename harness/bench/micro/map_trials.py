"""Accuracy of a map: how soon it clears an object that left, and its surfaces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.micro.map_workload import (
    FLOOR,
    RANGE,
    ROOM,
    SWEEP_NS,
    Sweep,
    octomap_installed,
)
from wayproof.maps import FREE, MAPS, OCCUPIED, UNKNOWN, MapConfig
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

FLOOR_HEIGHT_IN_CELL = 0.75
"""Height of the plane z = 0 in its layer of cells, from the bottom of the layer, cells."""

CLAMPS = (0.8, 0.9, 0.97, 0.99, 0.999)
ABSENCES = ((10.0, 10.0), (10.0, 30.0), (30.0, 30.0), (30.0, 60.0))  # half-life, unseen for, s
MOST_SWEEPS = 100  # until a ghost counts as staying

LIBRARIES = {"voxel": "wayproof", "octomap": "pyoctomap"}
GUARDED = "guarded floor"
GUARDS = {True: GUARDED, False: "no guard"}


@dataclass(frozen=True)
class Ghost:
    """Time for which the map shows an object that left; see `MapRow`."""

    library: str
    resolution_m: float
    clamp_high: float
    half_life_s: float
    unseen_s: float
    sweeps_to_free: int
    sweeps_by_formula: int


@dataclass(frozen=True)
class Accuracy:
    """States of the surfaces that beams hit; see `MapRow`."""

    library: str
    mode: str
    resolution_m: float
    floor_columns_lost: float
    false_free: float


@dataclass(frozen=True)
class Agreement:
    """Agreement of a map with OctoMap after the same sweeps; see `MapRow`."""

    library: str
    mode: str
    resolution_m: float
    agreement: float
    agreement_above_floor: float


def ghosts() -> Iterator[Ghost]:
    """Show an object until its cells are saturated, and remove it at the next look."""
    still = MapConfig(half_life=0.0)
    for clamp in CLAMPS:
        yield ghost("voxel", replace(still, prob_max=clamp), 0.0)
    for half_life, unseen in ABSENCES:
        yield ghost("voxel", replace(still, half_life=half_life), unseen)
    if octomap_installed():
        for clamp in CLAMPS:
            yield ghost("octomap", replace(still, prob_max=clamp), 0.0)


def ghost(kind: str, config: MapConfig, unseen: float) -> Ghost:
    """Let a wall stand 2 m off until it is saturated, look away, and look until it is free.

    Args:
        kind: Kind of the map.
        config: Settings of the map.
        unseen: Time between the last look at the wall and the first one through its place, s.
    """
    seen = MAPS[kind](config, 1)
    origin, directions, wall_mm, nothing_mm = _wall()
    surface = origin + directions * (wall_mm / 1000.0)[:, None]
    looks = math.ceil(_log_odds(config.prob_max) / config.log_odds_hit) + 1
    for number in range(looks):
        seen.integrate(origin, directions, wall_mm, 4.0, number * SWEEP_NS)
    gone_ns = looks * SWEEP_NS + round(unseen * 1e9)
    for number in range(MOST_SWEEPS):
        if np.all(seen.state_at(surface) == FREE):
            break
        seen.integrate(origin, directions, nothing_mm, 4.0, gone_ns + number * SWEEP_NS)
    return Ghost(
        library=LIBRARIES[kind],
        resolution_m=config.resolution,
        clamp_high=config.prob_max,
        half_life_s=config.half_life,
        unseen_s=unseen,
        sweeps_to_free=number,
        sweeps_by_formula=sweeps_by_formula(config, unseen),
    )


def sweeps_by_formula(config: MapConfig, unseen: float) -> int:
    """Return misses that take a saturated cell below zero: floor(L 2^(-t / h) / miss) + 1.

    L is the log-odds of `clamp_high`, t the time unseen and h the half-life, s.
    """
    faded = 2.0 ** (-unseen / config.half_life) if config.half_life > 0.0 else 1.0
    return math.floor(_log_odds(config.prob_max) * faded / config.log_odds_miss) + 1


def accuracies(room: Sequence[Sweep], resolution: float) -> Iterator[Accuracy]:
    """Yield the accuracy of each map after the room's sweeps; the peer twice, by its floor's cells.

    By itself OctoMap has the plane z = 0 between two layers of cells; for its sake everything is
    lifted by what our maps lower their cells.
    """
    config = MapConfig(resolution=resolution, half_life=0.0)
    ours = _integrate_into("voxel", config, room)
    yield _accuracy("voxel", mode=GUARDED, state_map=ours, sweeps=room, resolution=resolution)
    if not octomap_installed():
        return
    peer = _integrate_into("octomap", config, room)
    yield _accuracy(
        "octomap", mode="floor at 3/4", state_map=peer, sweeps=room, resolution=resolution
    )
    lift = np.array([0.0, 0.0, (1.0 - FLOOR_HEIGHT_IN_CELL) * resolution])
    lifted = [sweep.moved(lift) for sweep in room]
    peer = _integrate_into("octomap", config, lifted)
    yield _accuracy(
        "octomap", mode="floor on a face", state_map=peer, sweeps=lifted, resolution=resolution
    )


def agreements_with_octomap(room: Sequence[Sweep], resolution: float) -> Iterator[Agreement]:
    """Yield how our map, with its guard and without, agrees with the peer after the room's sweeps.

    Without the beams that only clear: OctoMap clears along those up to a range and not up to a
    cell, so they cannot be compared.
    """
    config = MapConfig(resolution=resolution, half_life=0.0)
    returns = [
        replace(sweep, ranges_mm=np.where(sweep.ranges_mm == NO_RETURN, DROPPED, sweep.ranges_mm))
        for sweep in room
    ]
    peer = _integrate_into("octomap", config, returns)
    for guard, mode in GUARDS.items():
        ours = _integrate_into("voxel", replace(config, floor_grazing_filter=guard), returns)
        same = agreement(ours, peer, resolution)
        yield Agreement(LIBRARIES["voxel"], mode, resolution, *same)


def agreement(one: Any, other: Any, resolution: float) -> tuple[float, float]:
    """Share of the room's cells, known to either map, that have one state: of all, above floor."""
    nx, ny, nz = (int(n) for n in ROOM / resolution)
    x, y = (a.ravel() for a in np.indices((nx, ny)))
    same, known = np.zeros((2, nz), np.int64)
    for layer in range(nz):  # one at a time: they are many
        cells = np.stack([x, y, np.full_like(x, layer)], axis=1)
        a, b = (m.state_at(_centres(cells, resolution)) for m in (one, other))
        same[layer] = ((a == b) & (a != UNKNOWN)).sum()
        known[layer] = ((a != UNKNOWN) | (b != UNKNOWN)).sum()
    return float(same.sum() / known.sum()), float(same[1:].sum() / known[1:].sum())


def floor_columns_lost(state_map: Any, sweeps: Sequence[Sweep], resolution: float) -> float:
    """Share of the columns in which beams met the floor without an occupied cell at the floor.

    Noise may put the floor one layer up or down.
    """
    met = np.concatenate([s.origin + s.directions * s.distances[:, None] for s in sweeps])
    floor = np.unique(
        _cells(met[np.concatenate([s.geoms for s in sweeps]) == FLOOR], resolution), axis=0
    )
    shown = np.zeros(len(floor), np.bool_)
    for layer in (-1, 0, 1):
        shown |= (
            state_map.state_at(_centres(floor + np.array([0, 0, layer]), resolution)) == OCCUPIED
        )
    return float(1.0 - shown.mean())


def false_free(state_map: Any, sweeps: Sequence[Sweep], resolution: float) -> float:
    """Share of the cells in which beams met a surface, in truth, that are mapped free."""
    points = np.concatenate([sweep.points() for sweep in sweeps])
    cells = np.unique(_cells(points, resolution), axis=0)
    return float((state_map.state_at(_centres(cells, resolution)) == FREE).mean())


def _accuracy(
    kind: str,
    mode: str,
    state_map: Any,
    sweeps: Sequence[Sweep],
    resolution: float,
) -> Accuracy:
    return Accuracy(
        LIBRARIES[kind],
        mode,
        resolution,
        floor_columns_lost(state_map, sweeps, resolution),
        false_free(state_map, sweeps, resolution),
    )


def _integrate_into(kind: str, config: MapConfig, sweeps: Sequence[Sweep]) -> Any:
    state_map = MAPS[kind](config, 1)
    for number, sweep in enumerate(sweeps):
        state_map.integrate(
            sweep.origin, sweep.directions, sweep.ranges_mm, RANGE, number * SWEEP_NS
        )
    return state_map


def _cells(points: NDArray[np.float64], resolution: float) -> NDArray[np.int64]:
    """Return the cells (n, 3) of points (n, 3), m, world, as every map lays them."""
    return np.floor(points / resolution + [0.0, 0.0, FLOOR_HEIGHT_IN_CELL]).astype(np.int64)


def _centres(cells: NDArray[np.int64], resolution: float) -> NDArray[np.float64]:
    """Return centres of cells (n, 3), m, world."""
    middle = np.array([0.5, 0.5, 0.5 - FLOOR_HEIGHT_IN_CELL])
    centres: NDArray[np.float64] = (cells + middle) * resolution
    return centres


def _wall() -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.uint16], NDArray[np.uint16]
]:
    """Return the origin, directions, ranges to a wall 2 m off in x, and ranges without it, mm."""
    slopes = np.linspace(-0.2, 0.2, 21)
    y, z = (a.ravel() for a in np.meshgrid(slopes, slopes))
    directions = np.stack([np.ones_like(y), y, z], axis=1)
    lengths = np.sqrt((directions**2).sum(axis=1))
    ranges_mm = np.rint(2030.0 * lengths).astype(np.uint16)
    nothing = np.full(len(lengths), 65535, np.uint16)
    return np.array([5.04, 5.04, 1.0]), directions / lengths[:, None], ranges_mm, nothing


def _log_odds(probability: float) -> float:
    return math.log(probability / (1.0 - probability))
