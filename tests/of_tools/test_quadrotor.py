"""Gusts and flights of the quadrotor under trial."""

import math

import numpy as np
import pytest

from tests.tools.trials import quadrotor as flights
from tests.tools.trials.estimate import EstimateNoise
from tests.tools.trials.wind import dryden_gusts
from wayproof.models.robots import FAST_ROBOTS, ROBOTS
from wayproof.models.robots.quadrotor import Quadrotor, warm_up
from wayproof.models.robots.quadrotor.parameters import Airframe

ROBOT = Quadrotor()


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def rng(number):
    return np.random.default_rng([37, number])


def test_gusts_have_the_specified_mean_and_spread():
    wind = dryden_gusts(rng(0), 1_000_000, 0.01, 6.0)
    flat = 0.6 / (0.177 + 0.00823) ** 0.4  # MIL-F-8785C at 10 ft, 6 m/s at 20 ft
    mean = wind.mean(axis=0)
    assert np.hypot(*mean[:2]) == pytest.approx(6.0, rel=0.02)
    along = mean[:2] / np.hypot(*mean[:2])
    across = np.array([-along[1], along[0]])
    assert (wind[:, :2] @ along).std() == pytest.approx(flat, rel=0.05)
    assert (wind[:, :2] @ across).std() == pytest.approx(flat, rel=0.05)
    assert wind[:, 2].std() == pytest.approx(0.6, rel=0.05)
    assert not dryden_gusts(rng(0), 10, 0.01, 0.0).any()


def test_hover_power_by_hand():
    thrust = 1.325 * 9.81 / 4
    induced = math.sqrt(thrust / (2 * 1.225 * math.pi * 0.13**2))  # m/s, through the disc
    expected = 4 * thrust * induced / 0.6
    assert flights.rotor_power(Airframe(), np.full(4, thrust)) == pytest.approx(expected)
    hover = flights.fly(ROBOT, flights.hover(rng(1)), 3.0, 0.0, None, rng(1))
    assert hover.energy == pytest.approx(3.0 * expected, rel=1e-3)
    assert hover.error < 1e-4


@pytest.mark.parametrize(
    ("draw", "wind", "limit"),
    [
        (flights.figure_of_eight, 0.0, 0.02),
        (lambda rng: flights.point_to_point(rng, 8.0), 0.0, 0.02),
        (lambda rng: flights.point_to_point(rng, 8.0), 6.0, 0.12),
    ],
)
def test_flights_stay_near_their_course(draw, wind, limit):
    flown = flights.fly(ROBOT, draw(rng(2)), 8.0, wind, None, rng(2))
    assert not flown.fallen
    assert flown.error < limit
    assert 2.5 < flown.top_speed < 3.3


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["plain", "fast"])
def test_what_navigation_may_ask_is_flown_while_it_turns_about_in_gusts(name):
    robot = {"plain": ROBOTS, "fast": FAST_ROBOTS}[name]["drone"]
    asked = robot.limits
    limits = flights.Limits(asked.speed, asked.acceleration, asked.jerk)
    for seed in range(4):
        course = flights.turning_about(rng(seed), 8.0, asked.yaw_rate, limits)
        flown = flights.fly(robot, course, 8.0, 6.0, EstimateNoise(), rng(seed))
        assert not flown.fallen
        assert flown.error < 0.1


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["plain", "fast"])
def test_paths_of_navigation_are_flown_at_its_limits(name):
    robot = {"plain": ROBOTS, "fast": FAST_ROBOTS}[name]["drone"]
    for seed in range(8):
        course = flights.winding(rng(seed), flights.motion_limits(robot))
        flown = flights.fly(robot, course, 8.0, 6.0, EstimateNoise(), rng(seed))
        assert not flown.fallen
        assert flown.error < 0.1


def test_touching_the_floor_is_a_crash():
    flown = flights.fly(ROBOT, lambda t: (0.0, 0.0, 0.5 - 0.5 * t, 0.0), 4.0, 0.0, None, rng(4))
    assert flown.fallen
    assert flown.seconds < 3.0
