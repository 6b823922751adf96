"""Range sensors by name; a new one, of a known or a new kind, is a file and a line in `DEVICES`.

Presets say in `source` which data sheet they follow. Where a sheet gives an accuracy of +- x, x is
read as one standard deviation, which does not flatter the sensor. No sheet states how many returns
are lost, so presets lose none.
"""

from __future__ import annotations

from wayproof.models.sensors.devices.benewake_tfmini_s import BENEWAKE_TFMINI_S
from wayproof.models.sensors.devices.config import OWN, SensorConfig
from wayproof.models.sensors.devices.depth_camera import DepthCamera
from wayproof.models.sensors.devices.device import Device, Mount
from wayproof.models.sensors.devices.ideal_altimeter import IDEAL_ALTIMETER
from wayproof.models.sensors.devices.ideal_depth_camera import IDEAL_DEPTH_CAMERA
from wayproof.models.sensors.devices.ideal_lidar_dense import IDEAL_LIDAR_DENSE
from wayproof.models.sensors.devices.ideal_lidar_floor import IDEAL_LIDAR_FLOOR
from wayproof.models.sensors.devices.ideal_lidar_wide import IDEAL_LIDAR_WIDE
from wayproof.models.sensors.devices.intel_realsense_d435 import INTEL_REALSENSE_D435
from wayproof.models.sensors.devices.livox_mid360 import LIVOX_MID360
from wayproof.models.sensors.devices.noise import RangeNoise
from wayproof.models.sensors.devices.ouster_os1_64 import OUSTER_OS1_64
from wayproof.models.sensors.devices.rangefinder import Rangefinder
from wayproof.models.sensors.devices.solid_state_lidar import SolidStateLidar
from wayproof.models.sensors.devices.spinning_lidar import SpinningLidar, evenly
from wayproof.models.sensors.devices.velodyne_vlp16 import VELODYNE_VLP16

DEVICES: dict[str, Device] = {
    "benewake-tfmini-s": BENEWAKE_TFMINI_S,
    "ideal-altimeter": IDEAL_ALTIMETER,
    "ideal-depth-camera": IDEAL_DEPTH_CAMERA,
    "ideal-lidar-dense": IDEAL_LIDAR_DENSE,
    "ideal-lidar-floor": IDEAL_LIDAR_FLOOR,
    "ideal-lidar-wide": IDEAL_LIDAR_WIDE,
    "intel-realsense-d435": INTEL_REALSENSE_D435,
    "livox-mid360": LIVOX_MID360,
    "ouster-os1-64": OUSTER_OS1_64,
    "velodyne-vlp16": VELODYNE_VLP16,
}

__all__ = [
    "DEVICES",
    "OWN",
    "DepthCamera",
    "Device",
    "Mount",
    "RangeNoise",
    "Rangefinder",
    "SensorConfig",
    "SolidStateLidar",
    "SpinningLidar",
    "evenly",
]
