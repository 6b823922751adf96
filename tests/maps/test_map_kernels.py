"""Each kernel compiled, as plain Python and in naive numpy; the whole under bounds checks."""

import os
import subprocess
import sys

import numpy as np
import pytest

from maps import _field_kernels as fields
from maps import _voxel_kernels as kernels

EPISODE = """
import numpy as np
from maps import Costmap, MapConfig, VoxelMap
rng = np.random.default_rng(1)
voxel_map = VoxelMap(MapConfig(), (0, 0, -0.3), (2.1, 1.8, 0.9))
for k in range(3):
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(200, 2600, 40).astype(np.uint16)
    voxel_map.integrate((k - 0.5, 0.9, 0.4), directions, ranges_mm, 2.5, k * 10**9)
voxel_map.mark_free_sphere((1, 1, 0.5), 0.3, 3 * 10**9)
parts = [voxel_map.version(), voxel_map.observed_ns_at([[1, 1, 0.3]]), voxel_map.counts()]
for motion in ("ground", "air"):
    costmap = Costmap(MapConfig(), voxel_map, motion, 0.1, 0.5, 0.15)
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
from maps import _field_kernels, _voxel_kernels, warm_up
def compiled():
    names = [(module, name) for module in (_field_kernels, _voxel_kernels) for name in vars(module)]
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
    return (rng.integers(-1992, 3477, shape) * (rng.random(shape) < 0.6)).astype(np.int16)


SHAPE = (18, 5, 33)  # two by one by three blocks
BLOCKS = (2, 1, 3)
ALL_BLOCKS = np.array([[0, 0, 0], BLOCKS])


def blocks_of(cells):
    """Whether any cell is set in each block."""
    return np.array(
        [
            cells[x * 16 : x * 16 + 16, y * 16 : y * 16 + 16, z * 16 : z * 16 + 16].any()
            for x, y, z in np.ndindex(BLOCKS)
        ]
    ).reshape(BLOCKS)


@both(kernels.apply_marks)
def test_apply_marks(run):
    rng = np.random.default_rng(4)
    old = random_log_odds(SHAPE)
    marks = rng.integers(0, 8, SHAPE).astype(np.uint8)
    marks[:, :, 16:32] &= 4  # a layer of blocks that only holds fresh cells
    bits = marks.copy()
    log_odds = old.copy()
    observed_ns = np.full(BLOCKS, 5)
    dirty, alive = np.zeros(BLOCKS, bool), np.zeros(BLOCKS, bool)
    steps = np.array([900, 400, -1992, 3476], np.int32)
    total = run(log_odds, bits, steps, ALL_BLOCKS, 7, observed_ns, dirty, alive)

    wide = old.astype(int)
    crossed = np.where(marks & 1, np.maximum(wide - 400, -1992), wide)
    expected = np.where(marks & 2, np.minimum(wide + 900, 3476), crossed)
    np.testing.assert_array_equal(log_odds, expected)
    np.testing.assert_array_equal(bits, np.where(marks & 3, 4, marks & 4))
    assert total == np.count_nonzero(marks & 3)
    seen = blocks_of(marks & 3)
    np.testing.assert_array_equal(observed_ns, np.where(seen, 7, 5))
    np.testing.assert_array_equal(dirty, blocks_of(expected != old))
    np.testing.assert_array_equal(alive, seen & blocks_of(expected))


@both(kernels.decay_cells)
@pytest.mark.parametrize("factor", [0, 32768, 64039, 65535])
def test_decay_cells(run, factor):
    old = random_log_odds(SHAPE)
    old[:16, :, 16:32] = 0
    old[:16, 0, 16] = 1
    marks = np.random.default_rng(4).choice([0, 4], SHAPE).astype(np.uint8)
    log_odds, bits = old.copy(), marks.copy()
    dirty, alive = np.zeros(BLOCKS, bool), blocks_of(old)
    run(log_odds, bits, factor, dirty, alive)

    faded = np.trunc(old * (factor / 65536)).astype(int)
    expected = np.where(marks & 4, old, faded)
    np.testing.assert_array_equal(log_odds, expected)
    assert not bits.any()
    np.testing.assert_array_equal(dirty, blocks_of(expected != old))
    np.testing.assert_array_equal(alive, blocks_of(expected))


@both(kernels.cell_states)
def test_cell_states(run):
    log_odds = random_log_odds(500)
    states = np.empty(500, np.uint8)
    run(log_odds, states)
    np.testing.assert_array_equal(states, np.choose(np.sign(log_odds) + 1, [1, 0, 2]))


@both(kernels.pack_blocks)
def test_pack_blocks_can_be_unpacked(run):
    log_odds = random_log_odds(SHAPE)
    log_odds[2:, 1:4] = 0
    log_odds[4, 2, :16] = -1992
    blocks = np.argwhere(np.ones(BLOCKS))
    packed, ends = np.empty(len(blocks) * 17 * 256, np.int16), np.empty(len(blocks), np.int64)
    run(log_odds, blocks, packed, ends)

    restored = np.empty_like(log_odds)
    words = iter(packed[: ends[-1]].tolist())
    for bx, by, bz in blocks.tolist():
        block = restored[bx * 16 : bx * 16 + 16, by * 16 : by * 16 + 16, bz * 16 : bz * 16 + 16]
        for x, y in np.ndindex(block.shape[:2]):
            uniform = next(words)
            block[x, y] = next(words) if uniform else [next(words) for _ in block[x, y]]
    assert next(words, None) is None
    np.testing.assert_array_equal(restored, log_odds)
    assert ends[-1] < log_odds.size


@both(kernels.place_beams)
def test_place_beams(run):
    directions = np.repeat([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], 3, axis=0)
    ranges_mm = np.array([0, 100, 1000, 65535, 2001, 2000], np.uint16)
    marks, ends = np.zeros((20, 4, 4), np.uint8), np.zeros((6, 3), np.int64)
    fates = np.full(6, 9, np.uint8)
    origin = np.array([0.05, 0.15, 0.25])
    run(origin, directions, ranges_mm, 300, 2000, 0.1, marks, ends, fates)
    assert fates.tolist() == [2, 3, 0, 1, 1, 0]
    # 512 sub-cells of 0.1 m: 1.05 m is 5376, -1.75 m is -8960.
    assert ends[2].tolist() == [5376, 768, 1280]
    assert ends[3:].tolist() == [[256, 768, -8960]] * 3
    assert np.argwhere(marks).tolist() == [[10, 1, 2]]  # the last return lies outside


@both(kernels.cross_beams)
def test_cross_beams_skips_what_tells_nothing(run):
    marks = np.zeros((6, 1, 1), np.uint8)
    ends = np.array([[5 * 512, 0, 0], [3 * 512, 0, 0], [2 * 512, 0, 0], [512, 0, 0]])
    run(marks, np.zeros(3, np.int64), ends, np.array([2, 0, 1, 3], np.uint8), 99)
    assert marks.ravel().tolist() == [1, 1, 1, 0, 0, 0]


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
