"""Other lidar odometries behind one interface: small_gicp, KISS-ICP and GenZ-ICP, on one thread.

All get points in the body's frame and start at a known pose; none gets a motion prior but its own
constant velocity.
"""

from __future__ import annotations

import importlib
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError

Array = NDArray[np.float64]

EXTRA = "expected the extra 'estimators'"

VOXEL = 0.5
"""Edge of the voxels of a peer's map, m; GenZ-ICP takes half of it."""

SPACING = 0.1
"""Distance between the points that small_gicp registers, m."""

RANGE = 100.0
"""Longest range that is used, m."""


class Peer(Protocol):
    """An odometry."""

    def register(self, points: Array, ages: Array) -> Array:
        """Register points (k, 3), m, of ages (k,), s; return T_start_base, (4, 4)."""


class SmallGicp:
    """Registration of small_gicp (Koide 2024, JOSS 9) with a map of Gaussian voxels."""

    def __init__(self, deskew: bool) -> None:
        """Start with an empty map; it has no correction of rolling sweeps."""
        del deskew
        self._library = imported("small_gicp")
        self._map: Any = None
        self._pose, self._step = np.eye(4), np.eye(4)

    def register(self, points: Array, ages: Array) -> Array:
        """Register with the map at constant velocity, and add the points to it."""
        del ages
        library = self._library
        cloud, _ = library.preprocess_points(
            points, downsampling_resolution=SPACING, num_neighbors=10, num_threads=1
        )
        if self._map is None:
            self._map = library.GaussianVoxelMap(VOXEL)
            self._map.set_lru(horizon=1_000_000, clear_cycle=1_000_000)
        else:
            found = library.align(
                self._map,
                cloud,
                init_T_target_source=self._pose @ self._step,
                max_correspondence_distance=1.0,
                num_threads=1,
                max_iterations=20,
            )
            self._step = np.linalg.inv(self._pose) @ found.T_target_source
            self._pose = found.T_target_source
        self._map.insert(cloud, self._pose)
        return self._pose.copy()


class KissIcp:
    """KISS-ICP (Vizzo et al. 2023, RA-L 8)."""

    def __init__(self, deskew: bool) -> None:
        """Start with an empty map."""
        config = imported("kiss_icp.config").KISSConfig()
        config.mapping.voxel_size = VOXEL
        config.data.max_range, config.data.min_range = RANGE, 0.1
        config.data.deskew = deskew
        config.registration.max_num_threads = 1
        self._odometry = imported("kiss_icp.kiss_icp").KissICP(config)

    def register(self, points: Array, ages: Array) -> Array:
        """Register with the map, and add the points to it."""
        self._odometry.register_frame(points, _shares(ages))
        return np.array(self._odometry.last_pose)


class GenzIcp:
    """GenZ-ICP (Lee et al. 2025, RA-L 10); it takes all processors that it is allowed."""

    def __init__(self, deskew: bool) -> None:
        """Start with an empty map."""
        config = imported("genz_icp.config").GenZConfig()
        config.mapping.voxel_size = 0.5 * VOXEL
        config.mapping.map_cleanup_radius = RANGE
        config.data.max_range, config.data.min_range = RANGE, 0.1
        config.data.deskew = deskew
        self._odometry = imported("genz_icp.genz_icp").GenZICP(config)

    def register(self, points: Array, ages: Array) -> Array:
        """Register with the map, and add the points to it."""
        self._odometry.register_frame(points, _shares(ages))
        return np.array(self._odometry.last_pose)


PEERS: dict[str, type[SmallGicp] | type[KissIcp] | type[GenzIcp]] = {
    "small_gicp": SmallGicp,
    "kiss_icp": KissIcp,
    "genz_icp": GenzIcp,
}


def imported(name: str) -> Any:
    """Import a module of a peer.

    Raises:
        InputError: It is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(f"{name.partition('.')[0]}: not installed, {EXTRA}") from None


def _shares(ages: Array) -> Array:
    """Return times as shares of a sweep, 0 to 1: both libraries bring points to its end."""
    longest = float(ages.max(initial=0.0))
    return 1.0 - ages / longest if longest > 0.0 else np.ones(len(ages))
