"""Intel RealSense D435: a stereo depth camera whose error grows with the squared depth."""

import math

from wayproof.models.sensors.devices.depth_camera import DepthCamera
from wayproof.models.sensors.devices.noise import RangeNoise

BASELINE = 0.050  # m
FOCAL_LENGTH = 848 / 2 / math.tan(math.radians(90.0) / 2)  # pixels
DISPARITY_ERROR = 0.1  # pixels: the most that is expected of a well textured surface

INTEL_REALSENSE_D435 = DepthCamera(
    height=60,
    width=106,
    field_of_view_horizontal=math.radians(87.0),
    field_of_view_vertical=math.radians(58.0),
    range=3.0,
    minimum_range=0.3,
    rate=30.0,
    noise=RangeNoise(sigma_quadratic=DISPARITY_ERROR / (FOCAL_LENGTH * BASELINE)),
    no_return_is_free=False,
    source="Intel, RealSense Product Family D400 Series data sheet 337029: 87 x 58 degrees, 848 x "
    "480 pixels (every 8th here), ideal range 0.3 to 3 m, 30 Hz, depth in mm; error by "
    "Grunnet-Jepsen, Sweetser and Woodfill, Tuning depth cameras for best performance, rev. 2.0",
)
