"""The robots under trial, in small: gusts, noise, slip, load, delay, kicks, blind terrain."""

import math

import mujoco
import numpy as np
import pytest

from tests.tools.trials import quadrotor as flights
from tests.tools.trials import quadruped as walks
from tests.tools.trials.estimate import EstimateNoise, Run
from tests.tools.trials.quadrotor import dryden_gusts
from tests.tools.trials.quadruped_sim import Conditions, TrialSim
from tests.tools.trials.robots import CASES, Case, run_cases, run_once, summarise
from wayproof.models.robots import FAST_ROBOTS, ROBOTS, quadrotor, quadruped
from wayproof.models.robots.kernel_data import packed
from wayproof.models.robots.quadrotor.parameters import Airframe
from wayproof.models.robots.quadruped.body import MEMORY, OBSERVATION, record
from wayproof.models.robots.quadruped.gait import advance
from wayproof.models.robots.quadruped.legs import limit_torque
from wayproof.models.robots.quadruped.parameters import Gait, Parameters, Prediction
from wayproof.models.robots.quadruped.reference import Horizon, predict_horizon

DRONE, WALKER = quadrotor.Quadrotor(), quadruped.Quadruped()
NOISE = EstimateNoise()
SECONDS = 6.0


@pytest.fixture(scope="module", autouse=True)
def compiled():
    quadrotor.warm_up()
    quadruped.warm_up()


def rng(number):
    return np.random.default_rng([31, number])


def drawn(number):
    return np.random.default_rng([37, number])


def test_a_row_by_hand():
    case = Case("quadruped", "hops", 1, lambda rng: Run(False))
    runs = [
        Run(False, 1.0, True, (0.3, 0.0, 0.1), 0.03, 0.5, 0.001, None, 10.0),
        Run(False, 1.0, False, (0.4, 0.0, 0.1), 0.04, 0.7, 0.003, None, 20.0),
        Run(True, 1.0, False, (9.0, 9.0, 9.0), 9.0, 9.0, 9.0, None, 9.0),
    ]
    row = summarise(case, runs)
    assert (row["runs"], row["falls"], row["crossed"]) == (3, 1, 1)
    assert row["vx"] == pytest.approx(math.sqrt(0.125))
    assert (row["vy"], row["wz"]) == pytest.approx((0.0, 0.1))
    assert row["rmse_m"] == pytest.approx(math.sqrt(0.00125))
    assert (row["stop_m"], row["creep_mm"], row["energy_j"]) == pytest.approx((0.7, 3.0, 15.0))


@pytest.mark.large
def test_runs_are_the_same_in_any_process():
    number = next(n for n, case in enumerate(CASES) if case.name == "hover, gusts")
    [(case, runs)] = run_cases(1, 5, print, only="hover, gusts")
    assert (case.name, runs) == ("hover, gusts", [run_once(5, number, 0)])
    assert run_once(5, number, 1) != run_once(5, number, 0)


def test_gusts_have_the_specified_mean_and_spread():
    wind = dryden_gusts(drawn(0), 1_000_000, 0.01, 6.0)
    flat = 0.6 / (0.177 + 0.00823) ** 0.4  # MIL-F-8785C at 10 ft, 6 m/s at 20 ft
    mean = wind.mean(axis=0)
    assert np.hypot(*mean[:2]) == pytest.approx(6.0, rel=0.02)
    along = mean[:2] / np.hypot(*mean[:2])
    across = np.array([-along[1], along[0]])
    assert (wind[:, :2] @ along).std() == pytest.approx(flat, rel=0.05)
    assert (wind[:, :2] @ across).std() == pytest.approx(flat, rel=0.05)
    assert wind[:, 2].std() == pytest.approx(0.6, rel=0.05)
    assert not dryden_gusts(drawn(0), 10, 0.01, 0.0).any()


def test_hover_power_by_hand():
    thrust = 1.325 * 9.81 / 4
    induced = math.sqrt(thrust / (2 * 1.225 * math.pi * 0.13**2))  # m/s, through the disc
    expected = 4 * thrust * induced / 0.6
    assert flights.rotor_power(Airframe(), np.full(4, thrust)) == pytest.approx(expected)
    hover = flights.fly(DRONE, flights.hover(drawn(1)), 3.0, 0.0, None, drawn(1))
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
    flown = flights.fly(DRONE, draw(drawn(2)), 8.0, wind, None, drawn(2))
    assert not flown.fallen
    assert flown.error < limit
    assert 2.5 < flown.top_speed < 3.3


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["plain", "fast"])
def test_what_navigation_may_ask_is_flown_while_it_turns_about_in_gusts(name):
    robot = {"plain": ROBOTS, "fast": FAST_ROBOTS}[name]["drone"]
    asked = robot.limits
    limits = flights.Limits(asked.speed, asked.acceleration, asked.jerk)
    for seed in range(2):
        course = flights.turning_about(drawn(seed), 8.0, asked.yaw_rate, limits)
        flown = flights.fly(robot, course, 8.0, 6.0, NOISE, drawn(seed))
        assert not flown.fallen
        assert flown.error < 0.1


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["plain", "fast"])
def test_paths_of_navigation_are_flown_at_its_limits(name):
    robot = {"plain": ROBOTS, "fast": FAST_ROBOTS}[name]["drone"]
    for seed in range(3):
        course = flights.winding(drawn(seed), flights.motion_limits(robot))
        flown = flights.fly(robot, course, 8.0, 6.0, NOISE, drawn(seed))
        assert not flown.fallen
        assert flown.error < 0.1


def test_touching_the_floor_is_a_crash():
    flown = flights.fly(DRONE, lambda t: (0.0, 0.0, 0.5 - 0.5 * t, 0.0), 4.0, 0.0, None, drawn(4))
    assert flown.fallen
    assert flown.seconds < 3.0


def test_tracks_random_commands_with_a_noisy_estimate():
    result = walks.follow_commands(WALKER, Conditions(), NOISE, rng(0), 10.0)
    assert not result.fallen
    assert result.seconds == pytest.approx(10.0)
    assert (np.array(result.errors) < [0.07, 0.06, 0.03]).all()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("conditions", "kick"),
    [
        (Conditions(friction=0.4), 0.0),
        (Conditions(payload=5.0), 0.0),
        (Conditions(delay=0.006), 0.0),
        (Conditions(), 1.0),
    ],
)
def test_stays_up_on_what_it_is_not_told(conditions, kick):
    result = walks.follow_commands(WALKER, conditions, NOISE, rng(1), SECONDS, kick=kick)
    assert not result.fallen
    assert (np.array(result.errors) < 0.3).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("terrain", ["planks", "stairs", "rubble", "ramps"])
def test_crosses_terrain_blindly(terrain):
    result = walks.cross_terrain(WALKER, Conditions(), NOISE, rng(2), terrain)
    assert result.arrived
    assert not result.fallen


def test_stops_stands_and_follows_a_path():
    stop = walks.stop_from(WALKER, NOISE, rng(3))
    assert not stop.fallen
    shortest = 1.5**2 / (2.0 * WALKER.parameters.gait.linear_acceleration)
    assert shortest < stop.distance < shortest + 0.3
    stood = walks.stand(WALKER, None, rng(4), 5.0)
    assert not stood.fallen
    assert stood.creep < 1e-4
    followed = walks.follow_path(WALKER, NOISE, rng(5), length=8.0)
    assert not followed.fallen
    assert followed.error < 0.03


def test_no_limit_of_torque_speed_or_joint_is_exceeded_at_any_tick():
    sim = TrialSim(WALKER, Conditions(), NOISE, 10.0, rng(6))
    model, data, actuators = sim.model, sim.data, WALKER.parameters.actuators
    speed = np.tile(actuators.speed, 4)
    torque = np.tile(actuators.torque, 4)
    low, high = model.jnt_range[1:].T
    commands = rng(7)
    for tick in range(5000):
        if tick % 1000 == 0:
            command = commands.uniform([0.5, -0.4, -1.0], [1.5, 0.4, 1.0])
        if tick == 2500:
            sim.push(np.array([0.3, -0.8]))
        sim.walk(command)
        assert (np.abs(data.ctrl) <= torque).all()
        assert (np.abs(data.qvel[6:]) <= speed).all()
        assert (data.qpos[7:] >= low).all()
        assert (data.qpos[7:] <= high).all()
        believed = sim._estimate.data  # the envelope holds at the speeds that it reads
        if tick % 50 == 0:
            for joint in range(12):
                got, turning = believed.ctrl[joint], believed.qvel[6 + joint]
                assert limit_torque(actuators, joint % 3, got, turning) == got
    assert not sim.fallen


@pytest.mark.parametrize("tilt", [0.0, 1.2])
def test_a_body_on_the_floor_has_fallen_at_any_tilt(tilt):
    sim = TrialSim(WALKER, Conditions(), None, 1.0, rng(10))
    for _ in range(5):
        sim.walk(np.zeros(3))
    assert not sim.fallen
    sim.data.qpos[2] = 0.057 if tilt == 0.0 else 1.0  # half as high as the trunk
    sim.data.qpos[7:] = np.tile([0.0, 2.6, -1.6], 4)  # feet beside the back
    sim.data.qpos[3:7] = math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0
    mujoco.mj_forward(sim.model, sim.data)
    for _ in range(5):
        sim.walk(np.zeros(3))
    assert sim.fallen


def hanging_in_the_air():
    """Records of a robot whose late foot has just kept the other pair from lifting."""
    memory, memories = record(MEMORY)
    observation, observations = record(OBSERVATION)
    observation.rotation[:] = np.eye(3)
    step = packed(Parameters(), timestep=0.002), np.array([0.5, 0.0, 0.0])
    while not memory.waited:
        touch = np.where(memory.swinging.any(), 0.0, 50.0) * np.ones(4)
        touch[0] = 0.0  # one foot never meets the ground
        advance(*step, touch, observations, memories)
    return step, memory, (observations, memories)


def test_lift_off_waits_for_a_late_foot_but_not_for_ever():
    step, memory, records = hanging_in_the_air()
    phase, ticks = memory.phase, 1
    while memory.waited:
        assert memory.phase == phase
        assert not memory.swinging.any()
        advance(*step, np.zeros(4), *records)
        ticks += 1
    assert ticks * 0.002 == pytest.approx(Gait().longest_wait, abs=0.005)
    step, memory, records = hanging_in_the_air()
    advance(*step, np.full(4, 50.0), *records)  # touch-down
    advance(*step, np.full(4, 50.0), *records)
    assert memory.waited == 0.0
    assert memory.swinging.any()


def test_a_late_foot_bears_nothing_now():
    (parameters, _), memory, records = hanging_in_the_air()
    horizon = Horizon.zeros(Prediction().steps)
    predict_horizon(parameters, *records, horizon)
    contact = horizon.contact
    late = memory.touching == 0
    assert late.any()
    np.testing.assert_array_equal(contact[0], ~late)
    assert contact[1, late].all()
