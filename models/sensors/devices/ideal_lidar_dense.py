"""A flawless spinning lidar of a hundred thousand beams, to measure the loop with."""

import math

from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly

IDEAL_LIDAR_DENSE = SpinningLidar(
    elevations=evenly(math.radians(-45.0), math.radians(45.0), 100),
    azimuths=1000,
    range=12.0,
    rate=10.0,
    no_return_is_free=True,
    source="assumed: a round number of beams, about one and a half times those of a 64-ring lidar",
)
