"""Tracking and robustness of the robots, on many runs of each case.

`python -m tests.tools.trials.robots --repeats 10` prints the table.

All randomness of a run comes from the seed, its case and its number. Controllers read a noisy
estimate unless a case says otherwise; errors are against the true state.
"""

from __future__ import annotations

import argparse
import math
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from tests.tools.trials import quadrotor as flights
from tests.tools.trials import quadruped as walks
from tests.tools.trials.estimate import EstimateNoise, Run
from tests.tools.trials.quadruped_sim import Conditions
from wayproof.harness.bench.table import Progress, Row, print_rows
from wayproof.harness.worker_pool import WorkerPool
from wayproof.models.robots.quadrotor import Quadrotor
from wayproof.models.robots.quadrotor import warm_up as warm_up_quadrotor
from wayproof.models.robots.quadrotor.parameters import Parameters, Smoothing
from wayproof.models.robots.quadrotor.robot import FAST_QUADROTOR
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.quadruped import warm_up as warm_up_quadruped

NOISE = EstimateNoise()
GUSTS = 6.0  # m/s, mean
FLIGHT_TIME = 20.0  # s


class Case(NamedTuple):
    """Case of the benchmark."""

    robot: str
    name: str
    share: float
    run: Callable[[np.random.Generator], Run]


def run_cases(
    repeats: int, seed: int, progress: Progress, only: str | None = None
) -> list[tuple[Case, list[Run]]]:
    """Run every case, or the one of a name, in two processes; `repeats` scales the runs of each."""
    warm_up_quadruped()
    warm_up_quadrotor()
    jobs = [
        (seed, number, run)
        for number, case in enumerate(CASES)
        if only in (None, case.name)
        for run in range(max(1, round(case.share * repeats)))
    ]
    found: list[list[Run]] = [[] for _ in CASES]
    with WorkerPool(2) as pool:
        for (_, number, run), one in zip(jobs, pool.run_in_order(run_once, jobs), strict=True):
            found[number].append(one)
            progress(f"{CASES[number].name} {run}: {'fell' if one.fallen else 'stayed up'}")
    return [(case, some) for case, some in zip(CASES, found, strict=True) if some]


def run_once(seed: int, number: int, run: int) -> Run:
    """Run a case once; the result does not depend on the process or the order."""
    case = CASES[number]
    own = zlib.crc32(f"{case.robot}, {case.name}".encode())
    return case.run(np.random.default_rng([seed, own, run]))


def summarise(case: Case, runs: list[Run]) -> Row:
    """Return a row of all runs of one case; errors are means of the runs that stayed up.

    The figures that the case has: runs that `crossed` the course; root mean square errors of
    velocity, `vx` and `vy` in m/s and `wz` in rad/s, by strides of 0.4 s; distance `rmse_m` from
    the path or moving setpoint; longest `stop_m`; greatest `creep_mm` of a foot; mean `energy_j`.
    """
    up = [run for run in runs if not run.fallen]

    def of(field: str, some: list[Run]) -> list[Any]:
        return [value for run in some if (value := getattr(run, field)) is not None]

    row: Row = {"robot": case.robot, "case": case.name, "runs": len(runs)}
    row["falls"] = len(runs) - len(up)
    if arrived := of("arrived", runs):
        row["crossed"] = sum(arrived)
    if errors := of("errors", up):
        mean = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
        row |= dict(zip(("vx", "vy", "wz"), mean, strict=True))
    if distances := of("error", up):
        row["rmse_m"] = math.sqrt(np.mean(np.square(distances)))
    if stops := of("distance", up):
        row["stop_m"] = max(stops)
    if creeps := of("creep", up):
        row["creep_mm"] = 1e3 * max(creeps)
    if energies := of("energy", up):
        row["energy_j"] = float(np.mean(energies))
    return row


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
    return walks.follow_commands(Quadruped(), conditions, noise, rng, speeds=speeds, kick=kick)


def _walk(rng: np.random.Generator, trial: Callable[..., Run], **options: Any) -> Run:
    """Walk a trial, with a noisy estimate unless the options say otherwise."""
    options = {"noise": NOISE, **options}
    return trial(Quadruped(), rng=rng, **options)


_terrain = partial(_walk, trial=walks.cross_terrain, conditions=Conditions())
_stand = partial(_walk, trial=walks.stand)


def _flight(
    rng: np.random.Generator,
    draw_course: Callable[[np.random.Generator], flights.Course],
    wind: float = 0.0,
    noise: EstimateNoise | None = None,
    robot: Quadrotor | None = None,
) -> Run:
    course = draw_course(rng)
    return flights.fly(
        robot or Quadrotor(), course, seconds=FLIGHT_TIME, wind_speed=wind, noise=noise, rng=rng
    )


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
    Case("quadruped", "planks 3 cm", 4, partial(_terrain, terrain="planks")),
    Case("quadruped", "stairs 8 cm", 4, partial(_terrain, terrain="stairs")),
    Case("quadruped", "rubble 5 cm", 4, partial(_terrain, terrain="rubble")),
    Case("quadruped", "ramps 0.3 rad", 4, partial(_terrain, terrain="ramps")),
    Case("quadruped", "path at 1 m/s", 2, partial(_walk, trial=walks.follow_path)),
    Case("quadruped", "stop from 1.5 m/s", 2, partial(_walk, trial=walks.stop_from)),
    Case("quadruped", "stand 60 s", 0.2, _stand),
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


def main() -> None:
    """Run the cases and print their table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=[case.name for case in CASES])
    options = parser.parse_args()
    console = Console()
    found = run_cases(options.repeats, options.seed, console.print, options.only)
    print_rows(console, "trials", [summarise(case, runs) for case, runs in found])


if __name__ == "__main__":
    main()
