"""Each kernel compiled, as plain Python and in naive numpy; the whole under bounds checks."""

import os
import subprocess
import sys

import numpy as np
import pytest

from maps import _field_kernels as fields

EPISODE = """
import numpy as np
from maps import Costmap, MapConfig, VoxelMap, Window
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
parts += [voxel_map.probability_at([[1, 1, 0.3]]), voxel_map.cast_ray((1, 1, 0.5), (1, 2, 3), 2)]
window = Window(voxel_map, (0, 0, -0.3), (2.1, 1.8, 0.9))
for motion in ("ground", "air"):
    costmap = Costmap(config, window, motion, 0.1, 0.5, 0.15)
    parts += [int(costmap.clearance.sum()), int(costmap.obstacle_clearance.sum())]
print(*parts)
"""


def run_episode(script=EPISODE, **environment):
    result = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return result.stdout


def test_compiled_interpreted_and_bounds_checked_runs_agree(tmp_path):
    compiled = run_episode()
    assert "occupied" in compiled
    assert run_episode(NUMBA_DISABLE_JIT="1") == compiled
    checked = run_episode(NUMBA_BOUNDSCHECK="1", NUMBA_CACHE_DIR=str(tmp_path))
    assert checked == compiled


WARM = """
import numba
from maps import _beam_kernels, _brick_kernels, _decay_kernels, _field_kernels, warm_up
from maps import _update_kernels
def compiled():
    modules = (_beam_kernels, _brick_kernels, _decay_kernels, _field_kernels, _update_kernels)
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


def both(kernel):
    return pytest.mark.parametrize("run", [kernel, kernel.py_func], ids=["compiled", "python"])


def random_log_odds(shape, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.integers(-60, 105, shape) * (rng.random(shape) < 0.6)).astype(np.int16)


@both(fields.project_columns)
def test_project_columns(run):
    log_odds = np.sign(random_log_odds((40, 30, 6), seed=8)).astype(np.int16)
    log_odds[:, :, 0] *= np.random.default_rng(9).random((40, 30)) < 0.2
    states = np.empty((40, 30, 1), np.uint8)
    run(log_odds, 1, 3, 5, states)
    blocked = (log_odds[:, :, :1] < 0).any(axis=2) | (log_odds[:, :, 3:5] > 0).any(axis=2)
    supported = (log_odds[:, :, 1:3] > 0).any(axis=2)
    clear = (log_odds[:, :, 3:5] < 0).all(axis=2)
    expected = np.where(blocked, 2, np.where(clear & supported, 1, 0))
    assert {*np.unique(expected)} == {0, 1, 2}
    np.testing.assert_array_equal(states[:, :, 0], expected)


@both(fields.squared_distances)
@pytest.mark.parametrize("shape", [(9, 7, 5), (1, 12, 8), (3, 1, 4)])
@pytest.mark.parametrize("reach", [1, 3, 20])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
def test_squared_distances(run, shape, reach, share):
    blocked = np.random.default_rng(6).random(shape) < share
    scratch, squared = np.empty(shape, np.uint16), np.empty(shape, np.uint16)
    run(blocked, reach, scratch, squared)
    frame = [(0, 0) if size == 1 else (1, 1) for size in shape]  # one cell is no axis
    targets = np.argwhere(np.pad(blocked, frame, constant_values=True))
    cells = np.argwhere(np.ones(shape)) + [before for before, _ in frame]
    exact = ((cells[:, None] - targets[None]) ** 2).sum(axis=2).min(axis=1).reshape(shape)
    np.testing.assert_array_equal(squared, np.minimum(exact, reach * reach))


@both(fields.lower)
def test_lower(run):
    target, source = np.array([9, 5, 0], np.uint16), np.array([1, 1, 0], np.uint16)
    run(target, source, 4)
    assert target.tolist() == [5, 5, 0]
