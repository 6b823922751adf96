"""Lidar odometry with a motion prior: predicts between the sweeps, and registers each with a map.

Four degrees of freedom: position and heading. Roll and pitch are the attitude's, by gravity.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.line_map import LineMap
from wayproof.harness.estimators.matrices import diagonalize, projected
from wayproof.harness.estimators.motion_filter import MotionFilter
from wayproof.harness.estimators.motion_sensors import Motion, MotionSource, turned_by
from wayproof.harness.estimators.slip import Slip
from wayproof.harness.estimators.stated_covariance import StatedCovariance
from wayproof.harness.estimators.surface_map import Registration, SurfaceMap, thinned
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.arrays import Array
from wayproof.models.pose_model import ERROR_STEP, PoseError
from wayproof.models.snapshot import Kept

FIRST_RESIDUAL = 0.01
"""Standard deviation of the distances of points from planes before the first registration, m."""

ROUGHNESS = 0.003
"""Standard deviation of the planes from the surfaces, by which the prediction counts, m."""

MAP_SPACING = 0.1
"""Distance between the points of a sweep that are mapped, m."""

LEAST_TURNED = 0.5
"""Sine of the angle from which a direction that was not held is another one."""

NAME = "lidar/8"
"""Name and version of the estimator, as it is logged."""

PLANAR_NAME = "lidar-planar/2"
"""Name and version of the estimator by planar lasers: `lidar/8`, before it had its own map."""


class LidarOdometry(Kept):
    """The pose of one body by its sweeps and its sensors of motion.

    Attributes:
        travelled: Way of the estimate, m.
        covariance: Stated covariance of its error.
        name: Name and version of the estimator.
    """

    KEPT = (
        *("_position", "_heading", "_velocity", "_bias", "_true_position", "_true_heading"),
        *("travelled", "_begun", "_residual"),
    )

    def __init__(
        self,
        config: EstimateConfig,
        position: Array,
        heading: float,
        sensors: MotionSource,
        planar: bool = False,
    ) -> None:
        """Start at a known pose.

        Args:
            config: Settings.
            position: (3,) world, m.
            heading: Heading, rad.
            sensors: Sensors of motion, read at each estimate.
            planar: Whether the sweeps are of planar lasers, whose points stand for upright walls.
        """
        self._config, self._sensors = config, sensors
        self.name = PLANAR_NAME if planar else NAME
        kind = LineMap if planar else SurfaceMap
        self._surfaces = kind(config.voxel, config.held, config.registered_share)
        self._filter = MotionFilter(config)
        self._slip = Slip(config) if planar else None
        self._residual = FIRST_RESIDUAL
        self._position, self._heading = position.copy(), heading  # estimated
        self._velocity = np.zeros(3)  # estimated, world
        self._bias = np.zeros(3)  # estimated, of the accelerometer, m/s^2, axes of the base
        self._true_position, self._true_heading = position.copy(), heading
        self.covariance = StatedCovariance(config)
        self._begun = False  # whether the map has its first sweep, taken at the known start
        self.travelled = 0.0

    def advance(self, position: Array, heading: float) -> None:
        """Predict over a period of the sensors; the body is truly at `position` (3,), `heading`.

        The true pose only turns what is measured in the body's axes into those of the estimate, and
        makes the error that `error` returns.
        """
        turn = math.remainder(heading - self._true_heading, 2.0 * math.pi)
        self._true_position, self._true_heading = position.copy(), heading
        motion = self._sensors.measure(turn)
        self._heading += motion.turn
        axes = self._accelerometer_axes(motion)
        before = self._velocity
        self._velocity = self._predicted_velocity(motion, axes)
        step = 0.5 * self._sensors.period * (before + self._velocity)
        if motion.step is not None:
            step = self._sensors.period * self._velocity
        self._position = self._position + step
        self.travelled += math.sqrt(float((step * step).sum()))
        period, turned = self._sensors.period, self._turn_variance(motion, step)
        astray = None if self._slip is None else self._slip.predict(step, period, turned)
        grown = self._filter.predict(step, period, axes, turned, astray)
        inertial = grown if axes is not None else None
        self.covariance.predict(step, period, inertial, turned, astray)

    def correct(self, points: Array) -> PoseError:
        """Register a sweep; return its correction of the estimate: none by the first one.

        Args:
            points: (n, 3) placed by the predicted poses, world, m.
        """
        if not self._begun:
            self._begun = True
            return PoseError()
        chosen = thinned(points, self._config.spacing)
        variance = self._config.sweep_noise_share**2 * self._residual**2
        reach = (0.0, 0.0) if self._slip is None else self._slip.reach
        registration = self._surfaces.register(
            chosen, self._position, self._filter.weight(variance), reach
        )
        shift, turn = registration.correction[:3], float(registration.correction[3])
        self._position = self._position + shift
        self._heading += turn
        if math.isfinite(registration.deviation):
            self._residual = math.hypot(registration.deviation, ROUGHNESS)
            information = self._information(registration)
            self._filter.decorrelate(regained(self.covariance.axes, registration.unheld))
            change = self._filter.update(information, shift, registration.unheld)
            self._velocity, self._bias = self._velocity + change[:3], self._bias + change[3:]
            if self._slip is not None:
                self._slip.correct(registration.correction, self._heading)
        self.covariance.correct(registration, self._position)
        x, y, z = shift.tolist()
        return PoseError((x, y, z), turn)

    def add_to_map(self, points: Array, position: Array, covariance: Array) -> None:
        """Map a sweep, unless it contradicts the map at the pose that was found for it.

        A map of sweeps that only a prediction placed goes along with the prediction's error, and
        confirms it.

        Args:
            points: (n, 3) placed by the estimated poses, world, m.
            position: (3,) as it was stated with the sweep, m.
            covariance: (4, 4) likewise.
        """
        mapped = thinned(points, MAP_SPACING)
        registered = len(self.covariance.axes) < 3
        if self._surfaces.contradicts(mapped, position, registered):
            return
        self._surfaces.add(mapped, position)
        self.covariance.add_to_map(position, covariance)

    @property
    def position_sigma(self) -> float:
        """Standard deviation along the axis of the greatest, m."""
        covariance = self.covariance.position
        diagonalize(covariance, np.empty((3, 3)))
        return math.sqrt(max(covariance[axis, axis] for axis in range(3)))

    @property
    def heading_sigma(self) -> float:
        """Standard deviation of the heading, rad."""
        return math.sqrt(self.covariance.heading)

    @property
    def error(self) -> PoseError:
        """Estimated minus true pose, in whole quanta."""
        shift = self._position - self._true_position
        turn = math.remainder(self._heading - self._true_heading, 2.0 * math.pi)
        x, y, z, a = (ERROR_STEP * round(one / ERROR_STEP) for one in (*shift.tolist(), turn))
        return PoseError((x, y, z), a)

    def state(self) -> dict[str, Array]:
        """Return the state but for the map, which follows from the sweeps and poses of the log."""
        parts = {
            f"{name}.{key}": a for name, part in self._parts for key, a in part.state().items()
        }
        return super().state() | parts

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        super().restore(state)
        for name, part in self._parts:
            head = f"{name}."
            part.restore({k.removeprefix(head): a for k, a in state.items() if k.startswith(head)})

    @property
    def _parts(self) -> list[tuple[str, Kept | MotionSource]]:
        """Parts with a state of their own, by name."""
        parts = (
            ("sensors", self._sensors),
            ("filter", self._filter),
            ("covariance", self.covariance),
        )
        return [*parts, *([] if self._slip is None else [("slip", self._slip)])]

    def _information(self, registration: Registration) -> Array:
        """Return the information (4, 4) of a sweep: none along directions that it does not hold."""
        held = np.eye(4)
        for axis in registration.unheld:
            held = held - np.append(axis, 0.0)[:, None] * np.append(axis, 0.0)
        moment = projected(held, registration.moment)
        information: Array = moment / (self._config.sweep_noise_share * self._residual) ** 2
        return information

    def _turn_variance(self, motion: Motion, step: Array) -> float:
        """Return the heading's variance, rad^2, that an odometry's turn and step (3,), m, add."""
        if motion.step is None:
            return 0.0
        way = float((step * step).sum())
        return (self._config.turn_share * motion.turn) ** 2 + self._config.turn_walk**2 * way

    def _accelerometer_axes(self, motion: Motion) -> Array | None:
        """Return R (3, 3) of the base in the estimate's axes; None if other sensors predict."""
        if motion.step is not None or motion.foot_velocity is not None or motion.axes is None:
            return None
        error = self._heading - self._true_heading
        return np.array([_turned(column, error) for column in motion.axes.T]).T

    def _predicted_velocity(self, motion: Motion, axes: Array | None) -> Array:
        """Return the velocity by standing feet, else by accelerometer, in the estimate's axes."""
        error = self._heading - self._true_heading
        if motion.step is not None:
            return _turned(motion.step, error) / self._sensors.period
        if motion.foot_velocity is not None:
            return _turned(motion.foot_velocity, error)
        change = _turned(motion.velocity_change, error)
        if axes is not None:
            change = change - self._sensors.period * turned_by(axes, self._bias)
        return self._velocity + change


def put_estimate(message: pb.Pose, lidar: LidarOdometry) -> None:
    """Write an odometry's stated uncertainty into a pose."""
    covariance = lidar.covariance
    message.position_sigma, message.heading_sigma = lidar.position_sigma, lidar.heading_sigma
    message.estimator = lidar.name
    message.covariance.extend(covariance.pose.ravel().tolist())
    message.information.extend(covariance.information.tolist())
    message.unheld.extend(covariance.axes.ravel().tolist())


def regained(before: Array, unheld: Array) -> Array:
    """Return unit directions (k, 3) that a sweep holds and the one before did not.

    Args:
        before: (m, 3) unit directions that the sweep before did not hold.
        unheld: (n, 3) that this one does not hold. A direction that was found a little turned is
            the same.
    """
    found = []
    for axis in before:
        rest = axis.copy()
        for other in unheld:
            rest = rest - float((axis * other).sum()) * other
        length = math.sqrt(float((rest * rest).sum()))
        if length > LEAST_TURNED:
            found.append(rest / length)
    return np.array(found).reshape(-1, 3)


def _turned(vector: Array, angle: float) -> Array:
    """Return a vector (3,) turned about the vertical."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = vector.tolist()
    return np.array([c * x - s * y, s * x + c * y, z])
