"""Sensors as data: beams rebuilt from tables, scan poses of a sweep, errors of ranges."""

import dataclasses
import os
import subprocess
import sys
from math import asin, cos, isclose, lcm, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import (
    DROPPED,
    NO_RETURN,
    BeamTable,
    beam_directions,
    directions,
    pose_indices,
    pose_offsets,
    quantise,
    ray_ranges,
)
from wayproof.models.sensors.devices import (
    DEVICES,
    DepthCamera,
    Mount,
    RangeNoise,
    SolidStateLidar,
    SpinningLidar,
    evenly,
)
from wayproof.models.sensors.measure import measure, report

ROOT = Path(__file__).resolve().parents[2]

LIDAR = SpinningLidar(
    elevations=(0.0,),
    azimuths=100_000,
    range=50.0,
    minimum_range=0.5,
    rate=10.0,
    no_return_is_free=False,
    source="test",
)
ALONG = directions(LIDAR.beam_table(), 0)  # (100000, 3)


def with_noise(noise, **changes):
    return dataclasses.replace(LIDAR, noise=noise, **changes)


def reports(device, distance, cosine=None, seed=0):
    """What all of LIDAR's beams report of one true distance, m; nan where they tell nothing."""
    true = np.full(len(ALONG), distance)
    cosines = None if cosine is None else np.full(len(ALONG), cosine)
    millimetres = measure(device, true, cosines, ALONG, stream(seed, "lidar", 7))
    return np.where(millimetres == DROPPED, np.nan, millimetres / 1000.0)


def pairs(rows=5, columns=7, beams=11, row_step=3, column_step=2, **more):
    angle = np.linspace(-0.5, 0.5, max(rows, columns))
    table = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return BeamTable(
        rows=table[:rows],
        columns=table[:columns],
        beams=beams,
        order="pairs",
        row_step=row_step,
        column_step=column_step,
        **more,
    )


def same_after_a_log(table):
    """The table as a log would give it back: plain floats."""
    rows, columns = (np.array(t.ravel().tolist()) for t in (table.rows, table.columns))
    width = table.rows.shape[1]
    return dataclasses.replace(
        table, rows=rows.reshape(-1, width), columns=columns.reshape(-1, width)
    )


# Beams


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


def test_a_grid_fires_the_same_beams_in_every_sweep():
    table = DEVICES["velodyne-vlp16"].beam_table()
    assert directions(table, 0).tobytes() == directions(table, 99).tobytes()


def test_tables_cannot_be_changed():
    table = pairs()
    with pytest.raises(ValueError, match="read-only"):
        table.rows[0, 0] = 2.0


# Moments of a sweep


def test_scan_poses_of_a_grid_follow_its_columns():
    lidar = dataclasses.replace(LIDAR, elevations=(0.0, 0.1), azimuths=5, scan_poses=2)
    expected = [0, 0, 0, 1, 1]  # 2 j // 5
    assert pose_indices(lidar.beam_table()).tolist() == expected + expected


def test_scan_poses_of_pairs_follow_the_beams():
    assert pose_indices(pairs(beams=7, scan_poses=3)).tolist() == [0, 0, 0, 1, 1, 2, 2]


def test_one_moment_is_a_global_shutter():
    table = dataclasses.replace(LIDAR, azimuths=9).beam_table()
    assert not pose_indices(table).any()
    assert pose_offsets(table, 100).tolist() == [0]


def test_the_last_moment_is_the_end_of_the_sweep():
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


# Errors


@pytest.mark.parametrize("name", [name for name in sorted(DEVICES) if name.startswith("ideal-")])
def test_an_ideal_device_reports_the_truth_and_draws_nothing(name):
    device = DEVICES[name]
    beams = directions(device.beam_table(), 0)
    true = np.random.default_rng(0).uniform(-1.0, 1.5 * device.range, len(beams))
    true[true < 0.0] = -1.0
    rng = stream(0, name, 0)
    reported = measure(device, true, None, beams, rng)
    assert reported.tobytes() == quantise(true, device.range).tobytes()
    assert rng.random() == stream(0, name, 0).random()


def test_the_report_is_that_of_array_operations():
    rng = np.random.default_rng(1)
    distance = np.where(rng.random(4000) < 0.1, -1.0, rng.uniform(0.0, 12.0, 4000))
    distance[:4] = 0.5, 10.0, 0.0, np.nextafter(10.0, 11.0)
    true = distance * rng.uniform(0.7, 1.0, 4000)
    value = true + 0.01 * rng.standard_normal(4000)
    lost = rng.random(4000) < 0.3
    for silence in (NO_RETURN, DROPPED):
        echo = (distance >= 0.0) & (true <= 10.0)
        expected = np.where(echo & ~lost, quantise(value, 10.0), silence)
        expected[echo & (true < 0.5)] = DROPPED
        given = distance, true, value, lost, 0.5, 10.0, silence
        for reported in (report(*given), report.py_func(*given)):
            assert reported.dtype == np.uint16
            assert reported.tobytes() == expected.astype(np.uint16).tobytes()
    assert report(true, true, true, np.zeros(0, bool), 0.0, 12.0, NO_RETURN).tobytes() == (
        quantise(true, 12.0).tobytes()
    )


def test_a_device_that_errs_needs_random_numbers():
    with pytest.raises(ValueError, match="rng: got None, expected a generator"):
        measure(with_noise(RangeNoise(sigma=0.1)), np.ones(1), None, ALONG[:1], None)


@pytest.mark.parametrize("distance", [1.0, 7.0, 30.0])
def test_the_standard_deviation_is_the_root_of_the_sum_of_squares(distance):
    noise = RangeNoise(sigma=0.03, sigma_proportional=0.005, sigma_quadratic=0.0004)
    expected = sqrt(0.03**2 + (0.005 * distance) ** 2 + (0.0004 * distance**2) ** 2)
    got = reports(with_noise(noise), distance)
    standard_error = expected / sqrt(2 * len(got))
    assert abs(got.std() - expected) < 5 * standard_error
    assert abs(got.mean() - distance) < 5 * expected / sqrt(len(got))


def test_reports_are_multiples_of_the_quantum():
    """0.012 m steps about 3.0 m = 250 steps; noise reaches several of them."""
    got = reports(with_noise(RangeNoise(sigma=0.02, quantum=0.012)), 3.0)
    steps = np.unique(np.rint(got * 1000).astype(int))
    assert (steps % 12 == 0).all()
    assert len(steps) > 8


def test_a_quantum_alone_rounds_to_the_nearest_step():
    device = with_noise(RangeNoise(quantum=0.01))
    assert (reports(device, 3.014) == 3.01).all()
    assert (reports(device, 3.016) == 3.02).all()


def test_dropout_is_a_share_of_the_returns():
    lost = np.isnan(reports(with_noise(RangeNoise(dropout=0.1)), 5.0)).mean()
    assert abs(lost - 0.1) < 5 * sqrt(0.1 * 0.9 / len(ALONG))
    assert np.isnan(reports(with_noise(RangeNoise(dropout=1.0)), 5.0)).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_grazing_beams_are_lost(sign):
    """At 10 degrees between beam and surface the cosine of incidence is the sine of 10 degrees."""
    device = with_noise(RangeNoise(grazing=radians(10.0)))
    assert np.isnan(reports(device, 5.0, cosine=sign * sin(radians(9.9)))).all()
    assert (reports(device, 5.0, cosine=sign * sin(radians(10.1))) == 5.0).all()


def test_grazing_needs_the_incidence():
    with pytest.raises(ValueError, match="incidence_cosine: got None"):
        reports(with_noise(RangeNoise(grazing=0.1)), 5.0)


def test_one_errors_size_does_not_shift_anothers_draws():
    few = np.isnan(reports(with_noise(RangeNoise(sigma=0.001, dropout=0.2)), 5.0))
    many = np.isnan(reports(with_noise(RangeNoise(sigma=0.1, dropout=0.4)), 5.0))
    assert (few <= many).all()
    assert few.sum() < many.sum()


def test_errors_keep_an_echo_within_the_devices_span():
    noise = RangeNoise(sigma=0.5)
    near, far = reports(with_noise(noise), 0.5), reports(with_noise(noise), 50.0)
    assert (near.min(), far.max()) == (0.5, 50.0)
    for got in (near, far):
        assert 0.45 < np.isin(got, (0.5, 50.0)).mean() < 0.55


@pytest.mark.parametrize(("free", "silence"), [(True, NO_RETURN), (False, DROPPED)])
def test_what_sends_no_echo_is_free_only_if_the_device_says_so(free, silence):
    device = with_noise(RangeNoise(dropout=1.0), no_return_is_free=free)
    true = np.array([-1.0, 50.1, 5.0, 0.4])  # a miss, beyond, lost, and too near
    got = measure(device, true, None, ALONG[:4], stream(0, "lidar", 0))
    assert got.tolist() == [silence, silence, silence, DROPPED]


def test_the_span_of_a_depth_camera_is_one_of_depths():
    """A corner beam sees 2.9 m of depth at a range beyond 3 m."""
    camera = dataclasses.replace(DEVICES["intel-realsense-d435"], noise=RangeNoise())
    beam = directions(camera.beam_table(), 0)[:1]
    true = np.array([2.9 / beam[0, 0]])
    assert true > camera.range
    assert measure(camera, true, None, beam, stream(0, "depth", 0)).tolist() == [2900]


def test_the_same_stream_gives_the_same_reports():
    device = with_noise(RangeNoise(sigma=0.05, dropout=0.1))
    assert reports(device, 9.0).tobytes() == reports(device, 9.0).tobytes()
    assert reports(device, 9.0).tobytes() != reports(device, 9.0, seed=1).tobytes()


def test_streams_differ_by_seed_name_and_sequence_alone():
    keys = [(0, "a", 0), (1, "a", 0), (0, "b", 0), (0, "a", 1)]
    first = [stream(*key).integers(2**63) for key in keys]
    assert len(set(first)) == 4
    assert first == [stream(*key).integers(2**63) for key in keys]
    load = "from wayproof.models.random_streams import stream"
    code = f"{load}; print(stream(0, 'b', 0).integers(2**63))"
    printed = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONHASHSEED": "5"},
    )
    assert int(printed.stdout) == first[2]


# Presets


def test_devices_need_no_simulator():
    code = "import sys, wayproof.models.sensors.devices; print('mujoco' in sys.modules)"
    printed = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert printed.stdout.strip() == "False"


@pytest.mark.parametrize("name", sorted(DEVICES))
def test_presets_are_whole(name):
    device = DEVICES[name]
    assert name == name.lower()
    assert len(device.source) > 20
    ideal = name.startswith("ideal-")
    assert device.no_return_is_free == ideal
    assert (device.noise == RangeNoise()) == ideal


def field_of_view(name, sweeps=1):
    table = DEVICES[name].beam_table()
    beams = np.concatenate([directions(table, sweep) for sweep in range(sweeps)])
    elevation = np.degrees(np.arcsin(beams[:, 2]))
    return elevation.min(), elevation.max()


@pytest.mark.parametrize(
    ("name", "low", "high", "beams"),
    [
        ("velodyne-vlp16", -15.0, 15.0, 16 * 1808),
        ("ouster-os1-64", -16.6, 16.6, 64 * 1024),
        ("livox-mid360", -7.0, 52.0, 20_000),
        ("ideal-lidar-wide", -45.0, 45.0, 32 * 512),
        ("ideal-lidar-floor", -45.0, 15.0, 32 * 625),
    ],
)
def test_fields_of_view_are_those_of_the_sheets(name, low, high, beams):
    assert field_of_view(name) == pytest.approx((low, high), abs=0.06)
    assert DEVICES[name].beam_table().beams == beams


def test_the_depth_cameras_error_at_two_metres():
    """2^2 * 0.1 pixels / (424 pixels * 0.05 m) = 19 mm."""
    assert DEVICES["intel-realsense-d435"].noise.sigma_quadratic * 4.0 == pytest.approx(
        0.0189, 0.01
    )


def squares(table, sequence):
    """Which squares of one degree of the Mid-360's field of view a sweep meets, (59, 360)."""
    beams = directions(table, sequence)
    elevation = np.degrees(np.arcsin(beams[:, 2])) + 7.0
    azimuth = np.degrees(np.arctan2(beams[:, 1], beams[:, 0])) + 180.0
    met = np.zeros((59, 360), bool)
    met[np.clip(elevation.astype(int), 0, 58), np.clip(azimuth.astype(int), 0, 359)] = True
    return met


def test_a_non_repeating_pattern_sees_more_the_longer_it_looks():
    """A repeating one would stay at its first sweep's share."""
    table = DEVICES["livox-mid360"].beam_table()
    seen = np.logical_or.accumulate([squares(table, sweep) for sweep in range(10)])
    share = seen.mean(axis=(1, 2))
    assert 0.3 < share[0] < 0.5
    assert (np.diff(share) > 0.01).all()
    assert share[-1] > 0.98


def test_a_direction_comes_at_most_twice_in_a_second():
    """Once on a stroke up and once on a stroke down, for the pattern repeats after 21 s."""
    device = DEVICES["livox-mid360"]
    assert lcm(2 * device.rows, device.columns) > 20 * 10 * device.beams
    table = device.beam_table()
    beams = np.concatenate([directions(table, sweep) for sweep in range(10)])
    _, times = np.unique(beams, axis=0, return_counts=True)
    assert times.max() == 2
    assert (times == 2).mean() < 0.1


def test_rows_of_pairs_are_met_equally_often():
    table = pairs(rows=5, beams=70, row_step=3, column_step=1)
    beams = directions(table, 0)
    _, counts = np.unique(beams[:, 2], return_counts=True)
    assert counts.tolist() == [14] * 5


# What is refused


def test_a_sector_keeps_to_its_azimuths():
    lidar = SolidStateLidar(
        elevation_low=-0.1, elevation_high=0.1, azimuth_low=-0.6, azimuth_high=0.6,
        rows=9, columns=31, row_step=2, column_step=3, beams=500,
        range=50.0, rate=10.0, no_return_is_free=False, source="test",
    )  # fmt: skip
    beams = directions(lidar.beam_table(), 0)
    azimuth = np.arctan2(beams[:, 1], beams[:, 0])
    assert np.abs(azimuth).max() == pytest.approx(0.6 - 0.6 / 31)
    assert isclose(asin(beams[:, 2].max()), 0.1 - 0.1 / 9)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"range": 0.0}, "range: got 0, expected > 0 to 65.534 m"),
        ({"range": 65.6}, "range: got 65.6"),
        ({"range": float("nan")}, "range: got nan"),
        ({"minimum_range": 50.0}, "minimum_range: got 50, expected 0 to less than the range"),
        ({"minimum_range": -0.1}, "minimum_range: got -0.1"),
        ({"rate": 0.0}, "rate: got 0"),
        ({"source": ""}, "source: got nothing"),
        ({"elevations": ()}, "elevations, azimuths: got 0 and 100000"),
        ({"scan_poses": 0}, "scan_poses: got 0, expected 1 to 100000"),
        ({"measures": "depth"}, "measures: got 'depth' with angles"),
        ({"measures": "time"}, "measures: got 'time'"),
    ],
)
def test_what_no_lidar_is_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(LIDAR, **changes)


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("livox-mid360", {"row_step": 0}, "row_step, column_step: got 20000, 0, 1"),
        ("livox-mid360", {"elevation_low": 1.0}, "elevation_low, elevation_high: got 1"),
        ("livox-mid360", {"azimuth_low": -4.0}, "azimuth_low, azimuth_high: got -4"),
        ("livox-mid360", {"columns": 0}, "rows, columns: got 591 and 0"),
        ("livox-mid360", {"beams": 1 << 40}, "beams: got 1099511627776, expected at most"),
        ("ideal-depth-camera", {"height": 0}, "height, width: got 0 and 64"),
        ("ideal-depth-camera", {"field_of_view_vertical": pi}, "field_of_view_vertical: got 3.14"),
    ],
)
def test_what_no_device_is_is_refused(name, changes, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(DEVICES[name], **changes)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"sigma": -0.1}, "sigma: got -0.1"),
        ({"sigma_quadratic": float("inf")}, "sigma_quadratic: got inf"),
        ({"quantum": 0.0001}, "quantum: got 0.0001, expected 0 or at least 0.001 m"),
        ({"dropout": 1.1}, "dropout: got 1.1, expected a probability"),
        ({"grazing": pi / 2}, "grazing: got 1.57"),
    ],
)
def test_what_no_error_is_is_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        RangeNoise(**fields)


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
def test_what_no_table_is_is_refused(changes, said):
    unit = np.array([[1.0, 0.0], [cos(0.1), sin(0.1)]])
    with pytest.raises(ValueError, match=said):
        BeamTable(**{"rows": unit, "columns": unit, "beams": 4, **changes})


def test_a_mount_has_a_name_and_a_site():
    with pytest.raises(ValueError, match="site: got nothing"):
        Mount("lidar", "", LIDAR)
