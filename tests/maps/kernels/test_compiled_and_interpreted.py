"""All kernels in short episodes of every map: compiled, as plain Python, and bounds-checked."""

import os
import subprocess
import sys

import pytest

VOXEL_MAP = """
import zlib
import numpy as np
from wayproof.maps import Costmap, CostmapConfig, MapConfig, VoxelMap
rng = np.random.default_rng(1)
config = MapConfig(memory_mib=1)
voxel_map = VoxelMap(config)
for k in range(3):
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(200, 2600, 40).astype(np.uint16)
    voxel_map.integrate((k - 0.5, 0.9, 0.4), directions, ranges_mm, 1.5, k * 4 * 10**8)
voxel_map.mark_free_sphere((1, 1, 0.5), 0.3, 12 * 10**8)
print(voxel_map.version(), voxel_map.observed_ns_at([[1, 1, 0.3]]), voxel_map.counts())
box = (0, 0, -0.3), (1.2, 1.0, 0.7)
def fields(motion, **config):
    costmap = Costmap(CostmapConfig(**config), voxel_map, *box, motion, 0.1, 0.5, 0.15)
    fields = costmap.state, costmap.clearance, costmap.obstacle_clearance
    return [zlib.crc32(field.tobytes()) for field in fields]
print(fields("ground"), fields("air"))
"""

VOXEL_QUERIES = """
print(fields("ground", max_slope=0.3))
print(voxel_map.probability_at([[1, 1, 0.3]]), voxel_map.cast_ray((1, 1, 0.5), (1, 2, 3), 2))
"""

BLOCK_MAPS = """
import numpy as np
from wayproof.maps import Costmap, CostmapConfig, Grid2D, MapConfig, TsdfMap
rng = np.random.default_rng(1)
config = MapConfig(memory_mib=1)
for make in (Grid2D, TsdfMap):
    block_map = make(config)
    for k in range(3):
        directions = rng.normal(size=(40, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        ranges_mm = rng.integers(200, 2600, 40).astype(np.uint16)
        block_map.integrate((k - 0.5, 0.9, 0.4), directions, ranges_mm, 1.5, k * 10**9)
    block_map.mark_free((0, 0, 0), (1, 1, 0.5), 3 * 10**9)
    block_map.mark_floor((0, 0), (1, 1), 3 * 10**9)
    block_map.advance(60 * 10**9)
    print(block_map.version(), block_map.counts(), block_map.probability_at([[1, 1, 0.3]]))
    box = (0, 0, -0.3), (1.2, 1.0, 0.7)
    costmap = Costmap(CostmapConfig(), block_map, *box, "ground", 0.1, 0.5, 0.15)
    print(int(costmap.clearance.sum()), int(costmap.obstacle_clearance.sum()))
"""

CHECKED = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_OPT": "0"}
"""Kernels with bounds checks, not optimised: that takes a third of the time and changes no bit."""

COUNT_COMPILED = """
import importlib, pkgutil
from numba.core.dispatcher import Dispatcher
from wayproof.maps import kernels, warm_up
modules = [
    importlib.import_module(f"{kernels.__name__}.{module.name}")
    for module in pkgutil.iter_modules(kernels.__path__)
]
values = [value for module in modules for value in vars(module).values()]
dispatchers = {value for value in values if isinstance(value, Dispatcher)}
def signatures():
    return sum(len(kernel.signatures) for kernel in dispatchers)
counts = [signatures()]
"""


def run(script, **environment):
    result = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return result.stdout


CASES = pytest.mark.parametrize(
    ("maps", "script", "queries"),
    [(("voxel",), VOXEL_MAP, VOXEL_QUERIES), (("grid2d", "tsdf"), BLOCK_MAPS, "")],
    ids=["voxel", "block"],
)


@CASES
def test_interpreted_runs_agree_and_nothing_is_compiled_after_the_warm_up(maps, script, queries):
    warm_up = "".join(f"warm_up({name!r})\ncounts.append(signatures())\n" for name in maps)
    counted = f"{COUNT_COMPILED}{warm_up}{script}counts.append(signatures())\n{queries}"
    lines = run(counted + "print(*counts)").splitlines()
    *counts, last = map(int, lines.pop().split())
    assert counts[0] < counts[1]  # the warm-up compiles something
    assert last == counts[-1]  # and all there is to compile
    assert "occupied" in "".join(lines)
    assert run(script + queries, NUMBA_DISABLE_JIT="1").splitlines() == lines


@pytest.mark.large
@CASES
def test_runs_with_bounds_checks_agree(tmp_path, maps, script, queries):
    """Without compiling, Python checks most of these bounds as well."""
    whole = script + queries
    assert run(whole, **CHECKED, NUMBA_CACHE_DIR=str(tmp_path)) == run(whole)
