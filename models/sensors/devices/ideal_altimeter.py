"""A flawless single beam, for the height above ground."""

from wayproof.models.sensors.devices.rangefinder import Rangefinder

IDEAL_ALTIMETER = Rangefinder(
    range=10.0,
    rate=20.0,
    no_return_is_free=True,
    source="assumed: a single-beam time-of-flight sensor of the 12 m class, such as TFmini-S",
)
