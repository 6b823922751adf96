"""Packets of Velodyne's lidars, made by their manuals about a robot that turns in a room."""

import numpy as np
import pytest

from tests.harness.recordings.bags.drawn import PERIOD, START, Plan, Recorder, read
from wayproof.harness.recordings.formats import open_recording

VLP16 = [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]
HDL32 = [-30.67, -9.33, -29.33, -8.0, -28.0, -6.67, -26.67, -5.33, -25.33, -4.0, -24.0, -2.67]
HDL32 += [-22.67, -1.33, -21.33, 0.0, -20.0, 1.33, -18.67, 2.67, -17.33, 4.0, -16.0, 5.33]
HDL32 += [-14.67, 6.67, -13.33, 8.0, -12.0, 9.33, -10.67, 10.67]
LIDARS = {"VLP-16": (0x22, VLP16, 2.304, 55.296), "HDL-32E": (0x21, HDL32, 1.152, 46.08)}
"""Byte of the model, elevations, degrees, time from laser to laser and firing to firing, us."""


def packet(recorder, begin, lidar, dual=False, wrong=()):
    """Return a packet whose first laser fires at a time, s: each laser by the manual's tables."""
    number, elevations, laser_us, cycle_us = LIDARS[lidar]
    data = np.zeros(1206, np.uint8)
    per_block = 32 // len(elevations)
    for block in range(12):
        firing = block // 2 if dual else block
        own = begin + firing * per_block * cycle_us * 1e-6
        after = np.arange(per_block)[:, None] * cycle_us + np.arange(len(elevations)) * laser_us
        times = own + after.ravel() * 1e-6
        azimuths = 2 * np.pi * ((times - START) / PERIOD % 1.0)
        flat = recorder.seen(0.0, times - START, -azimuths)
        slant = flat / np.cos(np.radians(np.tile(elevations, per_block)))
        units = np.rint(slant / 0.002)
        if dual and block % 2 == 0:  # a second, farther return, or none
            units = np.where(np.arange(32) % 2, units + 200, 0)
        row = data[100 * block : 100 * block + 100]
        row[:2] = 0xFF, 0xEE
        row[2:4] = np.array([round(np.degrees(azimuths[0]) * 100) % 36000], "<u2").view(np.uint8)
        row[4:].reshape(32, 3)[:, :2] = units.astype("<u2").view(np.uint8).reshape(32, 2)
    hour = round((3599.95 + begin - START) % 3600.0 * 1e6)
    data[1200:1204] = np.array([hour], "<u4").view(np.uint8)
    data[1204:] = 0x39 if dual else 0x37, number
    for place, value in wrong:
        data[place] = value
    return data


def record(path, lidar, dual=False, wrong=()):
    """Write a bag of three sweeps; the lidar's hour ends in the first."""
    recorder = Recorder(Plan(sensor="cloud"), 0)
    recorder.transforms()
    build, elevations = recorder.bag.build, LIDARS[lidar][1]
    long = (6 if dual else 12) * 32 // len(elevations) * LIDARS[lidar][3] * 1e-6
    for sweep in range(3):
        first = START + PERIOD * sweep
        ended = [first + long * (k + 1) for k in range(int(PERIOD / long))]
        packets = [
            build.make(
                "velodyne_msgs/VelodynePacket",
                stamp=build.time(round(end * 1e9)),
                data=packet(recorder, end - long, lidar, dual, wrong),
            )
            for end in ended
        ]
        message = build.make(
            "velodyne_msgs/VelodyneScan",
            header=build.header(round(ended[-1] * 1e9), "lidar"),
            packets=packets,
        )
        recorder.bag.add("/velodyne_packets", "velodyne_msgs/VelodyneScan", message, ended[-1])
    return recorder.bag.write(path)


@pytest.mark.parametrize("lidar", LIDARS)
@pytest.mark.parametrize("dual", [False, True])
def test_the_returns_of_packets_lie_on_the_walls(tmp_path, lidar, dual):
    path = record(tmp_path / "bag", lidar, dual)
    found = read(path)
    assert (found.refused, found.faults, found.wrong) == ("", {}, 0.0)
    assert found.returns >= 80_000
    sweep = next(open_recording(path).sweeps())
    assert 0.95 * PERIOD < sweep.beam_times_ns.max() * 1e-9 < PERIOD
    up = np.degrees(np.arcsin(sweep.points[:, 2] / sweep.ranges))
    assert set(np.rint(up).tolist()) == set(np.rint(LIDARS[lidar][1]).tolist())


def test_packets_of_another_lidar_are_named(tmp_path):
    found = read(record(tmp_path / "bag", "VLP-16", wrong=[(1205, 0x28)]))
    assert "packets of the model 0x28, expected 0x22 (VLP-16), 0x21 (HDL-32E)" in found.refused
