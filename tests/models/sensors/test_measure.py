"""Errors of reports, and the random streams that they come from."""

import dataclasses
import os
import subprocess
import sys
from math import radians, sin, sqrt
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.models.sensors.lidar import ALONG, reports, with_noise
from wayproof.models.poses import Trail
from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import (
    DROPPED,
    NO_RETURN,
    directions,
    quantise,
)
from wayproof.models.sensors.caster import make_caster
from wayproof.models.sensors.devices import (
    DEVICES,
    Mount,
    RangeNoise,
    SensorConfig,
    SpinningLidar,
)
from wayproof.models.sensors.measure import measure, report

ROOT = Path(__file__).resolve().parents[3]


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


def test_a_device_with_errors_needs_random_numbers():
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


def test_the_size_of_one_error_does_not_shift_the_draws_of_another():
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
def test_a_beam_without_echo_is_free_only_where_the_device_says_so(free, silence):
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


@pytest.mark.parametrize("scan_poses", [1, 5])
def test_a_sweep_loses_the_beams_that_graze_the_floor(scan_poses):
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="0 0 1"/><body name="base" pos="0 0 0.5">'
        '<freejoint/><geom size="0.1" group="3"/><site name="lidar"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    device = SpinningLidar(
        elevations=(radians(-5.0), radians(-15.0)), azimuths=10, scan_poses=scan_poses, range=30.0,
        rate=10.0, noise=RangeNoise(grazing=radians(10.0)), no_return_is_free=False, source="test",
    )  # fmt: skip
    base = model.body("base").id
    caster = make_caster(model, Mount("lidar", "lidar", device), base, "", SensorConfig())
    trail = Trail(data.qpos[None, :3].copy(), data.qpos[None, 3:7].copy(), 0.002)
    steep = round(1000.0 * 0.5 / sin(radians(15.0)))
    assert caster.cast(data, trail, 0, 0).tolist() == 10 * [DROPPED] + 10 * [steep]
