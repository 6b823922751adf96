"""Trials of the quadruped: commands, terrain, stops, standing and paths.

Nothing here controls: commands go in at one end, what the body truly did comes out at the other.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from scipy.spatial import KDTree

from tests.tools.trials.estimate import EstimateNoise, Run
from tests.tools.trials.quadruped_sim import COURSE_END, TERRAINS, TIMESTEP, Conditions, TrialSim
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import LEGS
from wayproof.models.robots.quadruped.robot import Quadruped
from wayproof.models.robots.robot import ROBOT_PREFIX, Setpoint

Velocity = tuple[float, float, float]

STRIDE = 0.4
"""Velocities are averaged over this long, s: one cycle of the gait, whose sway is no error."""

SPEEDS = (1.5, 0.4, 1.0)
"""Largest commands drawn: forward, m/s (backward a third), left, m/s, and yaw rate, rad/s."""


def follow_commands(
    robot: Quadruped,
    conditions: Conditions,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
    seconds: float = 20.0,
    speeds: Velocity = SPEEDS,
    kick: float = 0.0,
) -> Run:
    """Walk by random commands, each for 1.5 to 4 s, of which a tenth is standing still."""
    sim = TrialSim(robot, conditions, noise, seconds, rng)
    ticks = round(seconds / TIMESTEP)
    moved, commanded = np.zeros((ticks, 3)), np.zeros((ticks, 3))
    command, change_at, kick_at = np.zeros(3), 0.0, rng.uniform(3.0, 5.0)
    while sim.tick < ticks and not sim.fallen:
        now = sim.tick * TIMESTEP
        if now >= change_at:
            command, change_at = draw_command(rng, speeds), now + rng.uniform(1.5, 4.0)
        if kick and now >= kick_at:
            angle = rng.uniform(0.0, 2.0 * math.pi)
            sim.push(kick * np.array([math.cos(angle), math.sin(angle)]))
            kick_at = now + rng.uniform(3.0, 5.0)
        sim.walk(command)
        moved[sim.tick - 1] = body_velocity(sim.data)
        commanded[sim.tick - 1] = sim.controller.memory.command
    errors = stride_rms(moved - commanded, sim.tick)
    return Run(sim.fallen, sim.tick * TIMESTEP, errors=errors)


def draw_command(rng: np.random.Generator, speeds: Velocity) -> Array:
    """Stand (a tenth), straight on (a fifth), or all three at once."""
    kind = rng.random()
    forward = rng.uniform(-speeds[0] / 3.0, speeds[0])
    if kind < 0.1:
        return np.zeros(3)
    if kind < 0.3:
        return np.array([forward, 0.0, 0.0])
    return np.array([forward, *(speed * rng.uniform(-1.0, 1.0) for speed in speeds[1:])])


def body_velocity(data: mujoco.MjData) -> Velocity:
    """Return the base's true forward, left (yaw frame, m/s) and yaw rate (rad/s)."""
    w, x, y, z = data.qpos[3:7].tolist()
    vx, vy, _, _, _, rate = data.qvel[:6].tolist()
    ahead, aside = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    norm = math.hypot(ahead, aside)
    return (ahead * vx + aside * vy) / norm, (ahead * vy - aside * vx) / norm, rate


def stride_rms(errors: Array, ticks: int) -> tuple[float, float, float]:
    """Return the RMS of the moving average over a stride of (n, 3), of the first `ticks`."""
    window = round(STRIDE / TIMESTEP)
    if ticks < window:
        return math.nan, math.nan, math.nan
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), errors[:ticks]]), axis=0)
    means = (sums[window:] - sums[:-window]) / window
    x, y, yaw = np.sqrt((means**2).mean(axis=0)).tolist()
    return x, y, yaw


def cross_terrain(
    robot: Quadruped,
    conditions: Conditions,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
    terrain: str,
    speed: float = 0.5,
) -> Run:
    """Walk along +x over a course drawn anew, steered by heading and offset alone: blind.

    It has twice the time that the commanded speed would take.
    """
    blocks = TERRAINS[terrain](rng)
    seconds = 2.0 * COURSE_END / speed
    sim = TrialSim(
        robot, conditions=conditions._replace(blocks=blocks), noise=noise, seconds=seconds, rng=rng
    )
    while sim.tick * TIMESTEP < seconds and not sim.fallen:
        x, y = sim.data.qpos[:2].tolist()
        if x > COURSE_END:
            break
        heading = 2.0 * math.atan2(sim.data.qpos[6], sim.data.qpos[3])
        steer = np.clip([-y, -2.0 * heading], [-0.2, -0.5], [0.2, 0.5])
        sim.walk(np.array([speed, *steer]))
    arrived = bool(sim.data.qpos[0] > COURSE_END)
    return Run(sim.fallen, sim.tick * TIMESTEP, arrived=arrived)


def stop_from(
    robot: Quadruped,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
    speed: float = 1.5,
    jerk: float = 15.0,
) -> Run:
    """Run for 2 to 3 s, then brake as hard as the gait does, the deceleration limited in jerk."""
    deceleration = robot.parameters.gait.linear_acceleration
    sim = TrialSim(robot, Conditions(), noise, seconds=6.0, rng=rng)
    run_time = rng.uniform(2.0, 3.0)
    while sim.tick * TIMESTEP < run_time:
        sim.walk(np.array([speed, 0.0, 0.0]))
    start = sim.data.qpos[:2].copy()
    command, rate = speed, 0.0
    while sim.tick * TIMESTEP < run_time + 3.0 and not sim.fallen:
        # Ease off where the speed left is what easing off at this jerk takes.
        target = deceleration if command > rate * rate / (2.0 * jerk) else 0.0
        rate += min(max(target - rate, -jerk * TIMESTEP), jerk * TIMESTEP)
        command = max(command - rate * TIMESTEP, 0.0)
        sim.walk(np.array([command, 0.0, 0.0]))
    distance = float(np.hypot(*(sim.data.qpos[:2] - start)))
    return Run(sim.fallen, sim.tick * TIMESTEP, distance=distance)


def stand(
    robot: Quadruped, noise: EstimateNoise | None, rng: np.random.Generator, seconds: float = 60.0
) -> Run:
    """Measure a body that stands without a command."""
    sim = TrialSim(robot, Conditions(), noise, seconds, rng)
    feet = [sim.model.geom(f"{ROBOT_PREFIX}{leg}_foot").id for leg in LEGS]
    places = []
    while sim.tick * TIMESTEP < seconds and not sim.fallen:
        sim.walk(np.zeros(3))
        if sim.tick % 500 == 0:
            places.append(sim.data.geom_xpos[feet, :2].copy())
    moved = np.linalg.norm(np.array(places) - places[0], axis=2)
    return Run(sim.fallen, sim.tick * TIMESTEP, creep=float(moved.max()))


def follow_path(
    robot: Quadruped,
    noise: EstimateNoise | None,
    rng: np.random.Generator,
    length: float = 20.0,
    speed: float = 1.0,
    acceleration: float = 1.0,
) -> Run:
    """Return setpoints along straight lines and arcs in turn, from rest, facing along the path."""
    course = draw_course(rng, length)
    ticks = round((length / speed + 0.5 * speed / acceleration) / TIMESTEP)
    sim = TrialSim(robot, Conditions(), noise, seconds=ticks * TIMESTEP, rng=rng)
    desired, actual = np.zeros((ticks, 2)), np.zeros((ticks, 2))
    along = pace = 0.0
    while sim.tick < ticks and not sim.fallen:
        pace = min(pace + acceleration * TIMESTEP, speed)
        along += pace * TIMESTEP
        x, y, heading, curvature = course_at(course, along)
        velocity = pace * math.cos(heading), pace * math.sin(heading), 0.0
        sim.follow(Setpoint((x, y, 0.0), velocity, heading, pace * curvature))
        desired[sim.tick - 1] = x, y
        actual[sim.tick - 1] = sim.data.qpos[:2]
    distances, _ = KDTree(desired[: sim.tick]).query(actual[: sim.tick])
    error = math.sqrt(float((distances**2).mean()))
    return Run(sim.fallen, sim.tick * TIMESTEP, error=error)


Course = list[tuple[float, float]]
"""Length (m) and curvature (1/m) of each piece."""


def draw_course(rng: np.random.Generator, length: float) -> Course:
    """Return lines of 1 to 3 m and arcs of 0.8 to 2 rad with radii of 1.2 to 2.5 m in turn."""
    pieces: Course = []
    while sum(piece for piece, _ in pieces) < length:
        radius = rng.uniform(1.2, 2.5)
        turn = rng.uniform(0.8, 2.0)
        pieces.append((rng.uniform(1.0, 3.0), 0.0))
        pieces.append((radius * turn, rng.choice([-1.0, 1.0]) / radius))
    return pieces


def course_at(course: Course, along: float) -> tuple[float, float, float, float]:
    """Return x, y (m), heading (rad) and curvature (1/m) at an arc length from the origin."""
    x = y = heading = 0.0
    for length, curvature in course:
        part = min(along, length)
        turn = curvature * part
        # The chord of an arc: sin(turn / 2) / (turn / 2) of its length, at half its turn.
        chord = part * float(np.sinc(0.5 * turn / math.pi))
        x += chord * math.cos(heading + 0.5 * turn)
        y += chord * math.sin(heading + 0.5 * turn)
        heading += turn
        along -= part
        if along <= 0.0:
            break
    return x, y, heading, curvature
