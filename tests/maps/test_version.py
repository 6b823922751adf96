import numpy as np

from maps import MapConfig, VoxelMap

LOW, HIGH = (0.0, 0.0, -0.2), (4.0, 3.0, 2.0)


def make(low=LOW, high=HIGH, **settings):
    return VoxelMap(MapConfig(half_life=0.0, **settings), low, high)


def sweep(voxel_map, seed, time_ns=0):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(300, 3000, 200).astype(np.uint16)
    voxel_map.integrate((2.0, 1.5, 0.9), directions, ranges_mm, 3.0, time_ns)


def test_it_is_32_hex_digits_and_repeats():
    voxel_map = make()
    assert len(voxel_map.version()) == 32
    assert int(voxel_map.version(), 16) > 0
    assert voxel_map.version() == make().version()


def test_asking_in_between_changes_nothing():
    asked, silent = make(), make()
    for seed in range(4):
        sweep(asked, seed)
        sweep(silent, seed)
        asked.version()
    assert asked.version() == silent.version()


def test_every_cell_counts():
    voxel_map = make(high=(0.5, 0.4, 0.3))
    versions = {voxel_map.version()}
    for x, y, z in np.ndindex(voxel_map.shape):
        low = voxel_map.origin + (np.array([x, y, z]) + 0.4) * 0.1
        voxel_map.mark_free(low, low + 0.02, 0)
        versions.add(voxel_map.version())
    assert len(versions) == 1 + voxel_map.log_odds.size


def test_equal_content_has_equal_versions_whatever_the_history():
    straight, detour = make(), make()
    for _ in range(9):
        straight.mark_free((1.0, 1.0, 0.5), (1.5, 1.5, 1.0), 0)
    for k in range(20):  # the same cells reach the same clamp, later and after other times
        detour.mark_free((1.0, 1.0, 0.5), (1.5, 1.5, 1.0), 7 * k)
        detour.version()
    assert straight.version() == detour.version()


def test_a_block_that_is_empty_again_is_as_one_never_touched():
    config = MapConfig(half_life=1.0)
    faded = VoxelMap(config, LOW, HIGH)
    sweep(faded, 1)
    used = faded.version()
    faded.advance(100 * 10**9)
    assert faded.version() == VoxelMap(config, LOW, HIGH).version() != used


def test_geometry_counts():
    maps = [
        make(),
        make(low=(0.1, 0.0, -0.2)),
        make(high=(4.1, 3.0, 2.0)),
        make(resolution=0.2, high=(8.0, 6.0, 4.0)),
    ]
    assert len({voxel_map.version() for voxel_map in maps}) == len(maps)


def test_negative_zero_is_zero():
    assert make(low=(-0.0, 0.0, -0.2)).version() == make().version()


def test_uniform_runs_of_cells_are_told_from_others():
    """One run along z is packed by its value alone: two such contents must still differ."""
    column, cell = make(), make()
    column.mark_free((1.0, 1.0, -9.0), (1.1, 1.1, 9.0), 0)
    cell.mark_free((1.0, 1.0, 0.0), (1.1, 1.1, 0.1), 0)
    assert len({column.version(), cell.version(), make().version()}) == 3
