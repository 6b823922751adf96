"""What the body believes of its own pose, between the simulator's truth and stack and controller.

Plans are made in the believed frame, so the controller has to track the believed pose. It holds the
true state, so the setpoint is moved instead. With the believed position b = p + e and heading
psi_b = psi + a, a setpoint s asks a controller that believed b for the offset s - b, which it would
turn into the body by R_z(a)' too much. The setpoint

    s' = s - e - (I - R_z(a)') (s - b),   v' = R_z(a)' v,   psi' = psi_s - a

asks the same of a controller that knows p: s' - p = R_z(a)' (s - b). The stack gets each estimate
as it is. Controllers get it smoothed, as an inertial sensor would carry them from one estimate to
the next: e and a pass a critically damped filter, so that setpoints have neither steps nor kinks.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from harness.config import Config
from harness.inputs import heading_of
from harness.perturbations import UNPERTURBED
from harness.schema import wayproof_pb2 as pb
from models.odometry import Odometry, PoseError, believed_trail
from models.poses import Trail
from models.robots import Setpoint

Array = NDArray[np.float64]

BANDWIDTH = 10.0
"""Of the filter between estimate and controller, rad/s: half that of the quadrotor's reference.

Unsmoothed, 1 cm of white error at 100 Hz drove its snap feed-forward into the rotors' limits.
"""


class Estimate:
    """The believed pose of one body, estimate by estimate.

    Attributes:
        error: Believed less true pose, of the newest estimate, with what a perturbation adds.
        added: What the perturbation adds, of which the stated standard deviations know nothing.
        tracked: The error as the controller feels it: x, y, z, m, and heading, rad.
    """

    def __init__(
        self,
        config: Config,
        timestep: float,
        steps: int,
        position: Array,
        heading: float,
        legs: bool = False,
    ) -> None:
        """Start at the true position (3,) and heading.

        Args:
            config: Odometry, perturbation and seed.
            timestep: Of the physics, s.
            steps: Physics steps that a trail reaches back.
            position: m.
            heading: rad.
            legs: The body stands on legs, which tell its height.
        """
        self._config = config
        self._perturbation = config.perturbation or UNPERTURBED
        self._stride = max(1, round(1.0 / (config.odometry.rate * timestep)))
        period = self._stride * timestep
        self._odometry = Odometry(
            config.odometry, config.seed, position, heading, period, legs=legs
        )
        self._period_ns = round(period * 1e9)
        self._due_ns = self._period_ns
        self._errors: deque[PoseError] = deque(maxlen=steps)
        self._look(0)
        self._timestep = timestep
        # Plain floats: at every physics step four numbers cost an array ten times as much.
        self.tracked = (*self.error.shift, self.error.turn)
        self._tracked_rate = (0.0, 0.0, 0.0, 0.0)

    def state(self) -> dict[str, Array]:
        """The estimator's memory, when it looks next, errors of the trail (n, 4), the filter."""
        errors = [(*one.shift, one.turn) for one in self._errors]
        return {
            **{f"odometry.{name}": array for name, array in self._odometry.state().items()},
            "due_ns": np.array(self._due_ns, np.int64),
            "errors": np.array(errors).reshape(-1, 4),
            "added": np.array([*self.added.shift, self.added.turn]),
            "tracked": np.array([self.tracked, self._tracked_rate]),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Go on from what `state` returned."""
        prefix = "odometry."
        own = {n.removeprefix(prefix): a for n, a in state.items() if n.startswith(prefix)}
        self._odometry.restore(own)
        self._due_ns = int(state["due_ns"])
        self._errors.clear()
        self._errors.extend(_pose_error(row) for row in state["errors"])
        self.added = _pose_error(state["added"])
        self.error = self._odometry.error + self.added
        self.tracked, self._tracked_rate = map(tuple, state["tracked"].tolist())

    def advance(self, time_ns: int, position: Array, quaternion: Array) -> None:
        """Make the next estimate if its time has come; the true pose is (3,) and (4,)."""
        if time_ns < self._due_ns:
            return
        self._due_ns += self._period_ns
        w, x, y, z = quaternion.tolist()
        heading = heading_of(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        self._odometry.advance(position, heading)
        self._look(time_ns)

    def step(self) -> None:
        """Keep the error of this physics step for the trail, and move the tracked one after it."""
        self._errors.append(self.error)
        x, y, z, turn = self.tracked
        x_rate, y_rate, z_rate, turn_rate = self._tracked_rate
        (to_x, to_y, to_z), to_turn, timestep = self.error.shift, self.error.turn, self._timestep
        x_rate += timestep * _pull(to_x - x, x_rate)
        y_rate += timestep * _pull(to_y - y, y_rate)
        z_rate += timestep * _pull(to_z - z, z_rate)
        turn_rate += timestep * _pull(to_turn - turn, turn_rate)
        self._tracked_rate = x_rate, y_rate, z_rate, turn_rate
        self.tracked = (
            x + timestep * x_rate,
            y + timestep * y_rate,
            z + timestep * z_rate,
            turn + timestep * turn_rate,
        )

    def pose(self, trail: Trail, rolling: bool) -> pb.Pose:
        """The believed pose as the log states it.

        Args:
            trail: True poses of the base at each step since the sweeps began, and now; now alone
                if no shutter rolls.
            rolling: Whether a shutter rolls, so that the stack needs the trail too.
        """
        errors = [*self._errors, self.error] if rolling else [self.error]
        believed = believed_trail(trail, errors)
        message = pb.Pose(
            position=believed.positions[-1].tolist(),
            quaternion=believed.quaternions[-1].tolist(),
            position_sigma=self._odometry.position_sigma,
            heading_sigma=self._odometry.heading_sigma,
        )
        if rolling:
            sampled = believed.every(self._stride)
            message.trail_positions.extend(sampled.positions.ravel().tolist())
            message.trail_quaternions.extend(sampled.quaternions.ravel().tolist())
            message.trail_period_s = sampled.period
        return message

    def setpoint(self, planned: Setpoint, true_x: float, true_y: float) -> Setpoint:
        """What the controller is asked for: the plan by the error, see the head of this file.

        Args:
            planned: By the trajectory, in the believed frame.
            true_x: Where the body truly is, world, m.
            true_y: Likewise.
        """
        off_x, off_y, off_z, turn = self.tracked
        c, s = math.cos(turn), math.sin(turn)
        (x, y, z), (vx, vy, vz), heading, yaw_rate = planned
        to_x, to_y = x - true_x - off_x, y - true_y - off_y
        return Setpoint(
            (
                x - off_x - ((1.0 - c) * to_x - s * to_y),
                y - off_y - (s * to_x + (1.0 - c) * to_y),
                z - off_z,
            ),
            (c * vx + s * vy, c * vy - s * vx, vz),
            heading - turn,
            yaw_rate,
        )

    def _look(self, time_ns: int) -> None:
        travelled = self._odometry.travelled
        self.added = self._perturbation.pose_error(self._config.seed, time_ns, travelled)
        self.error = self._odometry.error + self.added


def _pull(behind: float, rate: float) -> float:
    """Acceleration of the critically damped filter."""
    return BANDWIDTH * (BANDWIDTH * behind - 2.0 * rate)


def _pose_error(row: Array) -> PoseError:
    x, y, z, turn = row.tolist()
    return PoseError((x, y, z), turn)
