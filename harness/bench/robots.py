"""`wayproof bench robots`: speed and tracking of the robots by themselves, on a flat floor."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from statistics import median

import mujoco
import numpy as np

from wayproof.harness.bench.table import Progress, Row
from wayproof.models.robots import FAST_ROBOTS, Setpoint
from wayproof.models.robots.quadrotor import warm_up as warm_up_quadrotor
from wayproof.models.robots.quadruped import warm_up as warm_up_quadruped
from wayproof.models.robots.robot import ROBOT_PREFIX

SECONDS = 10.0  # s, simulated, of each run
TIMESTEP = 0.002  # s
SETTLE = 2.0  # s, from which errors count
RAMP = 4.0  # s, in which a course comes to its speed
HEIGHT = 2.0  # m, of flights

SCENE = f"""\
<mujoco>
  <option timestep="{TIMESTEP}" integrator="implicitfast" cone="pyramidal" iterations="50"/>
  <default><geom group="0" contype="1" conaffinity="1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" friction="0.8 0.005 0.0001"/>
  </worldbody>
</mujoco>
"""

Course = Callable[[float], Setpoint]
"""Function from time, s, to what to follow."""


def bench_robots(repeats: int, seed: int, progress: Progress) -> list[Row]:
    """Have each robot follow figures of eight at a drawn heading; one row for each.

    A row has the `robot`, its `runs` and its `falls`; the root mean square distance from the moving
    setpoint, `error_m`, in the mean; the greatest speed, `speed_m_s`; simulated seconds a second of
    processor time of physics and controller, the greatest and the median, `real_max` and `real`;
    `physics`, the share of MuJoCo's steps in that time.
    """
    warm_up_quadruped()
    warm_up_quadrotor()
    rows = []
    for name, speed, size in (("quadruped", 1.0, 4.0), ("drone", 3.0, 6.0)):
        runs = []
        for number in range(repeats):
            progress(f"robots: {name}, {number} of {repeats} runs")
            rng = np.random.default_rng([seed, number])
            course = figure_of_eight(size, speed, rng.uniform(-math.pi, math.pi), name)
            runs.append(follow(name, course))
        up = [run for run in runs if not run["fallen"]]
        real = [SECONDS / run["seconds"] for run in up]
        rows.append({
            "robot": name,
            "runs": repeats,
            "falls": repeats - len(up),
            "error_m": float(np.mean([run["error"] for run in up])) if up else None,
            "speed_m_s": max((run["speed"] for run in up), default=None),
            "real_max": max(real, default=None),
            "real": median(real) if up else None,
            "physics": median(run["physics"] / run["seconds"] for run in up) if up else None,
        })  # fmt: skip
    return rows


def figure_of_eight(size: float, speed: float, heading: float, robot: str) -> Course:
    """Return a course along a Lissajous figure, its pace growing smoothly from rest.

    Args:
        size: Length of the figure, m; half as wide.
        speed: Greatest, in its middle, m/s.
        heading: Of the figure, rad.
        robot: A drone keeps the heading and flies 2 m high, a quadruped faces along its way.
    """
    length, width = size / 2, size / 4
    rate = speed / math.hypot(length, 2.0 * width)
    turn = complex(math.cos(heading), math.sin(heading))

    def course(time: float) -> Setpoint:
        share = min(time / RAMP, 1.0)
        # The integral of the smooth step 6 s^5 - 15 s^4 + 10 s^3, and the step itself.
        paced = RAMP * share**4 * (share * share - 3.0 * share + 2.5) + max(time - RAMP, 0.0)
        pace = rate * share**3 * (6.0 * share * share - 15.0 * share + 10.0)
        phase = rate * paced
        place = complex(length * math.sin(phase), width * math.sin(2.0 * phase)) * turn
        along = complex(length * math.cos(phase), 2.0 * width * math.cos(2.0 * phase)) * turn
        velocity = (pace * along.real, pace * along.imag, 0.0)
        if robot == "drone":
            return Setpoint((place.real, place.imag, HEIGHT), velocity, heading, 0.0)
        bent = complex(-length * math.sin(phase), -4.0 * width * math.sin(2.0 * phase)) * turn
        yaw_rate = pace * (along.conjugate() * bent).imag / abs(along) ** 2
        faces = math.atan2(along.imag, along.real)
        return Setpoint((place.real, place.imag, 0.0), velocity, faces, yaw_rate)

    return course


def follow(name: str, course: Course) -> dict[str, float]:
    """Follow a course from rest; return error, m, speed, m/s, whether it fell, and times, s.

    `seconds` is the processor time of controller and physics, `physics` that of MuJoCo's steps.
    """
    robot = FAST_ROBOTS[name]
    world = mujoco.MjSpec.from_string(SCENE)
    body = mujoco.MjSpec.from_string(robot.mjcf())
    world.attach(body, prefix=ROBOT_PREFIX, frame=world.worldbody.add_frame())
    model = world.compile()
    data = mujoco.MjData(model)
    controller = robot.controller(model, ROBOT_PREFIX)
    first = course(0.0)
    height = HEIGHT if name == "drone" else robot.spec.rest_height
    controller.reset(data, np.array([0.0, 0.0, height]), first.heading)
    base, upright = model.body(f"{ROBOT_PREFIX}base").id, math.cos(robot.spec.max_tilt)
    ticks = round(SECONDS / TIMESTEP)
    wanted, been = np.empty((ticks, 2)), np.empty((ticks, 2))
    control = physics = 0.0
    fallen = False
    for tick in range(ticks):
        setpoint = course(tick * TIMESTEP)
        wanted[tick], been[tick] = setpoint.position[:2], data.qpos[:2]
        began = time.process_time()
        controller.follow(data, setpoint)
        between = time.process_time()
        mujoco.mj_step(model, data)
        physics += time.process_time() - between
        control += between - began
        fallen = fallen or not data.xmat[base, 8] > upright  # true for NaN, too
    late = round(SETTLE / TIMESTEP)
    steps = np.linalg.norm(np.diff(been, axis=0), axis=1)
    return {
        "fallen": fallen,
        "error": float(np.sqrt(((been - wanted)[late:] ** 2).sum(axis=1).mean())),
        "speed": float(steps.max()) / TIMESTEP,
        "seconds": control + physics,
        "physics": physics,
    }
