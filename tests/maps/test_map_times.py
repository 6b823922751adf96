"""Prints the table of times of docs/representations.md when run with -s."""

import time

import numpy as np
import pytest

from wayproof.maps import MAPS, MapConfig, warm_up

LOW, HIGH = np.array([-10.0, -10.0, 0.0]), np.array([10.0, 10.0, 3.0])
KINDS = "voxel", "grid2d", "tsdf", "dynamic"


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    for kind in KINDS:
        warm_up(kind)


@pytest.mark.parametrize(("resolution", "beams"), [(0.1, 20_000), (0.1, 100_000), (0.05, 20_000)])
def test_table_of_processor_times(resolution, beams):
    """Of a sweep in a room, and of the version after it, on one thread, in turn; medians."""
    sweeps = 6
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(beams, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    maps = {}
    for kind in KINDS:
        maps[kind] = MAPS[kind](MapConfig(kind=kind, resolution=resolution))
    times = {kind: ([], []) for kind in KINDS}
    for k in range(sweeps):
        origin = np.array([0.3 * k - 2.0, 0.1, 1.0])
        to_wall = np.where(directions > 0, HIGH - origin, LOW - origin) / directions
        ranges_mm = np.rint(np.minimum(to_wall.min(axis=1), 13.0) * 1000).astype(np.uint16)
        told = set()
        for kind, a_map in maps.items():
            began = time.process_time()
            told.add(a_map.integrate(origin, directions, ranges_mm, 12.0, k * 10**8).hits)
            between = time.process_time()
            a_map.version()
            times[kind][0].append(between - began)
            times[kind][1].append(time.process_time() - between)
        assert len(told) == 1
    sweep, version = (
        [f"{1000 * float(np.median(times[kind][part][1:])):.1f}" for kind in KINDS]
        for part in range(2)
    )
    print(f"| {resolution:g} | {beams:,} | sweep, ms | {' | '.join(sweep)} |")
    print(f"| {resolution:g} | {beams:,} | version, ms | {' | '.join(version)} |")
