"""Velodyne VLP-16 (Puck): the 16-ring spinning lidar of many outdoor robots."""

import math

from wayproof.models.sensors.devices.noise import RangeNoise
from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly

VELODYNE_VLP16 = SpinningLidar(
    elevations=evenly(math.radians(-15.0), math.radians(15.0), 16),
    azimuths=1808,  # firing cycles of 55.296 us in a turn of 0.1 s
    scan_poses=16,
    range=65.5,
    minimum_range=0.4,
    rate=10.0,
    noise=RangeNoise(sigma=0.03, quantum=0.002),
    no_return_is_free=False,
    source="Velodyne, VLP-16 User Manual 63-9243 Rev D and Puck data sheet: 16 rings 2 degrees "
    "apart, a cycle each 55.296 us, steps of 2 mm, accuracy +-3 cm, 100 m (cut to what a log "
    "holds); nearest distance as the ROS driver velodyne_pointcloud sets it",
)
