"""A flawless spinning lidar that sees as far up as down, for robots that fly."""

import math

from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly

IDEAL_LIDAR_WIDE = SpinningLidar(
    elevations=evenly(math.radians(-45.0), math.radians(45.0), 32),
    azimuths=512,
    range=12.0,
    rate=10.0,
    no_return_is_free=True,
    source="Ouster OS0-32 data sheet: 32 rings over 90 degrees, 512 columns, 10 Hz; range cut",
)
