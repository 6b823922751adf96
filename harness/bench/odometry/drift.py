"""`wayproof bench odometry`: drift by the way, and time a sweep, of odometries on one thread."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.odometry.peers import PEERS, Peer
from wayproof.harness.bench.odometry.sweeps import Sweeps, read_sweeps
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.estimators.surface_map import SurfaceMap, thinned
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.models.robots import ROBOTS

Array = NDArray[np.float64]

WORLDS = ("warehouse", "office", "forest", "corridor", "tunnel")
LIDARS = ("own", "ouster-os1-64")
OURS = "lidar"

LEAST_WAY = 3.0
"""Length of a way from which a drift is measured, m."""

MAP_SPACING = 0.1
"""Distance between mapped points of our estimator, m."""


@dataclass(frozen=True)
class DriftRow:
    """Drift of one odometry in one world.

    Attributes:
        world: Name of the world.
        robot: Name of the robot.
        lidar: Its lidar: `own` is ideal; the OS1 rolls and has noise.
        odometry: `lidar` is ours, with inertial sensors or legs; the others have sweeps alone.
        episodes: Number of episodes.
        way_m: Median length of their ways, m.
        drift_percent: Median error at the end by the length of the way.
        worst_percent: Greatest of these.
        largest_m: Greatest error in any episode, m.
        ms: Median processor time of a sweep on one thread, ms.
    """

    world: str
    robot: str
    lidar: str
    odometry: str
    episodes: int
    way_m: float
    drift_percent: float
    worst_percent: float
    largest_m: float
    ms: float


@dataclass(frozen=True)
class Measured:
    """One odometry in one episode.

    Attributes:
        way: Length of the way, m.
        end: Error at the end, m.
        largest: Largest error, m.
        seconds: (n,) processor time of each sweep, s.
    """

    way: float
    end: float
    largest: float
    seconds: Array


def bench_odometry(
    repeats: int, seed: int, progress: Progress, only: str | None = None
) -> list[DriftRow]:
    """Drive `repeats` seeds in each world by each robot and lidar, and register their sweeps.

    Args:
        repeats: Number of seeds.
        seed: The first of them.
        progress: Called with a line about the progress.
        only: Name of a world; None for all.
    """
    rows: list[DriftRow] = []
    for world in WORLDS if only is None else (only,):
        for robot in ROBOTS:
            for lidar in LIDARS:
                progress(f"odometry: {world}, {robot}, {lidar}")
                rows += _rows(world, robot, lidar, range(seed, seed + repeats))
    return rows


def _rows(world: str, robot: str, lidar: str, seeds: range) -> Iterator[DriftRow]:
    measured: dict[str, list[Measured]] = {name: [] for name in (OURS, *PEERS)}
    for seed in seeds:
        sweeps = _driven(world, robot, lidar, seed)
        if sweeps.way < LEAST_WAY:
            continue
        measured[OURS].append(_ours(sweeps))
        for name, peer in PEERS.items():
            rolling = any(ages.any() for ages in sweeps.ages)
            measured[name].append(measure(peer(deskew=rolling), sweeps))
    for name, runs in measured.items():
        if runs:
            yield _row(world, robot, lidar, name, runs)


def _driven(world: str, robot: str, lidar: str, seed: int) -> Sweeps:
    settings = ["estimate.kind=lidar", f"sensors.lidar={lidar}"]
    config = override(Config(world, robot, seed), settings)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episode.mcap"
        run_episode(build(config), path, record="full")
        return read_sweeps(path)


def measure(peer: Peer, sweeps: Sweeps) -> Measured:
    """Run a peer over the sweeps of an episode, from the true pose at its start."""
    positions, seconds = [], []
    T_world_start = sweeps.truths[0]
    for points, ages in zip(sweeps.points, sweeps.ages, strict=True):
        began = time.process_time()
        T_start_base = peer.register(np.ascontiguousarray(points), ages)
        seconds.append(time.process_time() - began)
        positions.append((T_world_start @ T_start_base)[:3, 3])
    return _measured(np.array(positions), sweeps, np.array(seconds))


def _ours(sweeps: Sweeps) -> Measured:
    """Return the estimates of the episode; the time of registering and mapping its sweeps again."""
    config = Config("empty", "drone", 0).estimate
    surfaces, seconds = SurfaceMap(config.voxel, config.held, config.registered_share), []
    for points, inputs in zip(sweeps.points, sweeps.inputs, strict=True):
        placed = points @ inputs.pose.rotation.T + inputs.pose.position
        began = time.process_time()
        surfaces.register(thinned(placed, config.spacing), inputs.pose.position)
        mapped = thinned(placed, MAP_SPACING)
        if not surfaces.contradicts(mapped, inputs.pose.position):
            surfaces.add(mapped, inputs.pose.position)
        seconds.append(time.process_time() - began)
    return _measured(sweeps.estimates, sweeps, np.array(seconds))


def _measured(positions: Array, sweeps: Sweeps, seconds: Array) -> Measured:
    errors = np.linalg.norm(positions - sweeps.truths[:, :3, 3], axis=1)
    errors = np.where(np.isfinite(errors), errors, np.inf)  # an odometry that diverged
    return Measured(sweeps.way, float(errors[-1]), float(errors.max()), seconds)


def _row(world: str, robot: str, lidar: str, name: str, runs: list[Measured]) -> DriftRow:
    drifts = [100.0 * run.end / run.way for run in runs]
    return DriftRow(
        world=world,
        robot=robot,
        lidar=lidar,
        odometry=name,
        episodes=len(runs),
        way_m=float(np.median([run.way for run in runs])),
        drift_percent=float(np.median(drifts)),
        worst_percent=max(drifts),
        largest_m=max(run.largest for run in runs),
        ms=1e3 * float(np.median(np.concatenate([run.seconds for run in runs]))),
    )
