"""A flawless spinning lidar tilted toward the floor, for robots that walk."""

import math

from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly

IDEAL_LIDAR_FLOOR = SpinningLidar(
    elevations=evenly(math.radians(-45.0), math.radians(15.0), 32),
    azimuths=625,
    range=12.0,
    rate=10.0,
    no_return_is_free=True,
    source="assumed: a 32-ring spinning lidar, 20 000 beams a sweep, tilted to see the near floor",
)
