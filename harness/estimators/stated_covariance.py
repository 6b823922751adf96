"""Covariance that a lidar odometry states: that of the map it is held by, and what nothing held.

An odometry that registers sweeps with a map of its own is off by what the map is off by. So each
sweep that is mapped keeps the covariance of its pose, and a sweep that is registered has that of
the sweeps that its voxels are by, and an error of its own on top. The inverse of the normal
equations says nothing of the size of that error: residuals of neighbouring beams are one error.
It is taken as a share of that of a single distance, calibrated from logs with truth, with the
residuals' standard deviation and that of the planes from the surfaces.

Along each direction that the sweeps do not hold it grows by a share of the whole predicted motion
since they last did, and by a walk with the length of the way: steps err to the side, too. Where
only an accelerometer predicts, it grows as the filter of the motion says, by what velocity and
bias are known to: the estimate of a body at rest drifts.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.alignment import FIXED
from wayproof.harness.estimators.matrices import inverse, projected
from wayproof.harness.estimators.surface_map import Registration
from wayproof.models.arrays import Array
from wayproof.models.snapshot import Kept

HEADING = 3
"""Row of the heading."""


LEAST_LEVER = 1e-3
"""Mean square of the lever by which distances measure the heading, m^2, that is always there."""

HELD_LEVER = 0.01
"""Mean square of that lever below which a sweep does not hold the heading, m^2: a floor alone has
1e-4 m^2 by the tilt of its planes, a bare tunnel has some square metres."""

LEAST_SHARE = 1e-3
"""Least share of the distances that measures an axis, below which there is no mean of them."""

LEVEL = 0.5
"""Sine of the slope up to which a direction is level: wheels do not leave the ground."""

SYSTEMATIC = 5.0
"""Variance of the error that all distances of a sweep have alike, in that of one distance."""


class StatedCovariance(Kept):
    """Covariance (4, 4) of x, y, z, m, and heading, rad, in world axes.

    Attributes:
        axes: (k, 3) unit directions that the last sweep did not hold.
        information: (3,) of the last registration.
    """

    KEPT = (
        *("_held", "_moved", "_turned_s", "_slid", "_slid_turn", "_heading_held"),
        *("axes", "information"),
    )
    """All but the kept map, which follows from the poses."""

    def __init__(self, config: EstimateConfig) -> None:
        """Start at a known pose."""
        self._config = config
        self._floor = np.diag([config.position_floor**2] * 3 + [config.heading_floor**2])
        self._held = self._floor.copy()  # without the motion that nothing holds
        self._moved = np.zeros(3)  # motion by feet or odometry since the sweeps held all of it
        self._turned_s = 0.0  # time since a sweep held the heading
        self._slid = 0.0  # how far an odometry is astray along a level direction, m
        self._slid_turn = 0.0  # likewise of the heading, rad
        self._positions: list[Array] = []  # (3,) of the poses of the mapped sweeps, m
        self._covariances: list[Array] = []  # (4, 4) of these
        self.axes = np.eye(3)  # until a sweep is registered
        self._heading_held = False
        self.information = np.zeros(3)

    def predict(
        self,
        step: Array,
        period: float,
        inertial: Array | None,
        turn_variance: float = 0.0,
        astray: tuple[Array, Array] | None = None,
    ) -> None:
        """Grow over a predicted step.

        Args:
            step: (3,) m.
            period: Its time, s.
            inertial: (3, 3) by which the covariance of the position has grown in the filter of the
                motion if the accelerometer predicted the step, m^2; none if feet or an odometry
                did.
            turn_variance: Variance of the heading that the odometry's step adds, rad^2.
            astray: Further growth of its error, as of `Slip.predict`; None but for wheels,
                which do not leave the ground: their height is that of the recording.
        """
        config = self._config
        self._held = moved_by(self._held, step)
        if inertial is None:
            self._moved = self._moved + self._unheld(step)
        walked = config.motion_walk**2 * math.sqrt(float((step * step).sum()))
        for axis in self.axes if astray is None else self._levels():
            grown = walked
            if inertial is not None:
                grown = max(0.0, float((axis[:, None] * inertial * axis).sum()))
            self._held[:3, :3] += grown * axis[:, None] * axis[None, :]
        if not self._heading_held:
            before = config.gyro_bias * self._turned_s
            self._turned_s += period
            self._held[HEADING, HEADING] += (config.gyro_bias * self._turned_s) ** 2 - before**2
            self._held[HEADING, HEADING] += config.gyro_noise**2 * period + turn_variance
        if astray is not None:
            self._go_astray(*astray)

    def correct(self, registration: Registration, position: Array) -> None:
        """Take over the map's covariance along held directions, where the unheld motion has ended.

        Args:
            registration: Registration of a sweep.
            position: (3,) estimated by it, m.
        """
        self.axes, self.information = registration.unheld, registration.information
        lever = float(registration.moment[HEADING, HEADING])
        self._heading_held = len(self.axes) < 3 and lever >= HELD_LEVER
        if len(self.axes) == 3:
            return
        self._moved = self._unheld(self._moved)
        if not self._levels():
            self._slid = 0.0
        held, unheld = np.eye(4), np.zeros((4, 4))
        for axis in self.axes:
            along = np.append(axis, 0.0)[:, None] * np.append(axis, 0.0)
            held, unheld = held - along, unheld + along
        if self._heading_held:
            self._turned_s = self._slid_turn = 0.0
        else:
            held[HEADING, HEADING], unheld[HEADING, HEADING] = 0.0, 1.0
        stays = projected(unheld, self._held)
        self._held = stays + projected(held, self._by_map(registration, position))

    def add_to_map(self, position: Array, covariance: Array) -> None:
        """Keep the pose of a sweep that is mapped: (3,) m, and its covariance (4, 4)."""
        self._positions.append(np.array(position, np.float64))
        self._covariances.append(np.array(covariance, np.float64).reshape(4, 4))

    @property
    def pose(self) -> Array:
        """Covariance (4, 4) of the pose."""
        total = self._held.copy()
        share = self._config.motion_share**2
        total[:3, :3] += share * self._moved[:, None] * self._moved[None, :]
        for axis in self._levels() if self._slid else ():
            total[:3, :3] += self._slid**2 * axis[:, None] * axis[None, :]
        return total

    @property
    def position(self) -> Array:
        """Covariance of the position, (3, 3) m^2."""
        return self.pose[:3, :3].copy()

    @property
    def heading(self) -> float:
        """Variance of the heading, rad^2."""
        return float(self._held[HEADING, HEADING])

    def _by_map(self, registration: Registration, position: Array) -> Array:
        """Return the covariance (4, 4) of a registered pose: that of its sweeps, and its own error.

        The errors of these sweeps count as one error each in its share: they are drifts of one
        walk, which averaging does not lessen. Away from one, its pose is no surer along any axis
        than it was: at some distance the errors of place and heading would cancel, as they are
        correlated, and in a tunnel a tenth of the true error was stated there.
        """
        config = self._config
        own = self._floor + config.map_error_share**2 * spread_of(
            registration, config.surface_roughness
        )
        known = np.flatnonzero(registration.anchors.any(axis=1)).tolist()
        shares = np.sqrt(registration.anchors[known])
        covariances = np.array([self._covariances[index] for index in known]).reshape(-1, 4, 4)
        steps = position - np.array([self._positions[index] for index in known]).reshape(-1, 3)
        weights = shares[:, :, None] * shares[:, None, :]
        moved = moved_by(covariances, steps)
        surer = np.diagonal(covariances - moved, axis1=-2, axis2=-1)
        moved = moved + np.maximum(surer, 0.0)[..., None] * np.eye(4)
        total: Array = own + (weights * moved).sum(axis=0)
        return total

    def _go_astray(self, slid: Array, walked: Array) -> None:
        """Grow by (2,) m and rad that add up, and (2,) m^2 and rad^2, where nothing holds."""
        levels = self._levels()
        self._slid += float(slid[0]) if levels else 0.0
        for axis in levels:
            self._held[:3, :3] += float(walked[0]) * axis[:, None] * axis[None, :]
        if not self._heading_held:
            before = self._slid_turn
            self._slid_turn += float(slid[1])
            grown = self._slid_turn**2 - before**2 + float(walked[1])
            self._held[HEADING, HEADING] += grown

    def _levels(self) -> list[Array]:
        """Return unit directions (3,) that the last sweep did not hold, but for upright ones."""
        return [axis for axis in self.axes if abs(float(axis[2])) < LEVEL]

    def _unheld(self, motion: Array) -> Array:
        """Return the part of a motion (3,) along directions that the last sweep did not hold."""
        along = np.zeros(3)
        for axis in self.axes:  # by hand: BLAS orders sums by the machine
            along = along + float((axis * motion).sum()) * axis
        return along


def spread_of(registration: Registration, roughness: float) -> Array:
    """Return the covariance (4, 4) of a registration if only one of its points did count.

    E^-1 (S + SYSTEMATIC D) E^-1 with E the mean of g g' over the points and S that of their squared
    distances times g g': the covariance of an estimate whose equations have each an error of their
    own size (Huber, Robust Statistics, 1981, section 6.3), as trunks are farther off their planes
    than floors. D is for an error that all distances have alike: along each axis the mean square
    of the distances that measure it, as if the normals pointed to all sides. Zero along what is not
    held.

    Args:
        registration: Registration of a sweep.
        roughness: Standard deviation of the planes from the surfaces, m.
    """
    moment = registration.moment
    scatter = registration.scatter + roughness**2 * moment
    held, fixed = np.eye(4), moment.copy()
    fixed[HEADING, HEADING] += LEAST_LEVER
    for axis in registration.unheld:
        along = np.append(axis, 0.0)[:, None] * np.append(axis, 0.0)
        held, fixed = held - along, fixed + FIXED * along
    alike = np.diag(scatter).copy()
    alike[:3] /= 3.0 * np.maximum(np.diag(moment)[:3], LEAST_SHARE)
    total = scatter + SYSTEMATIC * np.diag(alike)
    return projected(held, projected(inverse(fixed), total))


def moved_by(covariance: Array, step: Array) -> Array:
    """Return the covariance (..., 4, 4) after a step (..., 3), m, by an uncertain heading.

    F P F' with F = I + f e', f = (-y, x, 0, 0) and e the heading's axis (Thrun, Burgard and Fox,
    Probabilistic Robotics, 2005, section 3.3).
    """
    f = np.zeros((*step.shape[:-1], 4))
    f[..., 0], f[..., 1] = -step[..., 1], step[..., 0]
    cross = f[..., :, None] * covariance[..., None, HEADING, :]
    moved: Array = covariance + cross + np.swapaxes(cross, -1, -2)
    turned = covariance[..., HEADING, HEADING, None, None]
    return moved + turned * f[..., :, None] * f[..., None, :]
