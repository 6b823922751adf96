"""Cells that a body covers."""

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.judge.cells import ball, cells_around, columns, reach_to
from wayproof.harness.mission import Mission
from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.grid import cells_at

WALKER = Mission(
    "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
    (0.0, 0.0, -0.2), (1.0, 1.0, 2.0), (0.5, 0.5, 0.3), 0.0, (0.5, 0.5, 0.3),
)  # fmt: skip


def test_a_column_by_hand():
    """Ten-centimetre layers from 17.5 cm below the floor: what a walker of 0.4 m meets."""
    unknown, free, occupied = 0, 1, 2
    clear = [unknown, occupied, free, free, free, free, unknown]
    cases = {
        "clear": (clear, free),
        "no floor seen": ([unknown, unknown, *clear[2:]], unknown),
        "a beam below seen floor": ([free, *clear[1:]], free),
        "a box": ([*clear[:3], occupied, *clear[4:]], occupied),
        "under a board": ([*clear[:6], occupied], free),
        "not all seen": ([*clear[:5], unknown, unknown], unknown),
    }
    states = np.array([[column for column, _ in cases.values()]], np.uint8)
    found = columns(states, -0.175, 0.1, WALKER)
    assert found[0].tolist() == [expected for _, expected in cases.values()]


def test_floor_that_was_seen_holds_but_beside_a_column_without_floor():
    unknown, free, occupied = 0, 1, 2
    below_floor = [free, occupied, free, free, free, free, unknown]
    states = np.tile(np.array(below_floor, np.uint8), (6, 5, 1))
    states[4, 2, 1] = unknown
    found = columns(states, -0.175, 0.1, WALKER)
    expected = np.full((6, 5), free)
    expected[3:6, 1:4] = occupied
    assert found.tolist() == expected.tolist()


@pytest.mark.parametrize("size", [0.05, 0.1])
@pytest.mark.parametrize("motion", ["ground", "air"])
def test_a_point_on_a_face_lies_in_the_cell_that_the_map_puts_it_into(motion, size):
    """Goals are round numbers, and (6 - 4.7) / 0.1 is rounded to less than 13."""
    mission = Mission(
        motion, 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
        (0.0, 0.0, -0.2), (12.0, 12.0, 3.0), (0.5, 0.5, 0.3), 0.0, (6.0, 6.0, 0.3),
    )  # fmt: skip
    faces = np.round(np.arange(20, 121) * 0.05, 2)
    points = np.column_stack((faces, faces[::-1], np.full(len(faces), 0.3)))
    voxel_map = VoxelMap(MapConfig(resolution=size), mission.low, mission.high)
    config = Config("empty", "quadruped" if motion == "ground" else "drone", 1)
    rounded_down = 0
    for reach in (0.3, 0.55, 1.0, 1.35):  # corners at other multiples
        cells = cells_around(voxel_map, points, reach, config, mission)
        expected = cells_at(points, size)[0][:, : cells.axes] - cells.first
        assert (cells.of(points) == expected).all()
        at_corner = cells.corner + (cells.of(points) + 0.5) * size
        assert (np.abs(at_corner - points[:, : cells.axes]) <= 0.5 * size + 1e-9).all()
        plain = np.floor((points[:, : cells.axes] - cells.corner) / size)
        rounded_down += int((plain != expected).sum())
    assert rounded_down > 0  # measured from the corner some lie in another cell


@pytest.mark.parametrize("axes", [2, 3])
def test_a_reach_holds_the_cells_at_its_distance_and_none_beyond(axes):
    _, far = ball(axes, 20.5)
    for square in range(1, 400):
        _, squares = ball(axes, reach_to(square))
        assert np.array_equal(squares, far[far <= square])
