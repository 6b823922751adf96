"""Each kernel compiled, as plain Python and in naive numpy; the whole under bounds checks."""

import os
import subprocess
import sys

from tests.sharing import checked_kernels

EPISODE = """
import numpy as np
from wayproof.maps import Costmap, MapConfig, VoxelMap, inflate
rng = np.random.default_rng(1)
config = MapConfig(memory_mib=1)
voxel_map = VoxelMap(config)
for k in range(3):
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(200, 2600, 40).astype(np.uint16)
    voxel_map.integrate((k - 0.5, 0.9, 0.4), directions, ranges_mm, 1.5, k * 10**9)
voxel_map.mark_free_sphere((1, 1, 0.5), 0.3, 3 * 10**9)
parts = [voxel_map.version(), voxel_map.observed_ns_at([[1, 1, 0.3]]), voxel_map.counts()]
box = (0, 0, -0.3), (2.1, 1.8, 0.9)
for motion in ("ground", "air"):
    costmap = Costmap(config, voxel_map, *box, motion, 0.1, 0.5, 0.15)
    parts += [int(costmap.clearance.sum()), int(costmap.obstacle_clearance.sum())]
print(*parts)
"""
QUERIES = """
print(voxel_map.probability_at([[1, 1, 0.3]]), voxel_map.cast_ray((1, 1, 0.5), (1, 2, 3), 2))
"""


def run_episode(script=EPISODE + QUERIES, **environment):
    result = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return result.stdout


def test_compiled_interpreted_and_bounds_checked_runs_agree(common):
    compiled = run_episode()
    assert "occupied" in compiled
    assert run_episode(NUMBA_DISABLE_JIT="1") == compiled
    with checked_kernels(common) as environment:
        assert run_episode(**environment) == compiled


WARM = """
import numba
from wayproof.maps.kernels import beams as _beam_kernels
from wayproof.maps.kernels import bricks as _brick_kernels
from wayproof.maps.kernels import columns as _column_kernels
from wayproof.maps.kernels import decay as _decay_kernels
from wayproof.maps.kernels import distance_field as _field_kernels
from wayproof.maps.kernels import carve as _carve_kernels
from wayproof.maps.kernels import inflation as _inflation_kernels
from wayproof.maps.kernels import update as _update_kernels
from wayproof.maps import warm_up
from wayproof.maps.kernels import lazy_distances as _wanted_kernels
def compiled():
    modules = (_beam_kernels, _brick_kernels, _column_kernels, _decay_kernels, _field_kernels)
    modules += (_carve_kernels, _inflation_kernels, _update_kernels, _wanted_kernels)
    names = [(module, name) for module in modules for name in vars(module)]
    kernels = {f"{name}": getattr(module, name) for module, name in names}
    return {
        name: len(kernel.signatures)
        for name, kernel in kernels.items()
        if isinstance(kernel, numba.core.dispatcher.Dispatcher)
    }
warm_up()
before = compiled()
"""


def test_nothing_is_compiled_after_the_warm_up():
    script = WARM + EPISODE.replace(
        "print(*parts)", "print(compiled() == before, *before.values())"
    )
    result = run_episode(script)
    same, *counts = result.split()
    assert same == "True"
    # Those called from Python; the ones that kernels call count none when they come from the cache.
    assert len(counts) - counts.count("0") >= 8
