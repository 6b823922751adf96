"""The quadrotor under trial: gusts that it does not know of, references that it should fly."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
import ruckig
from numpy.typing import NDArray

from models.robots.estimate import Estimate, EstimateNoise
from models.robots.quadrotor.parameters import AIR_DENSITY, Airframe
from models.robots.quadrotor.robot import Quadrotor
from models.robots.robot import Setpoint
from models.robots.wind import dryden_gusts

Array = NDArray[np.float64]
Course = Callable[[float], tuple[float, float, float, float]]
"""From time, s, to x, y, z, m, and heading, rad."""

PREFIX = "robot_"
TIMESTEP = 0.002
CHECK_EVERY = 5
"""Ticks between two looks at whether it has crashed."""

SETTLE = 2.0
"""Errors count from here on, s: gusts are there at once, at full strength."""

_SCENE = f"""\
<mujoco model="trial">
  <option timestep="{TIMESTEP}" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" group="0"/>
  </worldbody>
</mujoco>
"""


class Limits(NamedTuple):
    """Of point-to-point flights, horizontal (each axis) and vertical; SI.

    Attributes:
        speed: m/s.
        acceleration: m/s^2.
        jerk: m/s^3.
    """

    speed: tuple[float, float] = (3.0, 2.0)
    acceleration: tuple[float, float] = (4.0, 2.5)
    jerk: tuple[float, float] = (20.0, 15.0)


class Flown(NamedTuple):
    """What became of one flight.

    Attributes:
        crashed: Tilted beyond the spec's limit, or touched the floor; the flight ends there.
        error: Root mean square distance from the course, m; the controller's constant lag behind
            its setpoints is taken off, what its smoothing cuts is not.
        top_speed: m/s.
        energy: Of the rotors, J: the integral of `rotor_power`.
        seconds: Simulated.
    """

    crashed: bool
    error: float
    top_speed: float
    energy: float
    seconds: float


def rotor_power(airframe: Airframe, thrusts: Array) -> float:
    """Power of rotors with thrusts (4,), W: momentum theory in hover by the figure of merit.

    P = T^(3/2) / sqrt(2 rho A) of each (Leishman 2006, eq. 2.15), A the rotor's disc.
    """
    area = math.pi * airframe.rotor_radius**2
    ideal = float((np.maximum(thrusts, 0.0) ** 1.5).sum()) / math.sqrt(2.0 * AIR_DENSITY * area)
    return ideal / airframe.figure_of_merit


def fly(
    robot: Quadrotor,
    course: Course,
    seconds: float,
    wind_speed: float,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
) -> Flown:
    """Fly a course from hovering at its begin.

    Args:
        robot: Under trial.
        course: Where to be when.
        seconds: Length.
        wind_speed: Mean of the gusts, m/s.
        noise: Of the estimate; none reads the truth.
        rng: Of gusts and noise.
    """
    ticks = round(seconds / TIMESTEP)
    model = _compile(robot)
    data = mujoco.MjData(model)
    controller = robot.controller(model, PREFIX)
    wind = dryden_gusts(rng, ticks, TIMESTEP, wind_speed)
    estimate = None if noise is None else Estimate(model, noise, ticks, rng)
    x, y, z, heading = course(0.0)
    controller.reset(data, np.array([x, y, z]), heading)
    upright = math.cos(robot.spec.max_tilt)
    wanted, was = np.empty((ticks, 3)), np.empty((ticks, 3))
    energy, tick, crashed = 0.0, 0, False
    while tick < ticks and not crashed:
        x, y, z, heading = course(tick * TIMESTEP)
        wanted[tick], was[tick] = (x, y, z), data.qpos[:3]
        setpoint = Setpoint(wanted[tick], _NO_VELOCITY, heading, 0.0)
        controller.wind[:] = wind[tick]
        if estimate is None:
            controller.follow(data, setpoint)
        else:
            estimate.update(data, tick)
            controller.follow(estimate.data, setpoint)
            data.ctrl[:] = estimate.data.ctrl
            controller.apply_drag(data)
        mujoco.mj_step(model, data)
        if tick % CHECK_EVERY == 0:
            energy += CHECK_EVERY * TIMESTEP * rotor_power(robot.parameters.airframe, data.act)
            # False for NaN, too.
            crashed = data.ncon > 0 or not data.xmat[controller.body, 8] > upright
        tick += 1
    lag = round(robot.parameters.smoothing.lag / TIMESTEP)
    error = _rms_distance(was[lag:tick] - wanted[: tick - lag], round(SETTLE / TIMESTEP))
    steps = np.diff(was[:tick], axis=0)
    top = float(np.linalg.norm(steps, axis=1).max()) / TIMESTEP
    return Flown(crashed, error, top, energy, tick * TIMESTEP)


_NO_VELOCITY = np.zeros(3)


def _compile(robot: Quadrotor) -> mujoco.MjModel:
    world = mujoco.MjSpec.from_string(_SCENE)
    body = mujoco.MjSpec.from_string(robot.mjcf())
    world.attach(body, prefix=PREFIX, frame=world.worldbody.add_frame())
    return world.compile()


def _rms_distance(errors: Array, skip: int) -> float:
    if len(errors) <= skip:
        return math.nan
    return math.sqrt(float((errors[skip:] ** 2).sum(axis=1).mean()))


def hover(rng: np.random.Generator) -> Course:
    """Stay at a drawn height and heading."""
    height, heading = rng.uniform(1.0, 3.0), rng.uniform(-math.pi, math.pi)
    return lambda _: (0.0, 0.0, height, heading)


def figure_of_eight(rng: np.random.Generator, speed: float = 3.0, ramp: float = 4.0) -> Course:
    """A Lissajous figure 6 m long and 3 m wide, climbing and sinking by 0.4 m, at any heading.

    Args:
        rng: Of the heading.
        speed: Greatest, in the middle of the figure, m/s.
        ramp: The pace grows smoothly from rest for so long, s.
    """
    length, width, rise = 3.0, 1.5, 0.4
    rate = speed / math.sqrt(length**2 + (2.0 * width) ** 2 + rise**2)
    heading = rng.uniform(-math.pi, math.pi)

    def course(time: float) -> tuple[float, float, float, float]:
        share = min(time / ramp, 1.0)
        # The integral of the smooth step 6 s^5 - 15 s^4 + 10 s^3.
        paced = ramp * share**4 * (share * share - 3.0 * share + 2.5) + max(time - ramp, 0.0)
        phase = rate * paced
        across, up = width * math.sin(2.0 * phase), rise * math.sin(phase)
        return length * math.sin(phase), across, 2.0 + up, heading

    return course


def point_to_point(
    rng: np.random.Generator, seconds: float, limits: Limits | None = None, far: float = 6.0
) -> Course:
    """Flights from rest to rest between drawn points, each shortest in time under the limits.

    The profiles are ruckig's (Berscheid and Kroeger, RSS 2021), axes synchronised in time; the
    heading turns to a drawn one by a smooth step meanwhile.

    Args:
        rng: Of points, headings and pauses.
        seconds: To fill.
        limits: Of each axis.
        far: Side of the square the points are in, m.
    """
    limits = limits or Limits()
    legs: list[tuple[float, ruckig.Trajectory, float, float]] = []
    start, heading, begin = np.array([0.0, 0.0, 2.0]), 0.0, 0.0
    while begin < seconds:
        goal = rng.uniform([-far / 2, -far / 2, 1.0], [far / 2, far / 2, 3.0])
        trajectory = _profile(start, goal, limits)
        turned = heading + rng.uniform(-1.0, 1.0) * min(2.0, 0.7 * trajectory.duration)
        legs.append((begin, trajectory, heading, turned))
        begin += trajectory.duration + rng.uniform(0.0, 1.0)
        start, heading = goal, turned
    now = 0

    def course(time: float) -> tuple[float, float, float, float]:
        nonlocal now
        if time < legs[now][0]:
            now = 0
        while now + 1 < len(legs) and time >= legs[now + 1][0]:
            now += 1
        begun, trajectory, before, after = legs[now]
        elapsed = min(time - begun, trajectory.duration)
        x, y, z = trajectory.at_time(elapsed)[0]
        share = elapsed / trajectory.duration
        smooth = share**3 * (share * (6.0 * share - 15.0) + 10.0)
        return x, y, z, before + smooth * (after - before)

    return course


def _profile(start: Array, goal: Array, limits: Limits) -> ruckig.Trajectory:
    request = ruckig.InputParameter(3)
    request.current_position, request.target_position = start.tolist(), goal.tolist()
    request.max_velocity = [limits.speed[0]] * 2 + [limits.speed[1]]
    request.max_acceleration = [limits.acceleration[0]] * 2 + [limits.acceleration[1]]
    request.max_jerk = [limits.jerk[0]] * 2 + [limits.jerk[1]]
    trajectory = ruckig.Trajectory(3)
    result = ruckig.Ruckig(3).calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"profile: got {result} from {start} to {goal}, expected a solution")
    return trajectory
