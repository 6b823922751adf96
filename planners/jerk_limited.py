"""Jerk-limited motion along one axis, computed by ruckig and kept as pieces of constant jerk.

Ruckig: Berscheid and Kroeger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target
States", RSS 2021. Only its one-axis position and velocity interfaces are used.
"""

import contextlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import ruckig

from wayproof.kernel_compiler import kernel
from wayproof.planners.kernels.grid import Floats


class State(NamedTuple):
    """Position, velocity and acceleration along an axis."""

    position: float
    velocity: float
    acceleration: float


class AxisLimits(NamedTuple):
    """Largest acceleration and jerk along an axis."""

    acceleration: float
    jerk: float


@dataclass(frozen=True, eq=False)
class Profile:
    """Motion along an axis as pieces of constant jerk; at rest from `duration` on.

    Attributes:
        times: Beginning of each piece, s, ascending from 0, shape (k,).
        states: State at each beginning, shape (k, 3).
        jerks: Jerk over each piece, shape (k,).
        duration: End of the last piece, s.
        end: Position at rest after it.
    """

    times: Floats
    states: Floats
    jerks: Floats
    duration: float
    end: float

    def at(self, time: float) -> State:
        """Return the state at a time, s; the first before 0, at rest after the end."""
        if time >= self.duration or not len(self.times):
            return State(self.end, 0.0, 0.0)
        piece = max(int(self.times.searchsorted(time, side="right")) - 1, 0)
        position, velocity, acceleration = self.states[piece].tolist()
        jerk = float(self.jerks[piece])
        t = max(time - float(self.times[piece]), 0.0)
        return State(
            position + t * (velocity + t * (acceleration / 2.0 + t * jerk / 6.0)),
            velocity + t * (acceleration + t * jerk / 2.0),
            acceleration + t * jerk,
        )

    def positions(self, times: Floats) -> Floats:
        """Return positions at times, s, shape (n,): `at` of each."""
        return self.motion(times)[0]

    def motion(self, times: Floats) -> tuple[Floats, Floats]:
        """Return positions and velocities at times, s, each shape (n,): `at` of each."""
        positions, velocities = np.empty(len(times)), np.empty(len(times))
        pieces = Pieces(self.times, self.states, self.jerks, self.duration, self.end)
        sample(pieces, times, positions, velocities)
        return positions, velocities


class Pieces(NamedTuple):
    """The arrays of a `Profile`."""

    times: Floats  # (k,)
    states: Floats  # (k, 3)
    jerks: Floats  # (k,)
    duration: float
    end: float


@kernel
def sample(pieces: Pieces, times: Floats, positions: Floats, velocities: Floats) -> None:
    """Sample as `Profile.at`, at times in any order, the quicker the more they ascend.

    Args:
        pieces: Pieces of the profile.
        times: Shape (n,), s.
        positions: Shape (n,), out.
        velocities: Shape (n,), out.
    """
    begins, states, jerks, duration, end = pieces
    piece = 0
    for n in range(len(times)):
        if times[n] >= duration or len(begins) == 0:
            positions[n], velocities[n] = end, 0.0
            continue
        while piece > 0 and begins[piece] > times[n]:
            piece -= 1
        while piece + 1 < len(begins) and begins[piece + 1] <= times[n]:
            piece += 1
        position, velocity, acceleration = states[piece]
        jerk, t = jerks[piece], max(times[n] - begins[piece], 0.0)
        positions[n] = position + t * (velocity + t * (acceleration / 2.0 + t * jerk / 6.0))
        velocities[n] = velocity + t * (acceleration + t * jerk / 2.0)


def at_rest(position: float) -> Profile:
    """Return a profile at rest."""
    return Profile(
        np.empty(0), states=np.empty((0, 3)), jerks=np.empty(0), duration=0.0, end=position
    )


def ramped(positions: Floats, step: float) -> Profile:
    """Return the profile through positions (n,) a time step, s, apart, at constant rates."""
    steps = len(positions) - 1
    times, states = np.empty(steps), np.zeros((steps, 3))
    count = list_ramps(positions, step, times, states)
    still = np.zeros(count)
    return Profile(
        times[:count], states[:count], jerks=still, duration=step * steps, end=float(positions[-1])
    )


@kernel
def list_ramps(
    positions: Floats,  # (n,)
    step: float,
    times: Floats,  # (n - 1,) out
    states: Floats,  # (n - 1, 3) out
) -> int:
    """List the runs of steps at one rate; return their number."""
    count, before = 0, np.nan
    for k in range(len(times)):
        rate = (positions[k + 1] - positions[k]) / step
        if not rate - before == 0.0:
            times[count], states[count, 0], states[count, 1] = step * k, positions[k], rate
            count += 1
        before = rate
    return count


SPEED_ROUNDING = 1e-9
"""Share by which a limit of speed may be exceeded where ruckig finds no motion within it."""


class Leg(NamedTuple):
    """A result of ruckig: pieces of constant jerk, and the state at their end."""

    durations: list[float]
    states: list[State]
    jerks: list[float]
    end: State


def solve(start: State, target: State, speed: float | None, limits: AxisLimits) -> Leg:
    """Return the fastest motion to a target state; without a `speed` limit only to its velocity."""
    steps = _solved(start, target, speed, limits)
    brake = steps.brake
    pieces = [
        *zip(brake.t, brake.p, brake.v, brake.a, brake.j, strict=True),
        *zip(steps.t, steps.p, steps.v, steps.a, steps.j, strict=False),
    ]
    used = [piece for piece in pieces if piece[0] > 0.0]
    end = State(steps.p[-1] if speed is None else target.position, target.velocity, 0.0)
    return Leg(
        [t for t, *_ in used],
        [State(p, v, a) for _, p, v, a, _ in used],
        [j for *_, j in used],
        end,
    )


def _solved(start: State, target: State, speed: float | None, limits: AxisLimits) -> ruckig.Profile:
    """Solve for a profile by ruckig.

    It may find none where a robot at its greatest speed only just reaches the target: the one that
    exists rises above that speed by a rounding. That much is then allowed.

    Raises:
        RuntimeError: As `_calculated`.
    """
    request = _request(start, limits)
    request.target_position = [target.position]
    request.target_velocity = [target.velocity]
    request.target_acceleration = [target.acceleration]
    if speed is None:
        request.control_interface = ruckig.ControlInterface.Velocity
        return _calculated(ruckig.Ruckig(1), request, ruckig.Trajectory(1))
    request.max_velocity = [speed]
    try:
        return _calculated(ruckig.Ruckig(1), request, ruckig.Trajectory(1))
    except RuntimeError as refused:
        request.max_velocity = [speed * (1.0 + SPEED_ROUNDING)]
        with contextlib.suppress(RuntimeError):
            return _calculated(ruckig.Ruckig(1), request, ruckig.Trajectory(1))
        raise refused


def _request(start: State, limits: AxisLimits) -> ruckig.InputParameter:
    """Return the input of ruckig, without a target."""
    request = ruckig.InputParameter(1)
    request.current_position = [start.position]
    request.current_velocity = [start.velocity]
    request.current_acceleration = [start.acceleration]
    request.max_acceleration = [limits.acceleration]
    request.max_jerk = [limits.jerk]
    return request


def _calculated(
    solver: ruckig.Ruckig, request: ruckig.InputParameter, found: ruckig.Trajectory
) -> ruckig.Profile:
    """Compute the profile of a request.

    Raises:
        RuntimeError: ruckig refuses the request, or finds no motion.
    """
    try:
        result = solver.calculate(request, found)
    except ruckig.RuckigError as error:
        why = str(error).strip().removeprefix("[ruckig] ")
        raise RuntimeError(f"{_in_words(request)}; ruckig: {why}") from None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(f"{_in_words(request)}; ruckig: {result.name}")
    return found.profiles[0][0]


def _in_words(request: ruckig.InputParameter) -> str:
    """Return a request and its limits in one line, every digit of them."""
    start = request.current_position + request.current_velocity + request.current_acceleration
    position, velocity = request.target_position[0], request.target_velocity[0]
    if request.control_interface == ruckig.ControlInterface.Velocity:
        target, speed = f"velocity {velocity}", ""
    else:
        target = f"position {position}, velocity {velocity}"
        speed = f"velocity {request.max_velocity[0]}, "
    return (
        f"motion: got position {start[0]}, velocity {start[1]}, acceleration {start[2]} to "
        f"{target}, expected a motion within {speed}acceleration {request.max_acceleration[0]}, "
        f"jerk {request.max_jerk[0]}"
    )


def change_speed(start: State, velocity: float, limits: AxisLimits) -> Leg:
    """Return the fastest change to a velocity held without acceleration."""
    return solve(start, State(0.0, velocity, 0.0), None, limits)


def change_lengths(start: State, limits: AxisLimits) -> Callable[[float], float]:
    """Return the length covered by `change_speed` from a start, as a function of the velocity."""
    request = _request(start, limits)
    request.control_interface = ruckig.ControlInterface.Velocity
    solver, found = ruckig.Ruckig(1), ruckig.Trajectory(1)

    def length(velocity: float) -> float:
        request.target_velocity = [velocity]
        return float(_calculated(solver, request, found).p[-1]) - start.position

    return length


def join(legs: Sequence[Leg]) -> Profile:
    """Join motions that follow each other and end at rest."""
    durations = [duration for leg in legs for duration in leg.durations]
    times = list(itertools.accumulate(durations, initial=0.0))
    return Profile(
        np.array(times[:-1]),
        states=np.array([state for leg in legs for state in leg.states]).reshape(-1, 3),
        jerks=np.array([jerk for leg in legs for jerk in leg.jerks]),
        duration=times[-1],
        end=legs[-1].end.position,
    )


def stop(start: State, limits: AxisLimits) -> Profile:
    """Return the fastest stop, at any position."""
    return join([change_speed(start, 0.0, limits)])


def move(start: State, target: float, speed: float, limits: AxisLimits) -> Profile:
    """Return the fastest motion to rest at a position."""
    return join([solve(start, State(target, 0.0, 0.0), speed, limits)])
