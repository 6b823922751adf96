"""The quadruped under trial, in small: noise, slip, load, delay, kicks, blind terrain."""

import math

import mujoco
import numpy as np
import pytest

from tests.tools.trials import quadruped as walks
from tests.tools.trials.estimate import EstimateNoise
from tests.tools.trials.quadruped_sim import Conditions, TrialSim
from wayproof.models.robots.kernel_data import packed
from wayproof.models.robots.quadruped import Quadruped, warm_up
from wayproof.models.robots.quadruped.body import MEMORY, OBSERVATION, record
from wayproof.models.robots.quadruped.gait import advance
from wayproof.models.robots.quadruped.legs import limit_torque
from wayproof.models.robots.quadruped.parameters import Gait, Parameters, Prediction
from wayproof.models.robots.quadruped.reference import Horizon, predict_horizon

ROBOT = Quadruped()
NOISE = EstimateNoise()
SECONDS = 6.0


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def rng(number):
    return np.random.default_rng([31, number])


def test_tracks_random_commands_with_a_noisy_estimate():
    result = walks.follow_commands(ROBOT, Conditions(), NOISE, rng(0), 10.0)
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
    result = walks.follow_commands(ROBOT, conditions, NOISE, rng(1), SECONDS, kick=kick)
    assert not result.fallen
    assert (np.array(result.errors) < 0.3).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("terrain", ["planks", "stairs", "rubble", "ramps"])
def test_crosses_terrain_blindly(terrain):
    result = walks.cross_terrain(ROBOT, Conditions(), NOISE, rng(2), terrain)
    assert result.arrived
    assert not result.fallen


def test_stops_stands_and_follows_a_path():
    stop = walks.stop_from(ROBOT, NOISE, rng(3))
    assert not stop.fallen
    shortest = 1.5**2 / (2.0 * ROBOT.parameters.gait.linear_acceleration)
    assert shortest < stop.distance < shortest + 0.3
    stood = walks.stand(ROBOT, None, rng(4), 5.0)
    assert not stood.fallen
    assert stood.creep < 1e-4
    followed = walks.follow_path(ROBOT, NOISE, rng(5), length=8.0)
    assert not followed.fallen
    assert followed.error < 0.03


def test_no_limit_of_torque_speed_or_joint_is_exceeded_at_any_tick():
    sim = TrialSim(ROBOT, Conditions(), NOISE, 10.0, rng(6))
    model, data, actuators = sim.model, sim.data, ROBOT.parameters.actuators
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
    sim = TrialSim(ROBOT, Conditions(), None, 1.0, rng(10))
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
