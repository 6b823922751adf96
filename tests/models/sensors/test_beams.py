"""Beams rebuilt from tables, scan poses of a sweep, depths as ranges."""

import dataclasses
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.models.sensors.lidar import ALONG, LIDAR, pairs, same_after_a_log
from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import (
    BeamTable,
    beam_directions,
    directions,
    pose_indices,
    pose_offsets,
    ray_ranges,
)
from wayproof.models.sensors.devices import (
    DEVICES,
    DepthCamera,
    RangeNoise,
    evenly,
)
from wayproof.models.sensors.measure import measure


def test_a_spinning_lidar_by_hand():
    lidar = dataclasses.replace(LIDAR, elevations=evenly(-pi / 4, pi / 4, 3), azimuths=4)
    beams = directions(lidar.beam_table(), 0).reshape(3, 4, 3)
    np.testing.assert_allclose(beams[1, 2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(beams[1, 3], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(beams[2, 2], np.array([1, 0, 1]) / sqrt(2), atol=1e-15)


def test_listed_elevations_are_the_rings():
    lidar = dataclasses.replace(LIDAR, elevations=(0.3, -0.1), azimuths=2)
    beams = directions(lidar.beam_table(), 0).reshape(2, 2, 3)
    np.testing.assert_allclose(beams[:, 1, 2], [sin(0.3), sin(-0.1)], rtol=1e-15)


def test_pairs_by_hand():
    """Rows 0, 3, 6 -> 3, 9 -> 0, 2 of a wave of period 10; columns 0, 2, 4, 6, 1 of 7."""
    table = pairs(beams=5)
    expected = [beam_directions(table.rows, table.columns).reshape(5, 7, 3)[at]
                for at in ((0, 0), (3, 2), (3, 4), (0, 6), (2, 1))]  # fmt: skip
    np.testing.assert_array_equal(directions(table, 0), expected)


def test_a_sweep_of_pairs_goes_on_where_the_last_one_ended():
    table = pairs(beams=11)
    both = dataclasses.replace(table, beams=22)
    halves = [directions(table, sweep) for sweep in (0, 1)]
    np.testing.assert_array_equal(np.concatenate(halves), directions(both, 0))


@given(
    sequence=st.integers(0, 10**15),
    beams=st.integers(1, 40),
    row_step=st.integers(1, 10**9),
    column_step=st.integers(1, 10**9),
    rows=st.integers(1, 9),
    columns=st.integers(1, 9),
)
def test_pairs_are_the_integers_that_the_docstring_says(
    sequence, beams, row_step, column_step, rows, columns
):
    table = pairs(rows, columns, beams, row_step, column_step)
    grid = beam_directions(table.rows, table.columns).reshape(rows, columns, 3)
    got = directions(table, sequence)
    for k in range(beams):
        i = sequence * beams + k  # Python's integers have no end
        p = i * row_step % (2 * rows)
        row = p if p < rows else 2 * rows - 1 - p
        assert got[k].tobytes() == grid[row, i * column_step % columns].tobytes()


@pytest.mark.parametrize("name", sorted(DEVICES))
def test_beams_are_unit_vectors_and_the_same_bits_after_a_log(name):
    table = DEVICES[name].beam_table()
    for sequence in (0, 1, 12_345):
        beams = directions(table, sequence)
        assert beams.shape == (table.beams, 3)
        np.testing.assert_allclose(np.linalg.norm(beams, axis=1), 1.0, rtol=1e-15)
        assert beams.tobytes() == directions(same_after_a_log(table), sequence).tobytes()


def test_tables_cannot_be_changed():
    table = pairs()
    with pytest.raises(ValueError, match="read-only"):
        table.rows[0, 0] = 2.0


# Scan poses


def test_scan_poses_of_a_grid_follow_its_columns():
    lidar = dataclasses.replace(LIDAR, elevations=(0.0, 0.1), azimuths=5, scan_poses=2)
    expected = [0, 0, 0, 1, 1]  # 2 j // 5
    assert pose_indices(lidar.beam_table()).tolist() == expected + expected


def test_scan_poses_of_pairs_follow_the_beams():
    assert pose_indices(pairs(beams=7, scan_poses=3)).tolist() == [0, 0, 0, 1, 1, 2, 2]


def test_the_last_scan_pose_is_the_end_of_the_sweep():
    assert pose_offsets(pairs(scan_poses=4), 100_000_000).tolist() == [
        -75_000_000,
        -50_000_000,
        -25_000_000,
        0,
    ]


@given(beams=st.integers(1, 500), data=st.data())
def test_scan_poses_share_a_sweep_evenly(beams, data):
    count = data.draw(st.integers(1, beams))
    held = np.bincount(pose_indices(pairs(beams=beams, scan_poses=count)), minlength=count)
    assert len(held) == count
    assert held.max() - held.min() <= 1


# Depth and range


def test_depths_become_ranges_along_the_ray():
    """A beam along (1, 0.5, 0.5) is the root of 1.5 times as long as its depth."""
    camera = DepthCamera(
        height=2, width=2, field_of_view_horizontal=pi / 2, field_of_view_vertical=pi / 2,
        range=60.0, rate=10.0, no_return_is_free=False, source="test",
    )  # fmt: skip
    table = camera.beam_table()
    depths = np.array([1000, 0, 65535, 60000], np.uint16)
    expected = [1225, 0, 65535, 65534]  # 1224.7; 73485 does not fit
    assert ray_ranges(table, directions(table, 0), depths).tolist() == expected


def test_ranges_stay_ranges():
    table = LIDAR.beam_table()
    reported = np.array([0, 1, 50_000, 65535], np.uint16)
    assert ray_ranges(table, ALONG[:4], reported).tolist() == reported.tolist()


def test_a_wall_across_the_axis_has_one_depth():
    camera = DEVICES["intel-realsense-d435"]
    ideal = dataclasses.replace(camera, noise=RangeNoise())
    table = camera.beam_table()
    beams = directions(table, 0)
    to_the_wall = 2.0 / beams[:, 0]
    reported = measure(ideal, to_the_wall, None, beams, stream(0, "depth", 0))
    assert (reported == 2000).all()
    ranges = ray_ranges(table, beams, reported) / 1000.0
    np.testing.assert_allclose(ranges, to_the_wall, atol=0.0005)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"beams": 6}, "beams: got 6, expected rows x columns = 4"),
        ({"order": "spiral"}, "order: got 'spiral'"),
        ({"rows": np.zeros((2, 3)), "columns": np.zeros((2, 3))}, "got width 3"),
        ({"rows": np.zeros((2, 1))}, r"got shapes \(2, 1\) and \(2, 2\)"),
        ({"rows": np.zeros((0, 2))}, "got shapes"),
        ({"rows": np.zeros((2, 2))}, "rows: expected finite slopes, or cos and sin"),
        ({"columns": np.full((2, 2), np.nan)}, "columns: expected finite"),
        ({"scan_poses": 3}, "scan_poses: got 3, expected 1 to 2"),
    ],
)
def test_bad_tables_are_refused(changes, said):
    unit = np.array([[1.0, 0.0], [cos(0.1), sin(0.1)]])
    with pytest.raises(ValueError, match=said):
        BeamTable(**{"rows": unit, "columns": unit, "beams": 4, **changes})
