import numpy as np

from tests.maps.sweeps import scattered
from wayproof.maps import MapConfig, VoxelMap


def make(**settings):
    return VoxelMap(MapConfig(**({"half_life": 0.0} | settings)))


def sweep(voxel_map, seed, time_ns=0):
    rng = np.random.default_rng(seed)
    directions, ranges_mm = scattered(rng, 200, 300, 3000)
    voxel_map.integrate((2.0, 1.5, 0.9), directions, ranges_mm, 3.0, time_ns)


def test_a_version_in_between_changes_nothing():
    queried, silent = make(), make()
    for seed in range(4):
        sweep(queried, seed)
        sweep(silent, seed)
        queried.version()
    assert queried.version() == silent.version()


def test_every_cell_counts():
    voxel_map = make()
    versions = {voxel_map.version()}
    for x, y, z in np.ndindex(5, 4, 70):
        low = (np.array([x, y, z - 5.0]) + 0.4) * 0.1 - [0.0, 0.0, 0.075]
        voxel_map.mark_free(low, low + 0.02, 0)
        versions.add(voxel_map.version())
    assert len(versions) == 1 + 5 * 4 * 70
    assert voxel_map.counts()["free"] == 5 * 4 * 70


def test_equal_content_has_equal_versions_whatever_the_history():
    straight, detour = make(), make()
    for _ in range(9):
        straight.mark_free((1.0, 1.0, 0.5), (1.5, 1.5, 1.0), 0)
    for k in range(20):  # the same cells reach the same clamp, later and after other times
        detour.mark_free((1.0, 1.0, 0.5), (1.5, 1.5, 1.0), 7 * k)
        detour.version()
    assert straight.version() == detour.version()


def test_what_is_all_unknown_again_is_as_if_never_touched():
    faded = make(half_life=1.0)
    sweep(faded, 1)
    used = faded.version()
    faded.advance(100 * 10**9)
    assert faded.version() == make(half_life=1.0).version() != used
    risen = make()
    for _ in range(4):
        risen.mark_floor((0.0, 0.0), (0.1, 0.1), 0)  # 4 hits are 108 units, at the clamp of 104
    before = risen.version()
    assert before != make().version()
    even = make(log_odds_hit=0.4, log_odds_miss=0.4)
    beam = np.array([[1.0, 0.0, 0.0]])
    for k in (500, 600, 400):  # the cells up to 0.4 m are lowered three times
        even.integrate((0.05, 0.05, 0.5), beam, np.array([k], np.uint16), 1.0, 0)
    assert even.version() != make(log_odds_hit=0.4, log_odds_miss=0.4).version()


def test_resolution_and_units_count():
    voxel_maps = [make(), make(resolution=0.2), make(log_odds_hit=0.85)]
    for voxel_map in voxel_maps:
        voxel_map.mark_free((0.0, 0.0, 0.1), (0.2, 0.2, 0.3), 0)
    assert len({voxel_map.version() for voxel_map in voxel_maps}) == 3
