"""Presets as their data sheets say, and devices that are refused."""

import dataclasses
import subprocess
import sys
from math import asin, isclose, pi
from pathlib import Path

import numpy as np
import pytest

from tests.models.sensors.lidar import LIDAR
from wayproof.models.sensors.beams import (
    directions,
)
from wayproof.models.sensors.devices import (
    DEVICES,
    Mount,
    RangeNoise,
    SolidStateLidar,
)

ROOT = Path(__file__).resolve().parents[3]


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
def test_bad_lidars_are_refused(changes, said):
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
def test_bad_devices_are_refused(name, changes, said):
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
def test_bad_errors_are_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        RangeNoise(**fields)


def test_a_mount_has_a_name_and_a_site():
    with pytest.raises(ValueError, match="site: got nothing"):
        Mount("lidar", "", LIDAR)
