import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import MapConfig, VoxelMap


def filled(**settings):
    voxel_map = VoxelMap(MapConfig(memory_mib=4, **settings))
    rng = np.random.default_rng(0)
    for k in range(5):
        directions, ranges_mm = scattered(rng, 50, 300, 3000)
        voxel_map.integrate(rng.uniform(-1, 1, 3), directions, ranges_mm, 4.0, k * 10**9)
    return voxel_map


@pytest.mark.parametrize("settings", [{}, {"half_life": 0.0, "resolution": 0.2}])
def test_a_map_comes_back_as_it_was(tmp_path, settings):
    voxel_map = filled(**settings)
    voxel_map.save(tmp_path / "map")
    loaded = VoxelMap.load(tmp_path / "map")
    assert loaded.config == voxel_map.config
    for later in (0, 5, 50):
        for one in (voxel_map, loaded):
            one.advance((5 + later) * 10**9)
        assert loaded.version() == voxel_map.version()
        assert loaded.counts() == voxel_map.counts()
        points = np.random.default_rng(1).uniform(-2, 2, (200, 3))
        assert np.array_equal(loaded.probability_at(points), voxel_map.probability_at(points))
        assert np.array_equal(loaded.observed_ns_at(points), voxel_map.observed_ns_at(points))
        window = (-60, -60, -40), (120, 120, 2)
        np.testing.assert_array_equal(loaded.columns(*window), voxel_map.columns(*window))
    assert [path.name for path in tmp_path.iterdir()] == ["map"]


def test_a_map_that_was_read_looks_at_its_region_alone(tmp_path):
    filled().save(tmp_path / "map")
    loaded = VoxelMap.load(tmp_path / "map", low=(-1.0, -1.0, -0.5), high=(6.0, 1.0, 0.5))
    held = filled()
    assert loaded.version() == held.version()  # what was held stays
    beams, ranges_mm = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), np.full(2, 9000, np.uint16)
    for one in (loaded, held):
        one.integrate((0.05, 0.05, 0.05), beams, ranges_mm, 10.0, 4 * 10**9)
    ends = np.array([[0.05, 9.05, 0.05], [4.55, 0.05, 0.05]])
    assert held.state_at(ends).tolist() == [2, 1]
    assert loaded.state_at(ends).tolist() == [0, 1]
    with pytest.raises(ValueError, match="both corners or neither"):
        VoxelMap.load(tmp_path / "map", low=(0.0, 0.0, 0.0))


def test_equal_maps_give_equal_files(tmp_path):
    for name in ("a", "b"):
        filled().save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_empty_map_can_be_saved(tmp_path):
    VoxelMap(MapConfig()).save(tmp_path / "map")
    assert VoxelMap.load(tmp_path / "map").counts() == {"free": 0, "occupied": 0}


@pytest.mark.parametrize("at", [0, 20, 400, -1])
def test_a_changed_byte_is_found(tmp_path, at):
    filled().save(tmp_path / "map")
    data = bytearray((tmp_path / "map").read_bytes())
    data[at] ^= 0x40
    (tmp_path / "map").write_bytes(data)
    with pytest.raises(ValueError, match=r"map: (no voxel map|got|the checksum)"):
        VoxelMap.load(tmp_path / "map")


@pytest.mark.parametrize("size", [0, 25, 30000])
def test_a_cut_file_is_found(tmp_path, size):
    filled().save(tmp_path / "map")
    data = (tmp_path / "map").read_bytes()
    assert len(data) > 30000
    (tmp_path / "map").write_bytes(data[:size])
    with pytest.raises(ValueError, match=r"map: (no voxel map|got)"):
        VoxelMap.load(tmp_path / "map")
    (tmp_path / "map").write_bytes(data + b"x")
    with pytest.raises(ValueError, match="map: got"):
        VoxelMap.load(tmp_path / "map")


def test_a_foreign_file_is_refused(tmp_path):
    (tmp_path / "map").write_bytes(b"\x89PNG" * 1000)
    with pytest.raises(ValueError, match="map: no voxel map of this version"):
        VoxelMap.load(tmp_path / "map")


def test_a_file_that_cannot_be_written_leaves_none(tmp_path):
    (tmp_path / "map").mkdir()
    with pytest.raises(OSError, match="map"):
        filled().save(tmp_path / "map")
    assert [path.name for path in tmp_path.iterdir()] == ["map"]
