"""Settings of the section `estimate`: where the pose comes from that stack and controller get."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from wayproof.bounds import Bounds, check_fields

EstimatorKind = Literal["model", "truth", "lidar"]


@dataclass(frozen=True)
class EstimateConfig:
    """The estimator of the pose; class variables are its constants.

    Attributes:
        kind: `model`: the truth with errors drawn by `pose_model.*`; `truth`: without errors;
            `lidar`: odometry that registers the sweeps, after a prediction by inertial sensors and
            legs.
        spacing: Distance between points of a sweep that are registered, m.
        sweep_noise_share: Noise of a sweep's registration, as a share of the residuals' standard
            deviation. The prediction is weighed against it as if it were one mean point; the
            residuals' deviation is taken from their median. The smaller, the more a sweep counts.
        map_error_share: Error that a registration leaves in the map and in the stated covariance,
            as a share of the residuals' standard deviation. It counts once for each sweep in that
            part of the map. Calibrated from logs with truth (docs/sensors.md).
        motion_share: Standard deviation of the motion by feet or an odometry along directions that
            the scene does not hold, as a share of the motion. The quadruped's feet roll as it
            walks, which costs 1 to 2.5 % of the way in `tunnel` and `hall`.
        turn_share: Standard deviation of a turn by an odometry, as a share of it, beside the
            gyroscope's errors. A recording of planar lasers has 0.2, as wheels alone give the turn
            there: default of `stt` in ROS's slam_gmapping (of GMapping: Grisetti, Stachniss and
            Burgard 2007, T-RO 23), as 0.1 of `turn_walk` and `motion_share` of `str` and `srr`.
        turn_walk: Standard deviation of the heading that an odometry adds by the length of the
            step, rad/m; 0.1 for planar lasers.
    """

    kind: EstimatorKind = "model"
    spacing: Annotated[float, Bounds(0.02, 5.0, "m")] = 0.2
    sweep_noise_share: Annotated[float, Bounds(0.001, 10.0)] = 0.05
    map_error_share: Annotated[float, Bounds(0.0, 10.0)] = 0.0115
    motion_share: Annotated[float, Bounds(0.0, 1.0)] = 0.03
    turn_share: Annotated[float, Bounds(0.0, 1.0)] = 0.0
    turn_walk: Annotated[float, Bounds(0.0, 1.0, "rad/m")] = 0.0

    voxel: ClassVar[float] = 0.3
    """Edge of the voxels of the odometry's map, each with one plane, m."""

    gyro_noise: ClassVar[float] = 2.4e-4
    """Noise density of the gyroscope, rad/s for the root of a hertz. Bosch BMI088, data sheet
    BST-BMI088-DS001: 0.014 deg/s."""

    gyro_bias: ClassVar[float] = 1e-4
    """Standard deviation of its constant bias, rad/s; assumed: what an estimate at rest leaves."""

    accelerometer_noise: ClassVar[float] = 1.9e-3
    """Noise density, m/s^2 for the root of a hertz. The same data sheet: 190 ug."""

    accelerometer_bias: ClassVar[float] = 0.02
    """Standard deviation of its constant bias on each axis, m/s^2; assumed: 2 mg, with what the
    tilt of the attitude leaves of gravity."""

    leg_noise: ClassVar[float] = 0.02
    """Standard deviation of each velocity that the standing feet give, m/s; assumed: 5 mrad/s of
    each joint at legs of 0.4 m, and the feet's give."""

    held: ClassVar[float] = 0.04
    """Least information of a direction that the scene holds: eigenvalue of the mean of n n' over
    the normals n of the registered points, 0 to 1/3 for the least of three. Below it the sweep has
    no say along the direction (Zhang, Kaess and Singh 2016, ICRA, "On degeneracy of
    optimization-based state estimation problems")."""

    registered_share: ClassVar[float] = 0.5
    """Least share of a sweep's points that lie on a plane of the map, among those in voxels that
    the map knows. With less, beyond chance, the sweep has no say and is not mapped: noise hides the
    planes. Exact sweeps in the worlds have 0.78 and more, those of an OS1 too; of a drone with a
    noise of 3 cm 0.6 to 0.75, with 4.5 cm 0.25 to 0.45."""

    surface_roughness: ClassVar[float] = 0.0002
    """Standard deviation of the map's planes from the surfaces in the error that `map_error_share`
    scales, m; calibrated likewise."""

    position_floor: ClassVar[float] = 0.00003
    """Standard deviation that each registration adds to that of its part of the map, m."""

    heading_floor: ClassVar[float] = 0.00007
    """Standard deviation that each registration adds to that of its heading, rad; likewise."""

    motion_walk: ClassVar[float] = 0.012
    """Standard deviation that the feet, or an odometry, add along each direction that the scene
    does not hold, also across the way, m for the root of a metre; from the episodes of
    `motion_share`."""

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "estimate.")
