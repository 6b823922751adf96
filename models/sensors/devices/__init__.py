"""Range sensors by name; a new one of a known kind is an entry of `DEVICES`.

A new kind is a subclass of `Device`, with its `kind` and its beams.

Devices say in `source` which data sheet they follow. Where a sheet gives an accuracy of +- x, x is
read as one standard deviation, which does not flatter the sensor. No sheet states how many returns
are lost, so devices lose none.
"""

from __future__ import annotations

import math

from wayproof.models.sensors.devices.device import OWN, Device, Mount, RangeNoise, SensorConfig
from wayproof.models.sensors.devices.kinds import (
    DepthCamera,
    Rangefinder,
    SolidStateLidar,
    SpinningLidar,
    evenly,
)

D435_BASELINE = 0.050  # m
D435_FOCAL_LENGTH = 848 / 2 / math.tan(math.radians(90.0) / 2)  # pixels
D435_DISPARITY_ERROR = 0.1  # pixels: the most that is expected of a well textured surface

DEVICES: dict[str, Device] = {
    # Benewake TFmini-S: a single-beam time-of-flight rangefinder, such as drones carry downward.
    "benewake-tfmini-s": Rangefinder(
        range=12.0,
        minimum_range=0.1,
        rate=100.0,
        # +-6 cm to 6 m, then 1 %: at 12 m the root of 0.06^2 + (0.00866 * 12)^2 is the 12 cm
        # of 1 %.
        noise=RangeNoise(sigma=0.06, sigma_proportional=0.00866, quantum=0.01),
        no_return_is_free=False,
        source="Benewake, TFmini-S LiDAR Module data sheet SJ-GU-TFmini-S-01 A00: 0.1 to 12 m at "
        "90 % reflectivity, accuracy +-6 cm to 6 m and 1 % beyond, resolution 1 cm, 100 "
        "Hz",
    ),
    # A flawless single beam, for the height above ground.
    "ideal-altimeter": Rangefinder(
        range=10.0,
        rate=20.0,
        no_return_is_free=True,
        source="assumed: a single-beam time-of-flight sensor of the 12 m class, such as TFmini-S",
    ),
    # A flawless depth camera that reports ranges along its pixels' rays.
    "ideal-depth-camera": DepthCamera(
        height=48,
        width=64,
        field_of_view_horizontal=math.radians(87.0),
        field_of_view_vertical=math.radians(58.0),
        measures="range",
        range=6.0,
        rate=10.0,
        no_return_is_free=True,
        source="Intel RealSense D455 data sheet: 87 x 58 degrees, ideal range to 6 m; binned "
        "pixels",
    ),
    # A flawless spinning lidar of a hundred thousand beams, to measure the loop with.
    "ideal-lidar-dense": SpinningLidar(
        elevations=evenly(math.radians(-45.0), math.radians(45.0), 100),
        azimuths=1000,
        range=12.0,
        rate=10.0,
        no_return_is_free=True,
        source="assumed: a round number of beams, about one and a half times those of a 64-ring "
        "lidar",
    ),
    # A flawless spinning lidar tilted toward the floor, for robots that walk.
    "ideal-lidar-floor": SpinningLidar(
        elevations=evenly(math.radians(-45.0), math.radians(15.0), 32),
        azimuths=625,
        range=12.0,
        rate=10.0,
        no_return_is_free=True,
        source="assumed: a 32-ring spinning lidar, 20 000 beams a sweep, tilted to see the near "
        "floor",
    ),
    # A flawless spinning lidar that sees as far up as down, for robots that fly.
    "ideal-lidar-wide": SpinningLidar(
        elevations=evenly(math.radians(-45.0), math.radians(45.0), 32),
        azimuths=512,
        range=12.0,
        rate=10.0,
        no_return_is_free=True,
        source="Ouster OS0-32 data sheet: 32 rings over 90 degrees, 512 columns, 10 Hz; range cut",
    ),
    # Intel RealSense D435: a stereo depth camera whose error grows with the squared depth.
    "intel-realsense-d435": DepthCamera(
        height=60,
        width=106,
        field_of_view_horizontal=math.radians(87.0),
        field_of_view_vertical=math.radians(58.0),
        range=3.0,
        minimum_range=0.3,
        rate=30.0,
        noise=RangeNoise(
            sigma_quadratic=D435_DISPARITY_ERROR / (D435_FOCAL_LENGTH * D435_BASELINE)
        ),
        no_return_is_free=False,
        source="Intel, RealSense Product Family D400 Series data sheet 337029: 87 x 58 degrees, "
        "848 x 480 pixels (every 8th here), ideal range 0.3 to 3 m, 30 Hz, depth in mm; "
        "error by Grunnet-Jepsen, Sweetser and Woodfill, Tuning depth cameras for best "
        "performance, rev. 2.0",
    ),
    # Livox Mid-360: a small lidar with a full circle of view and a non-repetitive pattern.
    "livox-mid360": SolidStateLidar(
        elevation_low=math.radians(-7.0),
        elevation_high=math.radians(52.0),
        # Assumed, as the maker states no law of the pattern: directions 0.1 degrees apart and
        # strokes 5 degrees of azimuth apart, which shift so that one sweep meets 0.4 of all
        # squares of one degree, and a second's ten sweeps 0.99 of them.
        rows=591,
        columns=3599,
        row_step=11,
        column_step=1,
        beams=20_000,
        scan_poses=16,
        range=40.0,
        minimum_range=0.1,
        rate=10.0,
        noise=RangeNoise(sigma=0.02),
        no_return_is_free=False,
        source="Livox, Mid-360 User Manual v1.0: 360 degrees by -7 to 52 degrees, 200 000 "
        "points/s, 40 m at 10 % reflectivity, blind to 0.1 m, range precision 2 cm at 10 "
        "m",
    ),
    # Ouster OS1-64: a spinning lidar with a dense column of rings.
    "ouster-os1-64": SpinningLidar(
        elevations=evenly(math.radians(-16.6), math.radians(16.6), 64),
        azimuths=1024,
        scan_poses=16,
        range=40.0,
        minimum_range=0.8,
        rate=10.0,
        noise=RangeNoise(sigma=0.015, quantum=0.012),
        no_return_is_free=False,
        source="Ouster, OS1 High Resolution Imaging Lidar data sheet (850 nm): 64 rings over "
        "+-16.6 degrees, 1024 columns, 10 Hz, 0.8 to 40 m at 10 % reflectivity, "
        "repeatability 1.5 cm at high signal, resolution 1.2 cm",
    ),
    # Velodyne VLP-16 (Puck): the 16-ring spinning lidar of many outdoor robots.
    "velodyne-vlp16": SpinningLidar(
        elevations=evenly(math.radians(-15.0), math.radians(15.0), 16),
        azimuths=1808,  # firing cycles of 55.296 us in a turn of 0.1 s
        scan_poses=16,
        range=65.5,
        minimum_range=0.4,
        rate=10.0,
        noise=RangeNoise(sigma=0.03, quantum=0.002),
        no_return_is_free=False,
        source="Velodyne, VLP-16 User Manual 63-9243 Rev D and Puck data sheet: 16 rings 2 "
        "degrees apart, a cycle each 55.296 us, steps of 2 mm, accuracy +-3 cm, 100 m "
        "(cut to what a log holds); nearest distance as the ROS driver "
        "velodyne_pointcloud sets it",
    ),
}

__all__ = [
    "DEVICES",
    "OWN",
    "DepthCamera",
    "Device",
    "Mount",
    "RangeNoise",
    "Rangefinder",
    "SensorConfig",
    "SolidStateLidar",
    "SpinningLidar",
    "evenly",
]
