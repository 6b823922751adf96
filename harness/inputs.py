"""Inputs of a decision: poses and sweeps exactly as they are in the log."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.listed_beams import ListedBeams, Mount
from wayproof.harness.prediction.predicted_box import PredictedBox
from wayproof.maps.elementary import norm
from wayproof.maps.sweep import Ranges, Spared
from wayproof.models.poses import Trail, rotation_matrices
from wayproof.models.sensors.beams import (
    DROPPED,
    NO_RETURN,
    BeamTable,
    directions,
    pose_indices,
    pose_offsets,
    ray_ranges,
    rotate,
)

NONE_UNHELD = np.zeros((0, 3))
"""Empty array of directions that the sweeps do not hold; read-only, as poses share it."""

NONE_UNHELD.flags.writeable = False


@dataclass(frozen=True)
class Pose:
    """The estimated pose T_world_base.

    Attributes:
        position: (3,) m.
        quaternion: (4,) w x y z.
        position_sigma: Stated standard deviation along the axis where it is greatest, m.
        heading_sigma: Stated standard deviation of the heading, rad.
        trail: Estimated poses while the sweeps were taken, up to this one; none without a rolling
            shutter.
        covariance: (4, 4) stated covariance of x, y, z, m, and heading, rad, in world axes; none if
            the estimator states standard deviations alone.
        unheld: (k, 3) unit directions along which the sweeps do not hold the position.
        age_ns: Time since it was estimated, by its own stamp, ns.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    position_sigma: float
    trail: Trail | None = None
    heading_sigma: float = 0.0
    covariance: NDArray[np.float64] | None = None
    unheld: NDArray[np.float64] = field(default_factory=lambda: NONE_UNHELD)
    age_ns: int = 0

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """R_world_base, (3, 3)."""
        R_world_base: NDArray[np.float64] = rotation_matrices(self.quaternion[None])[0]
        return R_world_base

    @property
    def heading(self) -> float:
        """Yaw, rad."""
        return yaw_of_quaternion(self.quaternion)


@dataclass(frozen=True)
class WorldSweep:
    """A sweep's beams in the world frame.

    Attributes:
        origins: (m, 3) position of the sensor at each moment, m.
        directions: (n, 3) unit vectors.
        ranges_mm: (n,) along the beams.
        moments: (n,) int32 index of the origin of each beam.
        spared: Layer that beams which end in it do not clear.
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    ranges_mm: Ranges
    moments: NDArray[np.int32]
    spared: Spared = "none"

    @property
    def points(self) -> NDArray[np.float64]:  # (k, 3)
        """The returns, world frame, m."""
        return self.points_within(math.inf)

    def points_within(self, range_m: float) -> NDArray[np.float64]:  # (k, 3)
        """Select the returns of at most a range, world frame, m."""
        returned = (self.ranges_mm != DROPPED) & (self.ranges_mm != NO_RETURN)
        returned &= self.ranges_mm <= range_m * 1e3
        along = self.ranges_mm[returned, None] * 1e-3 * self.directions[returned]
        points: NDArray[np.float64] = self.origins[self.moments[returned]] + along
        return points

    def without_no_returns(self) -> WorldSweep:
        """Return the sweep with beams without return dropped."""
        return self.without(self.ranges_mm == NO_RETURN)

    def without(self, beams: NDArray[np.bool_]) -> WorldSweep:
        """Return the sweep with some beams (n,) dropped: they give no information."""
        ranges_mm = self.ranges_mm.copy()
        ranges_mm[beams] = DROPPED
        return replace(self, ranges_mm=ranges_mm)


class Beams:
    """One sensor's geometry, rebuilt from its logged tables."""

    def __init__(
        self,
        table: BeamTable,
        range: float,
        rate: float,
        position_base_sensor: NDArray[np.float64],
        R_base_sensor: NDArray[np.float64],
    ) -> None:
        """Keep the tables, the range in m, the rate in Hz, and T_base_sensor."""
        self.table = table
        self.range = range
        self.rate = rate
        if not table.listed:
            self._ages = (-1e-9 * pose_offsets(table, round(1e9 / rate))).astype(np.float64)
            self._moments = pose_indices(table)
            self._directions = directions(table, 0)
        self._position_base_sensor = position_base_sensor
        self._R_base_sensor = R_base_sensor

    @property
    def mounting(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """T_base_sensor: position (3,), m, and rotation (3, 3)."""
        return self._position_base_sensor, self._R_base_sensor

    @property
    def is_image(self) -> bool:
        """Whether the beams are a grid whose rows have neighbouring beams."""
        return self.table.order == "grid" and len(self.table.columns) > 2

    @cached_property
    def column_step(self) -> float:
        """Distance of neighbouring beams of a grid's row at a range of 1 m, about, m."""
        return norm(self.table.columns[1] - self.table.columns[0])

    def directions_in_base(self) -> NDArray[np.float64]:
        """Return unit directions (n, 3) of the beams in the base's frame; none of listed beams."""
        if self.table.listed:
            return np.empty((0, 3))
        return rotate(self._R_base_sensor, self._directions)

    def place(self, sweep: SweepInput, pose: Pose, sequence: int) -> WorldSweep:
        """Transform a sweep into the world frame by an estimated pose.

        Raises:
            InputError: The sweep has another number of beams, or its shutter rolls and the pose
                has no trail.
        """
        if self.table.listed:
            return self._place_listed(sweep, pose)
        if len(sweep.ranges_mm) != self.table.beams or sweep.ranges_mm.dtype != np.uint16:
            raise InputError(
                f"sweep of '{sweep.sensor}': {len(sweep.ranges_mm)} beams, "
                f"expected {self.table.beams}"
            )
        if self.table.non_repetitive:
            self._directions = directions(self.table, sequence - sweep.lag)
        several = self.table.scan_poses > 1
        origins, rotations = self._poses(pose, self._ages if several else None, *sweep.mount)
        one = len(rotations) == 1
        beams = rotate(rotations[0] if one else rotations[self._moments], self._directions)
        ranges = ray_ranges(self.table, self._directions, sweep.ranges_mm)
        return WorldSweep(origins, beams, ranges, self._moments)

    def _place_listed(self, sweep: SweepInput, pose: Pose) -> WorldSweep:
        beams = sweep.beams
        if beams is None:
            raise InputError(f"sweep of '{sweep.sensor}': no beams, expected a list of them")
        position, R = beams.position_base_sensor, beams.R_base_sensor
        ages = beams.ages if beams.ages.any() else None
        origins, rotations = self._poses(pose, ages, position, R)
        one = len(rotations) == 1
        placed = rotate(rotations[0] if one else rotations[beams.poses], beams.directions)
        return WorldSweep(origins, placed, sweep.ranges_mm, beams.poses)

    def _poses(
        self,
        pose: Pose,
        ages: NDArray[np.float64] | None,
        position_base_sensor: NDArray[np.float64] | None = None,
        R_base_sensor: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return estimated poses of the sensor: (m, 3), m, and (m, 3, 3), world.

        Args:
            pose: Pose of the base at the time of the decision.
            ages: (m,) before that, s; None for that time alone.
            position_base_sensor: (3,) m, in place of the sensor's own.
            R_base_sensor: (3, 3) likewise.
        """
        mounted, R = position_base_sensor, R_base_sensor
        if mounted is None or R is None:
            mounted, R = self._position_base_sensor, self._R_base_sensor
        positions, rotations = pose.position[None], pose.rotation[None]
        if ages is not None:
            if pose.trail is None:
                raise InputError("pose without a trail, expected one for a rolling shutter")
            positions, rotations = pose.trail.before_now(ages)
        origins = positions + turn(rotations, mounted[None])[:, 0]
        R_sensor_world = turn(rotations, R.T)
        return origins, np.ascontiguousarray(R_sensor_world.transpose(0, 2, 1))


def turn(rotations: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (k, 3) turned by each rotation (m, 3, 3), element by element: (m, k, 3)."""
    along = rotations[:, None] * vectors[None, :, None]  # (m, k, 3, 3)
    turned: NDArray[np.float64] = along[..., 0] + along[..., 1] + along[..., 2]
    return turned


@dataclass(frozen=True)
class SweepInput:
    """One sweep of a sensor.

    Attributes:
        sensor: Its name.
        ranges_mm: (n,) mm.
        classes: (n,) uint8 class of what each beam hit, if there are any.
        beams: Beams of a sweep that lists them; else those of the sensor's tables.
        mount: T_base_sensor of a sweep by tables, if it is not that of the sensor.
        age_ns: Time since it was taken, by its own stamp, ns.
        lag: Number of sweeps since it was taken in truth, which a pattern of beams goes by.
    """

    sensor: str
    ranges_mm: Ranges
    classes: NDArray[np.uint8] | None = None
    beams: ListedBeams | None = None
    mount: Mount = (None, None)
    age_ns: int = 0
    lag: int = 0


@dataclass(frozen=True)
class Inputs:
    """All that a decision depends on besides the decisions before it.

    Attributes:
        time_ns: Simulated time of the sweeps.
        sequence: Number of the decision.
        pose: Estimated pose at that time.
        sweeps: Sweeps in the order in which they are integrated.
        digest: Hash of the messages that these were read from.
        goal: (3,) m, goal of this decision; None if it is the mission's.
        goals_reached: Number of goals reached before; 0 of a recording.
        prediction: Prediction of the map before by a predictor from outside; None without one, and
            where it has no opinion.
    """

    time_ns: int
    sequence: int
    pose: Pose
    sweeps: tuple[SweepInput, ...]
    digest: str
    goal: NDArray[np.float64] | None = None
    goals_reached: int = 0
    prediction: PredictedBox | None = None
