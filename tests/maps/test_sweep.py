"""Beams from points: directions and ranges that no type cuts short."""

import numpy as np
import pytest

from wayproof.maps import OCCUPIED, MapConfig, VoxelMap, beams_from_points


def test_beams_end_at_their_points():
    points = np.random.default_rng(0).uniform(-150.0, 150.0, (500, 3))
    origin = np.array([3.0, -2.0, 1.0])
    directions, ranges_mm = beams_from_points(origin, points)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    ends = origin + directions * (ranges_mm[:, None] / 1000.0)
    assert np.abs(ends - points).max() <= 0.0005 + 1e-9
    assert ranges_mm.max() > 65535


def test_a_wall_at_80_m_stands_at_80_m():
    voxels = VoxelMap(MapConfig(resolution=0.2, half_life=0.0))
    y = np.linspace(-0.95, 0.95, 50)
    points = np.column_stack([np.full(50, 80.1), y, np.full(50, 1.02)])
    directions, ranges_mm = beams_from_points([0.0, 0.0, 1.0], points)
    sweep = voxels.integrate([0.0, 0.0, 1.0], directions, ranges_mm, 100.0, 0)
    assert sweep.hits == 50
    assert (voxels.state_at(points) == OCCUPIED).all()
    at_wrapped = points * [(80100 - 65536) / 80100, 0.0, 1.0]
    assert not (voxels.state_at(at_wrapped) == OCCUPIED).any()


def test_points_without_information_and_at_codes():
    points = [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0], [0.0, 0.0, 0.0], [65.535, 0.0, 0.0]]
    directions, ranges_mm = beams_from_points([0.0, 0.0, 0.0], points)
    assert ranges_mm.tolist() == [0, 0, 0, 65534]
    np.testing.assert_array_equal(directions, [[1.0, 0.0, 0.0]] * 4)
    voxels = VoxelMap(MapConfig(half_life=0.0))
    assert voxels.integrate([0.0] * 3, directions, ranges_mm, 100.0, 0).dropped == 3


@pytest.mark.parametrize(
    ("origin", "points", "said"),
    [
        ([0.0, 0.0], [[1.0, 0.0, 0.0]], r"expected \(3,\) and \(n, 3\)"),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], r"expected \(3,\) and \(n, 3\)"),
        ([np.nan, 0.0, 0.0], [[1.0, 0.0, 0.0]], "expected finite"),
        ([0.0, 0.0, 0.0], [[5e9, 0.0, 0.0]], "at most 4294 km"),
    ],
)
def test_other_arguments_are_refused(origin, points, said):
    with pytest.raises(ValueError, match=said):
        beams_from_points(origin, points)
