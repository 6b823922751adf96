"""Trials of the quadrotor: unknown gusts, and courses to fly.

Gusts are those of Dryden, in the low-altitude form of MIL-F-8785C, section 3.7.2: turbulence is
frozen and carried past by the mean wind, so that white noise through a filter whose length is in
metres becomes a series in time. The specification starts at 10 ft above the ground.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
import ruckig
from scipy.signal import lfilter

from tests.tools.trials.estimate import Estimate, EstimateNoise, Run
from wayproof.models.arrays import Array
from wayproof.models.robots.quadrotor.control_law import air_drag
from wayproof.models.robots.quadrotor.parameters import Airframe
from wayproof.models.robots.quadrotor.robot import Quadrotor
from wayproof.models.robots.robot import ROBOT_PREFIX, Setpoint
from wayproof.planners import MotionLimits, PathState, follow_path

AIR_DENSITY = 1.225
"""Density of air at sea level in the standard atmosphere, kg/m^3."""

FIGURE_OF_MERIT = 0.6
"""Ideal by true power of a hovering rotor; assumed."""

Course = Callable[[float], tuple[float, float, float, float]]
"""Function from time, s, to x, y, z, m, and heading, rad."""

TIMESTEP = 0.002
CRASH_CHECK_TICKS = 5
"""Ticks between two checks for a crash."""

SETTLE = 2.0
"""Time from which errors count, s; gusts begin at full strength."""

_SCENE = f"""\
<mujoco model="trial">
  <option timestep="{TIMESTEP}" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" group="0"/>
  </worldbody>
</mujoco>
"""


class Limits(NamedTuple):
    """Limits of point-to-point flights, along the line."""

    speed: float = 3.0
    acceleration: float = 4.0
    jerk: float = 20.0


def rotor_power(airframe: Airframe, thrusts: Array) -> float:
    """Return the power of rotors with thrusts (4,), W: by momentum theory and figure of merit.

    P = T^(3/2) / sqrt(2 rho A) of each (Leishman 2006, eq. 2.15), A the rotor's disc.
    """
    area = math.pi * airframe.rotor_radius**2
    ideal = float((np.maximum(thrusts, 0.0) ** 1.5).sum()) / math.sqrt(2.0 * AIR_DENSITY * area)
    return ideal / FIGURE_OF_MERIT


def fly(
    robot: Quadrotor,
    course: Course,
    seconds: float,
    wind_speed: float,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
) -> Run:
    """Fly a course from hovering at its begin."""
    ticks = round(seconds / TIMESTEP)
    model = _compile(robot)
    data = mujoco.MjData(model)
    controller = robot.controller(model, ROBOT_PREFIX)
    wind = dryden_gusts(rng, ticks, TIMESTEP, wind_speed)
    estimate = None if noise is None else Estimate(model, noise, ticks, rng)
    x, y, z, heading = course(0.0)
    controller.reset(data, np.array([x, y, z]), heading)
    upright = math.cos(robot.spec.max_tilt)
    desired, actual = np.empty((ticks, 3)), np.empty((ticks, 3))
    energy, tick, crashed = 0.0, 0, False
    while tick < ticks and not crashed:
        x, y, z, heading = course(tick * TIMESTEP)
        desired[tick], actual[tick] = (x, y, z), data.qpos[:3]
        setpoint = Setpoint((x, y, z), heading=heading)
        controller.wind[:] = wind[tick]
        if estimate is None:
            controller.follow(data, setpoint)
        else:
            estimate.update(data, tick)
            controller.follow(estimate.data, setpoint)
            data.ctrl[:] = estimate.data.ctrl
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, data.qpos[3:7])
            airspeed = data.qvel[:3] - wind[tick]
            drag = air_drag(robot.parameters.airframe, R.reshape(3, 3), airspeed)
            data.xfrc_applied[controller.body, :3] = drag
        mujoco.mj_step(model, data)
        if tick % CRASH_CHECK_TICKS == 0:
            energy += (
                CRASH_CHECK_TICKS * TIMESTEP * rotor_power(robot.parameters.airframe, data.act)
            )
            # False for NaN, too.
            crashed = data.ncon > 0 or not data.xmat[controller.body, 8] > upright
        tick += 1
    lag = round(robot.parameters.smoothing.lag / TIMESTEP)
    error = _rms_distance(actual[lag:tick] - desired[: tick - lag], round(SETTLE / TIMESTEP))
    steps = np.diff(actual[:tick], axis=0)
    top = float(np.linalg.norm(steps, axis=1).max()) / TIMESTEP
    return Run(crashed, tick * TIMESTEP, error=error, top_speed=top, energy=energy)


def _compile(robot: Quadrotor) -> mujoco.MjModel:
    world = mujoco.MjSpec.from_string(_SCENE)
    body = mujoco.MjSpec.from_string(robot.mjcf())
    world.attach(body, prefix=ROBOT_PREFIX, frame=world.worldbody.add_frame())
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
    """Return a Lissajous figure, 6 m by 3 m, climbing and sinking by 0.4 m, at any heading."""
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
    rng: np.random.Generator, seconds: float, limits: Limits | None = None, far: float = 8.0
) -> Course:
    """Return straight flights between drawn points, from rest to rest, shortest in time.

    The profiles are ruckig's (Berscheid and Kroeger, RSS 2021); the heading turns to a drawn one
    by a smooth step meanwhile.
    """
    legs: list[_Leg] = []
    leg = _Leg(
        begin=0.0,
        start=np.array([0.0, 0.0, 2.0]),
        goal=np.array([0.0, 0.0, 2.0]),
        profile=None,
        heading=0.0,
        turned=0.0,
    )
    begin = 0.0
    while begin < seconds:
        goal = rng.uniform([-far / 2, -far / 2, 1.0], [far / 2, far / 2, 3.0])
        profile = _profile(float(np.linalg.norm(goal - leg.goal)), limits or Limits())
        turned = leg.turned + rng.uniform(-1.0, 1.0) * min(2.0, 0.7 * profile.duration)
        leg = _Leg(
            begin, start=leg.goal, goal=goal, profile=profile, heading=leg.turned, turned=turned
        )
        legs.append(leg)
        begin += profile.duration + rng.uniform(0.0, 1.0)
    begins = [leg.begin for leg in legs]
    return lambda time: legs[bisect_right(begins, time) - 1].at(time)


def turning_about(
    rng: np.random.Generator, seconds: float, yaw_rate: float, limits: Limits | None = None
) -> Course:
    """Return flights within 6 m, with turns by up to half a circle at a constant rate meanwhile.

    Navigation commands such turns: at once at the full rate, whatever the motion.
    """
    places = point_to_point(rng, seconds, limits, far=6.0)
    times, headings = [0.0], [0.0]
    while times[-1] < seconds:
        turn = rng.uniform(-math.pi, math.pi)
        times += [times[-1] + abs(turn) / yaw_rate]
        times += [times[-1] + rng.uniform(0.0, 0.5)]
        headings += [headings[-1] + turn] * 2
    return lambda time: (*places(time)[:3], float(np.interp(time, times, headings)))


def motion_limits(robot: Quadrotor) -> MotionLimits:
    """Return the limits of the trajectories that navigation gives a robot."""
    limits = robot.limits
    return MotionLimits(
        limits.speed, limits.acceleration, limits.jerk, limits.acceleration, limits.yaw_rate
    )


def winding(rng: np.random.Generator, limits: MotionLimits, corners: int = 14) -> Course:
    """Return a path as navigation plans it, through drawn corners, at its limits, to rest."""
    waypoints = [np.array([0.0, 0.0, 2.0])]
    heading = rng.uniform(-math.pi, math.pi)
    for _ in range(corners):
        heading += rng.uniform(-1.2, 1.2)
        length, climb = rng.uniform(0.5, 3.0), rng.uniform(-0.8, 0.8)
        x, y, z = waypoints[-1]
        ahead = x + length * math.cos(heading), y + length * math.sin(heading)
        waypoints.append(np.array([*ahead, min(max(z + climb, 1.0), 3.0)]))
    path = _rounded(np.array(waypoints), reach=0.3)
    start = PathState(time_ns=0, arc_length=0.0, speed=0.0, acceleration=0.0, heading=0.0)
    trajectory = follow_path(path, start, limits, limits.speed, sideways_speed=limits.speed)

    def course(time: float) -> tuple[float, float, float, float]:
        sample = trajectory.at(round(time * 1e9))
        x, y, z = sample.position.tolist()
        return x, y, z, sample.heading

    return course


def _rounded(waypoints: Array, reach: float) -> Array:
    """Replace each corner of a polyline by a parabola, from up to `reach` before it, m."""
    share = np.linspace(0.0, 1.0, 7)[:, None]
    parts = [waypoints[:1]]
    for before, corner, after in zip(waypoints, waypoints[1:], waypoints[2:], strict=False):
        begin, end = (
            corner + (other - corner) * min(0.45, reach / float(np.linalg.norm(other - corner)))
            for other in (before, after)
        )
        parts.append(
            (1.0 - share) ** 2 * begin + 2.0 * share * (1.0 - share) * corner + share**2 * end
        )
    return np.vstack([*parts, waypoints[-1:]])


class _Leg(NamedTuple):
    """One straight flight: its begin, ends, profile and headings."""

    begin: float
    start: Array
    goal: Array
    profile: Any
    heading: float
    turned: float

    def at(self, time: float) -> tuple[float, float, float, float]:
        elapsed = min(time - self.begin, self.profile.duration)
        share = elapsed / self.profile.duration
        smooth = share**3 * (share * (6.0 * share - 15.0) + 10.0)
        along = self.profile.at_time(elapsed)[0][0] / float(np.linalg.norm(self.goal - self.start))
        x, y, z = (self.start + along * (self.goal - self.start)).tolist()
        return x, y, z, self.heading + smooth * (self.turned - self.heading)


def _profile(distance: float, limits: Limits) -> Any:
    request = ruckig.InputParameter(1)
    request.current_position, request.target_position = [0.0], [distance]
    request.max_velocity, request.max_acceleration = [limits.speed], [limits.acceleration]
    request.max_jerk = [limits.jerk]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"profile: got {result} over {distance} m, expected a solution")
    return trajectory


FOOT = 0.3048
LOWEST = 10.0 * FOOT


def dryden_gusts(
    rng: np.random.Generator, count: int, timestep: float, mean_speed: float, height: float = LOWEST
) -> Array:
    """Wind in the world frame (count, 3), m/s: a mean in a drawn direction and gusts on it."""
    direction = rng.uniform(0.0, 2.0 * math.pi)
    along = np.array([math.cos(direction), math.sin(direction), 0.0])
    if mean_speed == 0.0:
        return np.zeros((count, 3))
    feet = max(height, LOWEST) / FOOT
    shape = 0.177 + 0.000823 * feet
    sigma_up = 0.1 * mean_speed
    sigma_flat = sigma_up / shape**0.4
    time_up = feet * FOOT / mean_speed
    time_flat = feet / shape**1.2 * FOOT / mean_speed
    u = _first_order(rng, count, timestep / time_flat) * sigma_flat
    v = _second_order(rng, count, timestep / time_flat) * sigma_flat
    w = _second_order(rng, count, timestep / time_up) * sigma_up
    across = np.array([-along[1], along[0], 0.0])
    up = np.array([0.0, 0.0, 1.0])
    wind: Array = (mean_speed + u)[:, None] * along + v[:, None] * across + w[:, None] * up
    return wind


def _first_order(rng: np.random.Generator, count: int, step: float) -> Array:
    """Return a process of unit variance, spectrum of 1 / (1 + s), in steps of its time constant."""
    keep = math.exp(-step)
    kicks = rng.standard_normal(count)
    kicks[1:] *= math.sqrt(1.0 - keep * keep)
    series: Array = lfilter([1.0], [1.0, -keep], kicks)
    return series


def _second_order(rng: np.random.Generator, count: int, step: float) -> Array:
    """Return a process of unit variance, spectrum of (1 + sqrt(3) s) / (1 + s)^2.

    That is sqrt(3) / (1 + s) + (1 - sqrt(3)) / (1 + s)^2 of white noise of intensity 1.
    """
    keep = math.exp(-step)
    settle = round(12.0 / step)  # time constants before the series begins
    kicks = rng.standard_normal(settle + count) * math.sqrt(1.0 - keep * keep)
    once = lfilter([1.0], [1.0, -keep], kicks)
    twice = lfilter([1.0 - keep], [1.0, -keep], once)
    # Of unit variance is `once`; the sum's is (3 + (1 - sqrt 3)^2 / 2 + sqrt 3 (1 - sqrt 3)) = 2.
    series: Array = (math.sqrt(3.0) * once + (1.0 - math.sqrt(3.0)) * twice) / math.sqrt(2.0)
    return series[settle:]
