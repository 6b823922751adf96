"""A flawless depth camera that reports ranges along its pixels' rays."""

import math

from wayproof.models.sensors.devices.depth_camera import DepthCamera

IDEAL_DEPTH_CAMERA = DepthCamera(
    height=48,
    width=64,
    field_of_view_horizontal=math.radians(87.0),
    field_of_view_vertical=math.radians(58.0),
    measures="range",
    range=6.0,
    rate=10.0,
    no_return_is_free=True,
    source="Intel RealSense D455 data sheet: 87 x 58 degrees, ideal range to 6 m; binned pixels",
)
