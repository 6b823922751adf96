"""Benewake TFmini-S: a single-beam time-of-flight rangefinder, such as drones carry downward."""

from wayproof.models.sensors.devices.noise import RangeNoise
from wayproof.models.sensors.devices.rangefinder import Rangefinder

BENEWAKE_TFMINI_S = Rangefinder(
    range=12.0,
    minimum_range=0.1,
    rate=100.0,
    # +-6 cm to 6 m, then 1 %: at 12 m the root of 0.06^2 + (0.00866 * 12)^2 is the 12 cm of 1 %.
    noise=RangeNoise(sigma=0.06, sigma_proportional=0.00866, quantum=0.01),
    no_return_is_free=False,
    source="Benewake, TFmini-S LiDAR Module data sheet SJ-GU-TFmini-S-01 A00: 0.1 to 12 m at 90 % "
    "reflectivity, accuracy +-6 cm to 6 m and 1 % beyond, resolution 1 cm, 100 Hz",
)
