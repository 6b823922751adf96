"""Messages of makers of sensors and autopilots: a file each, and its line here."""

from wayproof.harness.recordings.bags.parts import Vendor
from wayproof.harness.recordings.bags.vendors import livox, nav2, px4, velodyne

VENDORS: tuple[Vendor, ...] = (
    livox.VENDOR,
    velodyne.VENDOR,
    px4.VENDOR,
    nav2.VENDOR,
)
