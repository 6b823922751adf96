"""Model of pose-estimate errors: dead reckoning, localization against a map, and white noise.

A model of an estimator, not an estimator: from true motion it makes the error that such an
estimator would have, and beside it the covariance that the estimator would state, which follows
from the configured figures and the estimated motion, never from the error that was drawn.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from wayproof.bounds import Bounds, check_fields
from wayproof.models.arrays import Array
from wayproof.models.poses import Trail
from wayproof.models.random_streams import stream
from wayproof.models.snapshot import Kept

ERROR_STEP = 1e-6
"""Step of the errors, m and rad."""

X, Y, Z, HEADING, SCALE, TURN_SCALE = range(6)
"""Components of the dead-reckoning covariance."""

Share = Annotated[float, Bounds(0.0, 0.5)]
Length = Annotated[float, Bounds(0.0, 5.0, "m")]
Angle = Annotated[float, Bounds(0.0, 1.0, "rad")]

STREAM = "odometry"
"""Name of the random streams."""

DRAW_BLOCK = 128
"""Number of estimates whose random numbers come from one generator, which takes 30 us to make."""


@dataclass(frozen=True)
class PoseModelConfig:
    """Errors of the pose estimate; all zero is the truth itself.

    Dead reckoning accumulates the first four errors without bound; a stack that localizes against a
    map has none of them but the bounded error of `bias_sigma`, which is the default. Axes are
    independent.

    Attributes:
        rate: Estimates a second, Hz, met in whole physics steps; in between the error stays.
        scale_sigma: Standard deviation of the scale error of distances, one draw an episode, m/m.
        yaw_scale_sigma: Standard deviation of the scale error of turns, likewise, rad/rad.
        random_walk: Random walk of the position on each axis, m for the root of a metre travelled.
        yaw_random_walk: Random walk of the heading, rad for the root of a metre travelled.
        bias_sigma: Standard deviation of the bounded error on each axis, m. The position rmse of
            0.8 cm of ORB-SLAM (Mur-Artal and Tardos 2017, T-RO 33, RGB-D) on TUM's fr2 desk and of
            1.3 cm of RGB-D SLAM (Endres et al. 2014, T-RO 30) on fr1 xyz are 0.5 and 0.8 cm an
            axis.
        yaw_bias_sigma: Standard deviation of the bounded heading error, rad; assumed: 1 cm at 5 m.
        leg_height_sigma: Standard deviation of the bounded error of a walking robot's height, m:
            legs measure it against the ground that they stand on, so it has no other error.
            Assumed: a milliradian in each joint of legs of 0.4 m, and as much for the feet's give.
        correlation_time: Time constant of the bounded error, s; assumed.
        white_noise: Standard deviation of the white error of each estimate, on each axis, m.
        yaw_white_noise: Standard deviation of the white error of each heading, rad.

    Raises:
        ValueError: A value is out of its bounds.
    """

    rate: Annotated[float, Bounds(1.0, 1000.0, "Hz")] = 100.0
    scale_sigma: Share = 0.0
    yaw_scale_sigma: Share = 0.0
    random_walk: Length = 0.0
    yaw_random_walk: Angle = 0.0
    bias_sigma: Length = 0.01
    yaw_bias_sigma: Angle = 0.002
    leg_height_sigma: Length = 0.001
    correlation_time: Annotated[float, Bounds(0.01, 3600.0, "s")] = 5.0
    white_noise: Length = 0.0
    yaw_white_noise: Angle = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "pose_model.")


@dataclass(frozen=True)
class PoseError:
    """Estimated minus true pose: a shift, and a turn about the vertical through the body.

    Attributes:
        shift: (x, y, z) world, m.
        turn: rad.
    """

    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: float = 0.0

    def __add__(self, other: PoseError) -> PoseError:
        x, y, z = self.shift
        dx, dy, dz = other.shift
        return PoseError((x + dx, y + dy, z + dz), self.turn + other.turn)


class PoseModel(Kept):
    """The error of an estimator that follows one body, estimate by estimate."""

    KEPT = (
        *("_sequence", "_position", "_heading", "_reckoned", "_bounded", "_jitter"),
        *("_covariance", "travelled"),
    )
    """The scales and draws follow from the seed."""

    def __init__(
        self,
        config: PoseModelConfig,
        seed: int,
        position: Array,
        heading: float,
        period: float,
        legs: bool = False,
    ) -> None:
        """Start at a place that is known but for the bounded error.

        Args:
            config: Errors of the estimates; `period` stands in place of its rate.
            seed: The episode's.
            position: (3,) true, world, m.
            heading: True, rad.
            period: Time between two estimates, s.
            legs: Whether the body stands on legs, which measure its height.
        """
        self._legs = legs
        self._config = config
        self._seed = seed
        self._sequence = 0
        # Plain numbers: three of them cost an array ten times as much, a hundred times a second.
        self._position: list[float] = position.tolist()
        self._heading = heading
        self._decay = math.exp(-period / config.correlation_time)
        distance, turn = stream(seed, f"{STREAM}/scale", 0).standard_normal(2).tolist()
        self._scales = 1.0 + config.scale_sigma * distance, config.yaw_scale_sigma * turn
        self._reckoned = np.zeros(4)  # x, y, z, heading
        # A stack that localizes against a map adds up no errors: then there is no sum to keep.
        self._reckons = any(
            (config.scale_sigma, config.yaw_scale_sigma, config.random_walk, config.yaw_random_walk)
        )
        self._block = -1  # of the draws at hand
        self._walk_spread = _spread(config.random_walk, config.yaw_random_walk)
        jitter_spread = _spread(config.white_noise, config.yaw_white_noise)
        spread = _spread(config.bias_sigma, config.yaw_bias_sigma)
        if legs:
            self._walk_spread[Z] = jitter_spread[Z] = 0.0
            spread[Z] = config.leg_height_sigma
        # Exact discrete form of a first-order Gauss-Markov process (Brown and Hwang, Introduction
        # to Random Signals and Applied Kalman Filtering, section 5.3).
        self._fresh_spread = (math.sqrt(1.0 - self._decay**2) * spread).tolist()
        self._jitter_spread = jitter_spread.tolist()
        _, bounded, jitter = self._draws()
        self._bounded = (spread * bounded).tolist()
        self._jitter = list(map(operator.mul, self._jitter_spread, jitter))
        self._covariance = np.zeros((6, 6))
        self._covariance[SCALE, SCALE] = config.scale_sigma**2
        self._covariance[TURN_SCALE, TURN_SCALE] = config.yaw_scale_sigma**2
        self.travelled = 0.0

    def advance(self, position: Array, heading: float) -> None:
        """Make the next estimate, with the body truly at `position` (3,) and `heading`."""
        was, self._position = self._position, position.tolist()
        turn = math.remainder(heading - self._heading, 2.0 * math.pi)
        self._heading = heading
        x, y, z = map(operator.sub, self._position, was)
        distance = math.sqrt(x * x + y * y + z * z)
        self.travelled += distance
        self._sequence += 1
        walk, bounded, jitter = self._draws()
        if self._reckons:
            estimated = self._reckon(np.array([x, y, z]), turn)
            self._propagate(estimated, turn * (1.0 + self._scales[1]))
            self._reckoned += self._walk_spread * math.sqrt(distance) * walk
        kept = zip(self._bounded, self._fresh_spread, bounded, strict=True)
        self._bounded = [self._decay * old + spread * draw for old, spread, draw in kept]
        self._jitter = list(map(operator.mul, self._jitter_spread, jitter))

    @property
    def error(self) -> PoseError:
        """Error of the newest estimate, in whole quanta."""
        parts = zip(self._reckoned.tolist(), self._bounded, self._jitter, strict=True)
        x, y, z, heading = (ERROR_STEP * round((a + b + c) / ERROR_STEP) for a, b, c in parts)
        return PoseError((x, y, z), heading)

    @property
    def position_sigma(self) -> float:
        """Standard deviation that the estimator states along the axis of the greatest, m."""
        (a, b), (_, c) = self._covariance[:2, :2].tolist()
        horizontal = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) ** 2 + b * b)
        reckoned = max(horizontal, float(self._covariance[Z, Z]))
        return math.sqrt(reckoned + self._config.bias_sigma**2 + self._config.white_noise**2)

    @property
    def heading_sigma(self) -> float:
        """Standard deviation that the estimator states of its heading, rad."""
        reckoned = float(self._covariance[HEADING, HEADING])
        return math.sqrt(
            reckoned + self._config.yaw_bias_sigma**2 + self._config.yaw_white_noise**2
        )

    def _reckon(self, step: Array, turn: float) -> Array:
        """Add a true step to the dead reckoning; return the estimated step, (3,) world, m."""
        scale, turn_scale = self._scales
        c, s = math.cos(self._reckoned[3]), math.sin(self._reckoned[3])
        x, y, z = step.tolist()
        estimated: Array = scale * np.array([c * x - s * y, s * x + c * y, z])
        self._reckoned[:2] += estimated[:2] - step[:2]
        if not self._legs:
            self._reckoned[Z] += estimated[Z] - step[Z]
        self._reckoned[3] += turn_scale * turn
        return estimated

    def _propagate(self, step: Array, turn: float) -> None:
        """Propagate P <- F P F' + Q, linearised about the estimated step.

        The prediction of the extended Kalman filter (Thrun, Burgard and Fox, Probabilistic
        Robotics, 2005, section 3.3), with the two constant scales as states.
        """
        walk = self._walk_spread
        F = np.eye(6)
        F[X, HEADING], F[Y, HEADING] = -step[Y], step[X]
        F[:3, SCALE] = step
        F[HEADING, TURN_SCALE] = turn
        self._covariance = F @ self._covariance @ F.T
        self._covariance[range(4), range(4)] += walk * walk * math.sqrt(float((step * step).sum()))

    def _draws(self) -> list[list[float]]:  # (3, 4)
        """Walk, bounded error and jitter by row; all drawn, so that none shifts another's."""
        block, row = divmod(self._sequence, DRAW_BLOCK)
        if block != self._block:
            self._block, rng = block, stream(self._seed, STREAM, block)
            drawn = rng.standard_normal((DRAW_BLOCK, 3, 4))
            self._drawn: list[list[list[float]]] = drawn.tolist()
        return self._drawn[row]


def _spread(position: float, heading: float) -> Array:  # (4,)
    return np.array([position, position, position, heading])


def estimated_trail(trail: Trail, errors: list[PoseError]) -> Trail:
    """Return the trail of estimated poses, given the error of each."""
    shifts = np.array([error.shift for error in errors])
    half = 0.5 * np.array([error.turn for error in errors])
    c, s = np.cos(half), np.sin(half)
    w, x, y, z = trail.quaternions.T
    # The quaternion (c, 0, 0, s) times (w, x, y, z): a turn about the world's vertical.
    turned = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
    return Trail(trail.positions + shifts, turned, trail.period)
