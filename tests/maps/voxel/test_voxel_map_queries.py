import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, MapConfig, VoxelMap, states_in

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
