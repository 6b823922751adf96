"""Livox Mid-360: a small lidar with a full circle of view and a non-repetitive pattern."""

import math

from wayproof.models.sensors.devices.noise import RangeNoise
from wayproof.models.sensors.devices.solid_state_lidar import SolidStateLidar

LIVOX_MID360 = SolidStateLidar(
    elevation_low=math.radians(-7.0),
    elevation_high=math.radians(52.0),
    # Assumed, as the maker states no law of the pattern: directions 0.1 degrees apart and strokes
    # 5 degrees of azimuth apart, which shift so that one sweep meets 0.4 of all squares of one
    # degree, and a second's ten sweeps 0.99 of them.
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
    source="Livox, Mid-360 User Manual v1.0: 360 degrees by -7 to 52 degrees, 200 000 points/s, "
    "40 m at 10 % reflectivity, blind to 0.1 m, range precision 2 cm at 10 m",
)
