"""`wayproof bench robots`: tracking and robustness of the robots, on many runs of each case.

All randomness of a run comes from the seed, its case and its number. Controllers read a noisy
estimate unless a case says otherwise; errors are against the true state.
"""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from wayproof.harness.bench.jobs import run_jobs
from wayproof.harness.bench.table import Progress
from wayproof.harness.bench.trials import quadrotor as flights
from wayproof.harness.bench.trials import quadruped as walks
from wayproof.harness.bench.trials.estimate import EstimateNoise
from wayproof.harness.bench.trials.quadruped_sim import TIMESTEP, Conditions, TrialSim
from wayproof.models.robots.quadrotor import Quadrotor
from wayproof.models.robots.quadrotor import warm_up as warm_up_quadrotor
from wayproof.models.robots.quadrotor.parameters import Parameters, Smoothing
from wayproof.models.robots.quadrotor.robot import FAST_QUADROTOR
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.quadruped import warm_up as warm_up_quadruped

NOISE = EstimateNoise()
GUSTS = 6.0  # m/s, mean
FLIGHT_TIME = 20.0  # s
SPEED_TIME = 10.0  # s, simulated to time the speed of simulation
SPEED_TRIES = 3
SPEED = "speed"  # the part that is no case


@dataclass(frozen=True)
class RobotRow:
    """Results of all runs of one case; None where a figure does not apply.

    Attributes:
        robot: Name of the robot.
        case: Name of the case.
        runs: Number of runs.
        falls: Number of runs that ended fallen or crashed.
        crossed: Number of runs that reached the end of the course.
        rms_vx: Root mean square over the runs that stayed up of the error of forward velocity,
            averaged over strides of 0.4 s, against the slewed command, m/s.
        rms_vy: Root mean square of the error of the velocity to the left, likewise, m/s.
        rms_wz: Root mean square of the error of the yaw rate, likewise, rad/s.
        rmse_m: Distance from the path (quadruped) or from the moving setpoint (drone), m.
        stop_m: Longest distance from the stop command to standing, m.
        creep_mm: Greatest motion of a foot while standing, mm.
        energy_j: Mean energy of a flight, J: integral of the rotor power by momentum theory.
        realtime_factor: Simulated by processor time of controller and physics on one core; best
            of three.
    """

    robot: str
    case: str
    runs: int
    falls: int
    crossed: int | None = None
    rms_vx: float | None = None
    rms_vy: float | None = None
    rms_wz: float | None = None
    rmse_m: float | None = None
    stop_m: float | None = None
    creep_mm: float | None = None
    energy_j: float | None = None
    realtime_factor: float | None = None


class Run(NamedTuple):
    """One run: fallen or crashed, and the figures that its case has."""

    fallen: bool
    arrived: bool | None = None
    errors: tuple[float, float, float] | None = None
    distance_error: float | None = None
    stop: float | None = None
    creep: float | None = None
    energy: float | None = None


class Case(NamedTuple):
    """Case of the benchmark.

    Attributes:
        robot: Name of the robot.
        name: Name of the case.
        share: Runs for each repeat; at least one in all.
        run: Function from a random generator to one run.
    """

    robot: str
    name: str
    share: float
    run: Callable[[np.random.Generator], Run]


def bench_robots(
    repeats: int, seed: int, progress: Progress, only: str | None = None
) -> list[RobotRow]:
    """Run every case in two processes, then time both robots alone; one row for each.

    Args:
        repeats: Scales the number of runs of each case (see `Case.share`).
        seed: Seed of all random choices.
        progress: Called with a line about what is under way.
        only: Key of `PARTS` to measure; None for all.
    """
    progress("compiling kernels (some seconds the first time, then cached)")
    warm_up_quadruped()
    warm_up_quadrotor()
    runs = run_cases(repeats, seed, progress, only and [only])
    rows = [summarise(case, some) for case, some in zip(CASES, runs, strict=True) if some]
    if only in (None, SPEED):
        progress("robots: speed")
        rows += speed_rows()
    return rows


def run_cases(
    repeats: int, seed: int, progress: Progress, names: Collection[str] | None = None
) -> list[list[Run]]:
    """Run every case, or those named; return the runs in the order of `CASES`."""
    jobs = [
        (number, run)
        for number, case in enumerate(CASES)
        if names is None or case.name in names
        for run in range(max(1, round(case.share * repeats)))
    ]
    found: dict[tuple[int, int], Run] = {}
    for job, one in run_jobs(jobs, partial(run_once, seed)):
        found[job] = one
        falls = sum(run.fallen for run in found.values())
        progress(f"robots: {len(found)} of {len(jobs)} runs, {falls} falls")
    ordered: list[list[Run]] = [[] for _ in CASES]
    for number, run in jobs:
        ordered[number].append(found[number, run])
    return ordered


def run_once(seed: int, number: int, run: int) -> Run:
    """Run a case once; the result does not depend on the process or the order."""
    case = CASES[number]
    own = zlib.crc32(f"{case.robot}, {case.name}".encode())
    return case.run(np.random.default_rng([seed, own, run]))


def summarise(case: Case, runs: list[Run]) -> RobotRow:
    """Return a row of all runs of one case; errors are means of the runs that stayed up."""
    up = [run for run in runs if not run.fallen]
    errors = [run.errors for run in up if run.errors is not None]
    velocity = np.sqrt(np.mean(np.square(errors), axis=0)).tolist() if errors else [None] * 3
    distances = [run.distance_error for run in up if run.distance_error is not None]
    stops = [run.stop for run in up if run.stop is not None]
    creeps = [run.creep for run in up if run.creep is not None]
    energies = [run.energy for run in up if run.energy is not None]
    arrived = [run.arrived for run in runs if run.arrived is not None]
    return RobotRow(
        robot=case.robot,
        case=case.name,
        runs=len(runs),
        falls=len(runs) - len(up),
        crossed=sum(arrived) if arrived else None,
        rms_vx=velocity[0],
        rms_vy=velocity[1],
        rms_wz=velocity[2],
        rmse_m=math.sqrt(np.mean(np.square(distances))) if distances else None,
        stop_m=max(stops) if stops else None,
        creep_mm=1e3 * max(creeps) if creeps else None,
        energy_j=float(np.mean(energies)) if energies else None,
    )


def speed_rows() -> list[RobotRow]:
    """Time controller and physics on one core, the controller reading the truth, nothing drawn."""
    quadruped = min(_timed(_walk_for_speed) for _ in range(SPEED_TRIES))
    drone = min(_timed(_fly_for_speed) for _ in range(SPEED_TRIES))
    return [
        RobotRow("quadruped", SPEED, SPEED_TRIES, 0, realtime_factor=SPEED_TIME / quadruped),
        RobotRow("drone", SPEED, SPEED_TRIES, 0, realtime_factor=SPEED_TIME / drone),
    ]


def _timed(work: Callable[[], None]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def _walk_for_speed() -> None:
    rng = np.random.default_rng(0)
    sim = TrialSim(Quadruped(), Conditions(), noise=None, seconds=SPEED_TIME, rng=rng)
    command = np.array([0.8, 0.1, 0.3])
    while sim.tick * TIMESTEP < SPEED_TIME:
        sim.walk(command)


def _fly_for_speed() -> None:
    rng = np.random.default_rng(0)
    flights.fly(
        Quadrotor(),
        course=flights.figure_of_eight(rng),
        seconds=SPEED_TIME,
        wind_speed=0.0,
        noise=None,
        rng=rng,
    )


def _commands(
    rng: np.random.Generator,
    friction: tuple[float, float] = (0.8, 0.8),
    payload: float = 0.0,
    delay: float = 0.0,
    kick: float = 0.0,
    speeds: tuple[float, float, float] = walks.SPEEDS,
    noise: EstimateNoise | None = NOISE,
) -> Run:
    """Walk by random commands; friction and the payload's place on the back are drawn."""
    place = rng.uniform([-0.05, -0.03, 0.12], [0.05, 0.03, 0.14])
    conditions = Conditions(rng.uniform(*friction), payload, tuple(place.tolist()), delay)
    result = walks.follow_commands(Quadruped(), conditions, noise, rng, speeds=speeds, kick=kick)
    return Run(result.fallen, errors=result.errors)


def _terrain(rng: np.random.Generator, name: str) -> Run:
    result = walks.cross_terrain(Quadruped(), Conditions(), NOISE, rng, terrain=name)
    return Run(result.fallen, result.arrived)


def _stop(rng: np.random.Generator) -> Run:
    result = walks.stop_from(Quadruped(), NOISE, rng)
    return Run(result.fallen, stop=result.distance)


def _stand(rng: np.random.Generator, noise: EstimateNoise | None) -> Run:
    result = walks.stand(Quadruped(), noise, rng)
    return Run(result.fallen, creep=result.creep)


def _path(rng: np.random.Generator) -> Run:
    result = walks.follow_path(Quadruped(), NOISE, rng)
    return Run(result.fallen, distance_error=result.error)


def _flight(
    rng: np.random.Generator,
    draw_course: Callable[[np.random.Generator], flights.Course],
    wind: float = 0.0,
    noise: EstimateNoise | None = None,
    robot: Quadrotor | None = None,
) -> Run:
    course = draw_course(rng)
    result = flights.fly(
        robot or Quadrotor(), course, seconds=FLIGHT_TIME, wind_speed=wind, noise=noise, rng=rng
    )
    return Run(result.crashed, distance_error=result.error, energy=result.energy)


def _random_flight(rng: np.random.Generator) -> Run:
    """Fly by drawn speed, points, headings, pauses and gusts of a mean up to 6 m/s."""
    limits = flights.Limits(speed=rng.uniform(0.5, 3.0))
    return _flight(rng, partial(_points, limits=limits), rng.uniform(0.0, GUSTS), NOISE)


def _fast_flight(rng: np.random.Generator) -> Run:
    """Fly at 5 m/s, with a smoothing filter for that speed: the robot's own stops at 3 m/s."""
    smoothing = Smoothing(limits=(6.0, 8.0, 100.0, 2000.0))
    course = partial(_points, limits=flights.Limits(speed=5.0), far=24.0)
    return _flight(rng, course, robot=Quadrotor(Parameters(smoothing=smoothing)))


def _winding(rng: np.random.Generator, wind: float = 0.0) -> Run:
    """Return paths as navigation plans them, at the full limits; a noisy estimate."""
    draw = partial(flights.winding, limits=flights.motion_limits(FAST_QUADROTOR))
    return _flight(rng, draw, wind, NOISE, robot=FAST_QUADROTOR)


_eight = flights.figure_of_eight
_points = partial(flights.point_to_point, seconds=FLIGHT_TIME)

CASES = (
    Case("quadruped", "commands", 10, _commands),
    Case("quadruped", "commands, exact state", 2, partial(_commands, noise=None)),
    Case("quadruped", "kicks 1.0 m/s", 4, partial(_commands, kick=1.0)),
    Case("quadruped", "kicks 1.5 m/s", 4, partial(_commands, kick=1.5)),
    Case("quadruped", "friction 0.4-1.0", 10, partial(_commands, friction=(0.4, 1.0))),
    Case("quadruped", "payload 5 kg", 3, partial(_commands, payload=5.0)),
    Case("quadruped", "delay 6 ms", 3, partial(_commands, delay=0.006)),
    Case("quadruped", "2.0 m/s", 2, partial(_commands, speeds=(2.0, 0.4, 1.0))),
    Case("quadruped", "2.0 rad/s", 2, partial(_commands, speeds=(1.0, 0.4, 2.0))),
    Case("quadruped", "planks 3 cm", 4, partial(_terrain, name="planks")),
    Case("quadruped", "stairs 8 cm", 4, partial(_terrain, name="stairs")),
    Case("quadruped", "rubble 5 cm", 4, partial(_terrain, name="rubble")),
    Case("quadruped", "ramps 0.3 rad", 4, partial(_terrain, name="ramps")),
    Case("quadruped", "path at 1 m/s", 2, _path),
    Case("quadruped", "stop from 1.5 m/s", 2, _stop),
    Case("quadruped", "stand 60 s", 0.2, partial(_stand, noise=NOISE)),
    Case("quadruped", "stand 60 s, exact state", 0.1, partial(_stand, noise=None)),
    Case("drone", "hover", 0.2, partial(_flight, draw_course=flights.hover)),
    Case("drone", "figure of eight 3 m/s", 0.5, partial(_flight, draw_course=_eight)),
    Case("drone", "points 3 m/s", 1, partial(_flight, draw_course=_points)),
    Case("drone", "points 5 m/s", 1, _fast_flight),
    Case("drone", "hover, gusts", 1, partial(_flight, draw_course=flights.hover, wind=GUSTS)),
    Case("drone", "figure of eight, gusts", 1, partial(_flight, draw_course=_eight, wind=GUSTS)),
    Case("drone", "points, gusts", 1, partial(_flight, draw_course=_points, wind=GUSTS)),
    Case("drone", "random flights", 10, _random_flight),
    Case("drone", "winding 4 m/s", 10, _winding),
    Case("drone", "winding 4 m/s, gusts", 10, partial(_winding, wind=GUSTS)),
)  # fmt: skip
"""Names of the parts, in the order of the rows."""

PARTS = (*dict.fromkeys(case.name for case in CASES), SPEED)
