"""The quadruped under trial, in small: noise, slip, load, delay, kicks, blind terrain."""

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.tools.trials import quadruped as walks
from tests.tools.trials.estimate import Error, Estimate, EstimateNoise
from tests.tools.trials.quadruped_sim import TIMESTEP, Conditions, TrialSim
from tests.tools.trials.terrain import COURSE_END, FIRST, TERRAINS, Block
from wayproof.models.robots.packed import packed
from wayproof.models.robots.quadruped import Quadruped, warm_up
from wayproof.models.robots.quadruped.gait import advance
from wayproof.models.robots.quadruped.parameters import Gait, Parameters, Prediction
from wayproof.models.robots.quadruped.reference import Horizon, predict_horizon
from wayproof.models.robots.quadruped.state import MEMORY, OBSERVATION, record
from wayproof.models.robots.quadruped.torque import limit_torque

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


def test_friction_is_the_floors():
    for friction in (0.4, 0.9):
        sim = TrialSim(ROBOT, Conditions(friction=friction), None, 1.0, rng(8))
        for _ in range(20):
            sim.walk(np.zeros(3))
        assert sim.data.ncon >= 4
        sliding = {contact.friction[0] for contact in sim.data.contact}
        assert sliding == {friction}


def test_a_payload_weighs_on_the_plant_but_not_in_the_controller():
    light = TrialSim(ROBOT, Conditions(), None, 1.0, rng(9))
    heavy = TrialSim(ROBOT, Conditions(payload=5.0), NOISE, 1.0, rng(9))
    total = heavy.model.body_subtreemass[0] - light.model.body_subtreemass[0]
    assert total == pytest.approx(5.0)
    assert heavy.controller.body.mass == light.controller.body.mass


def test_delay_postpones_torques_by_its_ticks():
    sim = TrialSim(ROBOT, Conditions(delay=0.006), None, 1.0, rng(9))
    for _ in range(3):
        sim.walk(np.zeros(3))
        assert not sim.data.ctrl.any()
    sim.walk(np.zeros(3))
    assert sim.data.ctrl.any()


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


def test_errors_have_the_spread_and_memory_that_they_say():
    errors = Error(0.3, 0.4, 0.05).draw(rng(11), 40_000, 2, 0.002)
    assert errors.std() == pytest.approx(0.5, rel=0.05)
    late = (errors[25:] * errors[:-25]).mean()  # one correlation time later
    assert late == pytest.approx(0.4**2 / math.e, rel=0.15)


def test_an_exact_estimate_is_the_truth():
    sim = TrialSim(ROBOT, Conditions(), None, 1.0, rng(12))
    for _ in range(100):
        sim.walk(np.array([0.5, 0.1, 0.3]))
    mujoco.mj_forward(sim.model, sim.data)
    exact = EstimateNoise(*[Error()] * 6)
    estimate = Estimate(sim.model, exact, 3, rng(13))
    estimate.update(sim.data, 0)
    for name in ("qpos", "qvel", "qfrc_bias", "qfrc_passive", "sensordata"):
        expected = getattr(sim.data, name)
        np.testing.assert_allclose(getattr(estimate.data, name), expected, rtol=1e-12, atol=1e-12)
    full = np.zeros((2, sim.model.nv, sim.model.nv))
    mujoco.mj_fullM(sim.model, sim.data, full[0])
    mujoco.mj_fullM(sim.model, estimate.data, full[1])
    np.testing.assert_allclose(full[1], full[0], rtol=1e-12, atol=1e-15)


def test_the_same_draw_walks_the_same_way():
    once, again = (
        walks.follow_commands(ROBOT, Conditions(), NOISE, rng(14), 1.0) for _ in range(2)
    )
    assert once == again


def test_stride_average_takes_the_sway_out():
    ticks = np.arange(1000)
    sway = np.sin(2.0 * np.pi * ticks * TIMESTEP / walks.STRIDE)
    errors = np.column_stack([sway, 0.1 + sway, np.full(1000, -0.2)])
    np.testing.assert_allclose(walks.stride_rms(errors, 1000), [0.0, 0.1, 0.2], atol=1e-12)


def test_course_is_where_its_curvature_leads():
    course = walks.draw_course(rng(15), 12.0)
    x = y = heading = 0.0
    step = 1e-3
    for k in range(12_000):
        *_, curvature = walks.course_at(course, (k + 0.5) * step)
        middle = heading + 0.5 * step * curvature
        x, y = x + step * math.cos(middle), y + step * math.sin(middle)
        heading += step * curvature
    np.testing.assert_allclose(walks.course_at(course, 12.0)[:3], [x, y, heading], atol=5e-3)


def test_blocks_are_turned_as_they_say():
    block = Block((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), yaw=0.4, pitch=-0.2)
    scene = f"<mujoco><worldbody>{block.mjcf(0.5)}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(scene)
    expected = Rotation.from_euler("ZY", [0.4, -0.2]).as_quat(scalar_first=True)
    np.testing.assert_allclose(model.geom_quat[0], expected, atol=1e-6)
    assert model.geom_friction[0, 0] == 0.5


@pytest.mark.parametrize("name", TERRAINS)
def test_courses_start_flat_and_end_flat(name):
    for number in range(5):
        blocks = TERRAINS[name](rng(100 + number))
        assert blocks
        for block in blocks:
            reach = abs(math.cos(block.yaw)) * block.half_extents[0]
            reach += min(abs(math.sin(block.yaw)) * block.half_extents[1], 0.45)
            assert FIRST - 0.5 < block.centre[0] - reach
            assert block.centre[0] + reach < COURSE_END


def test_ramps_meet_the_floor_and_the_level():
    up, table, _ = TERRAINS["ramps"](rng(20))
    along = np.array([math.cos(0.3), math.sin(0.3)])
    normal = np.array([-math.sin(0.3), math.cos(0.3)])
    middle = np.array([up.centre[0], up.centre[2]]) + up.half_extents[2] * normal
    foot, head = middle - up.half_extents[0] * along, middle + up.half_extents[0] * along
    assert foot[1] == pytest.approx(0.0, abs=1e-12)
    edge = table.centre[0] - table.half_extents[0], 2.0 * table.half_extents[2]
    np.testing.assert_allclose(head, edge, atol=1e-12)


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
