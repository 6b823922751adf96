"""The kernels of the maps in blocks: compiled, as plain Python and under bounds checks."""

import os
import subprocess
import sys

from tests.sharing import checked_kernels

EPISODE = """
import numpy as np
from wayproof.maps import Costmap, Grid2D, MapConfig, TsdfMap
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
    box = (0, 0, -0.3), (2.1, 1.8, 0.9)
    costmap = Costmap(config, block_map, *box, "ground", 0.1, 0.5, 0.15)
    print(int(costmap.clearance.sum()), int(costmap.obstacle_clearance.sum()))
"""

WARM = """
import numba
import numpy
from wayproof.maps import warm_up
from wayproof.maps.kernels import blocks as _block_kernels
from wayproof.maps.kernels import grid2d as _grid2d_kernels
from wayproof.maps.kernels import tsdf as _tsdf_kernels
modules = (_block_kernels, _grid2d_kernels, _tsdf_kernels)
kernels = {
    f"{module.__name__}.{name}": kernel
    for module in modules
    for name, kernel in vars(module).items()
    if isinstance(kernel, numba.core.dispatcher.Dispatcher)
}
def compiled():
    return {name: len(kernel.signatures) for name, kernel in kernels.items()}
warm_up("grid2d")
warm_up("tsdf")
before = compiled()
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


def test_compiled_interpreted_and_bounds_checked_runs_agree(common):
    compiled = run(EPISODE)
    assert compiled.count("occupied") == 2
    assert run(EPISODE, NUMBA_DISABLE_JIT="1") == compiled
    with checked_kernels(common) as environment:
        assert run(EPISODE, **environment) == compiled


def test_nothing_is_compiled_after_the_warm_up():
    result = run(WARM + EPISODE + "print(compiled() == before, sum(before.values()))")
    same, count = result.splitlines()[-1].split()
    assert same == "True"
    assert int(count) >= 5  # those called from Python, at the least
