"""Pose estimate of the simulated body, by a model of an estimator or by one that registers sweeps.

The stack gets each estimate as it is, controllers get it smoothed: see `models.step_kernels`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.estimators.lidar_odometry import LidarOdometry, put_estimate
from wayproof.harness.estimators.motion_sensors import Body, MotionSensors
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.inputs import Beams, Inputs, Pose, SweepInput
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.pose_model import PoseError, PoseModel, PoseModelConfig, estimated_trail
from wayproof.models.poses import Trail

Array = NDArray[np.float64]


EXACT = PoseModelConfig(bias_sigma=0.0, yaw_bias_sigma=0.0, leg_height_sigma=0.0)
"""Errors of the truth itself."""

ESTIMATOR = "estimator."
"""Prefix of the estimator's own state in a snapshot; the other names have no dot."""

NONE = -1
"""Number of the sweeps before the first."""


class PoseEstimate:
    """The estimated pose of one body.

    Attributes:
        error: Estimated minus true pose, of the newest estimate, perturbation included.
        added: Part of the error that a perturbation adds; the stated standard deviations leave it
            out.
        error_row: (4,) the error as x, y, z, m, and heading, rad; it stays the same array.
        tracked: (2, 4) the error as the controller feels it, and its rate; written at every
            physics step.
    """

    def __init__(
        self,
        config: Config,
        timestep: float,
        steps: int,
        position: Array,
        heading: float,
        body: Body,
        beams: Mapping[str, Beams],
    ) -> None:
        """Start at the true position (3,) and heading.

        Args:
            config: Estimator, perturbation and seed.
            timestep: Physics step, s.
            steps: Number of physics steps that a trail covers.
            position: (3,) m.
            heading: rad.
            body: Body that is simulated.
            beams: Geometry of its sensors, by name.
        """
        self._config = config
        self._perturbation = config.perturbation or UNPERTURBED
        self._stride = max(1, round(1.0 / (config.pose_model.rate * timestep)))
        period = self._stride * timestep
        self._beams = beams
        self._estimator: LidarOdometry | PoseModel
        self._lidar: LidarOdometry | None = None
        self._corrected = self._mapped = NONE  # number of the last sweeps
        if config.estimate.kind == "lidar":
            sensors = MotionSensors(config.estimate, config.seed, period, body, self._perturbation)
            self._lidar = LidarOdometry(config.estimate, position, heading, sensors)
            self._estimator = self._lidar
        else:
            errors = config.pose_model if config.estimate.kind == "model" else EXACT
            self._estimator = PoseModel(
                errors, config.seed, position, heading, period, legs=body.legs
            )
        self._period_ns = round(period * 1e9)
        self._due_ns = self._period_ns
        self._errors: deque[PoseError] = deque(maxlen=steps)
        self.error_row = np.zeros(4)
        self._update_perturbation(0)
        self.tracked = np.array([self.error_row, np.zeros(4)])

    def state(self) -> dict[str, Array]:
        """Return the estimator, the next estimate's time, the trail's errors (n, 4), the filter."""
        errors = [(*one.shift, one.turn) for one in self._errors]
        return {
            **{f"{ESTIMATOR}{name}": array for name, array in self._estimator.state().items()},
            "due_ns": np.array(self._due_ns, np.int64),
            "errors": np.array(errors).reshape(-1, 4),
            "added": np.array([*self.added.shift, self.added.turn]),
            "tracked": self.tracked.copy(),
            **({} if self._lidar is None else {"corrected": np.array(self._corrected, np.int64)}),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned.

        Raises:
            ValueError: The tracked error has another shape.
        """
        if state["tracked"].shape != self.tracked.shape:
            raise ValueError(f"tracked: got {state['tracked'].shape}, expected (2, 4)")
        own = [(name.partition("."), array) for name, array in state.items()]
        self._estimator.restore({name: array for (_, dot, name), array in own if dot})
        self._due_ns = int(state["due_ns"])
        self._errors.clear()
        self._errors.extend(_pose_error(row) for row in state["errors"])
        self.added = _pose_error(state["added"])
        self._update_error()
        self.tracked[:] = state["tracked"]
        if self._lidar is not None:
            self._corrected = int(state["corrected"])

    def advance(self, time_ns: int, position: Array, quaternion: Array) -> None:
        """Make the next estimate if its time has come; the true pose is (3,) and (4,)."""
        if time_ns < self._due_ns:
            return
        self._due_ns += self._period_ns
        self._estimator.advance(position, yaw_of_quaternion(quaternion))
        self._update_perturbation(time_ns)

    @property
    def registers(self) -> bool:
        """Whether the estimator registers sweeps."""
        return self._lidar is not None

    def record_step(self) -> None:
        """Record the error of this physics step for the trail."""
        self._errors.append(self.error)

    def correct(self, sequence: int, trail: Trail, rolling: bool, sweeps: list[SweepInput]) -> None:
        """Register the sweeps of this instant; the model of an estimator needs none.

        Args:
            sequence: Their number; a second time changes nothing.
            trail: As for `pose`.
            rolling: As for `pose`.
            sweeps: As they reach the stack.
        """
        if self._lidar is None or sequence <= self._corrected:
            return
        self._corrected = sequence
        predicted = self._believed(trail, rolling)
        pose = Pose(
            predicted.positions[-1],
            predicted.quaternions[-1],
            position_sigma=0.0,
            trail=predicted if rolling else None,
        )
        moved = self._lidar.correct(self._points(sweeps, pose, sequence))
        self._errors = deque((one + moved for one in self._errors), self._errors.maxlen)
        self._update_error()

    def integrate(self, inputs: Inputs) -> None:
        """Add sweeps to the map of the estimator, placed by the poses that it has stated."""
        if self._lidar is None or inputs.sequence <= self._mapped:
            return
        self._mapped = inputs.sequence
        pose = inputs.pose
        assert pose.covariance is not None
        fresh = [sweep for sweep in inputs.sweeps if not sweep.age_ns]
        points = self._points(fresh, pose, inputs.sequence)
        self._lidar.add_to_map(points, pose.position, pose.covariance)

    def pose(self, trail: Trail, rolling: bool) -> pb.Pose:
        """Encode the estimated pose for the log.

        Args:
            trail: True poses of the base at each step since the sweeps began, and now; now alone
                without a rolling shutter.
            rolling: Whether a sensor has a rolling shutter, so that the stack needs the trail.
        """
        believed = self._believed(trail, rolling)
        message = pb.Pose(
            position=believed.positions[-1].tolist(),
            quaternion=believed.quaternions[-1].tolist(),
            position_sigma=self._estimator.position_sigma,
            heading_sigma=self._estimator.heading_sigma,
        )
        if rolling:
            message.history_positions.extend(believed.positions.ravel().tolist())
            message.history_quaternions.extend(believed.quaternions.ravel().tolist())
            message.history_period_s = believed.period
        if self._lidar is not None:
            put_estimate(message, self._lidar)
        return message

    def _believed(self, trail: Trail, rolling: bool) -> Trail:
        """Return the poses estimated since the sweeps began; without rolling the last alone."""
        errors = [*self._errors, self.error] if rolling else [self.error]
        believed = estimated_trail(trail, errors)
        return believed.every(self._stride) if rolling else believed

    def _points(self, sweeps: Iterable[SweepInput], pose: Pose, sequence: int) -> Array:
        """Place the returns of sweeps, (n, 3), world, m."""
        points = [self._beams[one.sensor].place(one, pose, sequence).points for one in sweeps]
        return np.concatenate([np.zeros((0, 3)), *points])

    def _update_perturbation(self, time_ns: int) -> None:
        travelled = self._estimator.travelled
        self.added = self._perturbation.pose_error(self._config.seed, time_ns, travelled)
        self._update_error()

    def _update_error(self) -> None:
        self.error = self._estimator.error + self.added
        self.error_row[:] = *self.error.shift, self.error.turn


def _pose_error(row: Array) -> PoseError:
    x, y, z, turn = row.tolist()
    return PoseError((x, y, z), turn)
