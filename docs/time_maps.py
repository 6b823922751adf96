"""Print the table of processor times of docs/maps.md: `python -m docs.time_maps`."""

from __future__ import annotations

import time

import numpy as np

from wayproof.maps import MAPS, MapConfig, warm_up

LOW, HIGH = np.array([-10.0, -10.0, 0.0]), np.array([10.0, 10.0, 3.0])
KINDS = "voxel", "grid2d", "tsdf", "dynamic"
CASES = (0.1, 20_000), (0.1, 100_000), (0.05, 20_000)
"""Edge of a cell, m, and number of beams."""

SWEEPS = 6


def main() -> None:
    """Time each kind in turn on the same sweeps in a room, on one thread."""
    for kind in KINDS:
        warm_up(kind)
    for resolution, beams in CASES:
        for name, medians in zip(("sweep", "version"), times(resolution, beams), strict=True):
            print(f"| {resolution:g} | {beams:,} | {name}, ms | {' | '.join(medians)} |")


def times(resolution: float, beams: int) -> tuple[list[str], list[str]]:
    """Return the median times of a sweep and of the version after it, ms, by kind."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(beams, 3))
    directions /= np.sqrt(np.square(directions).sum(axis=1, keepdims=True))
    maps = [MAPS[kind](MapConfig(kind=kind, resolution=resolution)) for kind in KINDS]
    measured = np.empty((2, len(KINDS), SWEEPS))
    for k in range(SWEEPS):
        origin = np.array([0.3 * k - 2.0, 0.1, 1.0])
        to_wall = np.where(directions > 0, HIGH - origin, LOW - origin) / directions
        ranges_mm = np.rint(np.minimum(to_wall.min(axis=1), 13.0) * 1000).astype(np.uint16)
        for i, a_map in enumerate(maps):
            began = time.process_time()
            a_map.integrate(origin, directions, ranges_mm, 12.0, k * 10**8)
            between = time.process_time()
            a_map.version()
            measured[:, i, k] = between - began, time.process_time() - between
    sweep, version = 1000.0 * np.median(measured[:, :, 1:], axis=2)  # the first one opens bricks
    return [f"{ms:.1f}" for ms in sweep], [f"{ms:.1f}" for ms in version]


if __name__ == "__main__":
    main()
