"""Ouster OS1-64: a spinning lidar with a dense column of rings."""

import math

from wayproof.models.sensors.devices.noise import RangeNoise
from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly

OUSTER_OS1_64 = SpinningLidar(
    elevations=evenly(math.radians(-16.6), math.radians(16.6), 64),
    azimuths=1024,
    scan_poses=16,
    range=40.0,
    minimum_range=0.8,
    rate=10.0,
    noise=RangeNoise(sigma=0.015, quantum=0.012),
    no_return_is_free=False,
    source="Ouster, OS1 High Resolution Imaging Lidar data sheet (850 nm): 64 rings over +-16.6 "
    "degrees, 1024 columns, 10 Hz, 0.8 to 40 m at 10 % reflectivity, repeatability 1.5 cm at high "
    "signal, resolution 1.2 cm",
)
