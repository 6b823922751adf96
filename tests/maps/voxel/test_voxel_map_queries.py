import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, MapConfig, VoxelMap, states_in
from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.slot_pool import EVERYWHERE

EYE = (0.55, 1.05, 0.475)


@pytest.fixture
def voxel_map():
    """One beam of 2 m along x, at the height of the eye."""
    voxel_map = VoxelMap(MapConfig(half_life=0.0, memory_mib=4))
    beam, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([2000], np.uint16)
    voxel_map.integrate(EYE, beam, ranges_mm, 3.0, 0)
    return voxel_map


def test_a_ray_ends_at_the_first_occupied_cell(voxel_map):
    end = voxel_map.cast_ray(EYE, (3.0, 0.0, 0.0), 9.0)
    assert end.state == OCCUPIED
    assert end.distance == pytest.approx(1.95)
    np.testing.assert_allclose(end.point, [2.5, 1.05, 0.475])
    assert voxel_map.cast_ray(EYE, (1.0, 0.0, 0.0), 1.94) is None
    assert voxel_map.cast_ray((0.55, 1.25, 0.475), (1.0, 0.0, 0.0), 9.0) is None
    back = voxel_map.cast_ray((4.0, 1.05, 0.475), (-1.0, 0.0, 0.0), 9.0)
    np.testing.assert_allclose(back.point, [2.6, 1.05, 0.475])


def test_a_ray_can_end_at_the_first_unknown_cell(voxel_map):
    end = voxel_map.cast_ray(EYE, (0.0, 1.0, 0.0), 9.0, stop_at_unknown=True)
    assert end.state == UNKNOWN
    assert end.distance == pytest.approx(0.05)
    assert voxel_map.cast_ray(EYE, (0.0, 1.0, 0.0), 9.0) is None
    start = voxel_map.cast_ray((0.0, 0.0, 9.0), (0.0, 0.0, 1.0), 1.0, stop_at_unknown=True)
    assert start.distance == 0.0


def test_rays_meet_what_dense_steps_meet():
    rng = np.random.default_rng(4)
    voxel_map = VoxelMap(MapConfig(half_life=0.0, memory_mib=16))
    for k in range(4):
        directions, ranges_mm = scattered(rng, 400, 400, 3000)
        voxel_map.integrate(rng.uniform(-0.5, 0.5, 3), directions, ranges_mm, 4.0, k)
    found = 0
    for unknown in (False, True):
        for _ in range(40):
            origin, direction = rng.uniform(-1, 1, 3), rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            end = voxel_map.cast_ray(origin, direction, 3.0, unknown)
            reach = 3.0 if end is None else end.distance
            steps = np.arange(0.0, reach - 1e-4, 1e-3)
            states = voxel_map.state_at(origin + steps[:, None] * direction)
            assert not np.any(states == OCCUPIED)
            assert not (unknown and np.any(states == UNKNOWN))
            if end is not None and end.distance > 0.0:
                beyond = voxel_map.state_at([origin + (end.distance + 1e-6) * direction])
                assert beyond[0] == end.state
                found += 1
    assert found > 20


@pytest.mark.parametrize(
    ("origin", "direction", "reach"),
    [
        ((np.nan, 0, 0), (1, 0, 0), 1.0),
        (EYE, (0, 0, 0), 1.0),
        (EYE, (np.inf, 0, 0), 1.0),
        (EYE, (1, 0, 0), 0.0),
        (EYE, (1, 0, 0), np.nan),
    ],
)
def test_a_bad_ray_is_refused(voxel_map, origin, direction, reach):
    with pytest.raises(ValueError, match=r"^(origin|direction|ray): got"):
        voxel_map.cast_ray(origin, direction, reach)


def test_a_box_has_the_states_of_its_cells(voxel_map):
    states = states_in(voxel_map, (2.3, 1.0, 0.4), (2.7, 1.2, 0.6))
    assert states.shape == (4, 2, 2)
    assert states[:, 0, 0].tolist() == [FREE, FREE, OCCUPIED, UNKNOWN]
    assert not states[:, 1].any()


@pytest.mark.parametrize("run", ["compiled", "python"])
@pytest.mark.parametrize("low", [(-7, -16, -2), (3, 5, 11)])
def test_columns_written_where_they_changed_are_those_written_whole(run, low, monkeypatch):
    if run == "python":
        for name in ("rewrite_columns", "write_block", "find", "column_states"):
            monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    rng = np.random.default_rng(9)
    voxel_map = VoxelMap(MapConfig(half_life=1.0, memory_mib=4))
    occupied, free = np.zeros((2, 37, 40, 1), np.uint64)
    cells = np.stack(np.indices((37, 40, 64)), axis=-1).reshape(-1, 3) + np.array(low)
    points = (cells + np.array([0.5, 0.5, -0.25])) * 0.1
    stamp, wholes = 0, set()
    for k in range(8):
        directions, ranges_mm = scattered(rng, 60, 300, 3000)
        if k < 5:
            origin = (0.5 + k, 1.5, 0.9)
            voxel_map.integrate(origin, directions, ranges_mm, 2.0, k * 10**9)
        else:  # some bricks are forgotten, then all
            voxel_map.advance(k * 3 * 10**9)
        boxes, stamp = voxel_map.changed(stamp)
        with np.errstate(over="ignore"):
            voxel_map.rewrite_columns(low, boxes, occupied, free)
        states = voxel_map.state_at(points).reshape(37, 40, 64)
        for state, words in ((OCCUPIED, occupied), (FREE, free)):
            bits = np.packbits(states == state, axis=2, bitorder="little").view(np.uint64)
            np.testing.assert_array_equal(words, bits)
        wholes.add(free.tobytes())
    assert len(wholes) > 5
    voxel_map.integrate((0.5, 1.5, 0.9), directions, ranges_mm, 2.0, 10**11)
    occupied[:], free[:] = 1, 1
    with np.errstate(over="ignore"):
        voxel_map.rewrite_columns(low, EVERYWHERE, occupied, free)
        whole = voxel_map.columns(low, (37, 40, 1))
    np.testing.assert_array_equal([occupied, free], whole)
    bits = np.packbits(voxel_map.state_at(points).reshape(37, 40, 64) == FREE, axis=2)
    assert np.unpackbits(free.view(np.uint8)).sum() == np.unpackbits(bits).sum() > 0
