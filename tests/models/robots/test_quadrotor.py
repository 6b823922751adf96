"""The quadrotor: its model, its flight and what it refuses."""

from math import cos, pi, sin

import mujoco
import numpy as np
import pytest
import ruckig
from scipy.spatial.transform import Rotation

from tests.models.robots.flight import AIRFRAME, GAINS, TIMESTEP, build
from wayproof.models.poses import Trail
from wayproof.models.robots.quadrotor import Quadrotor, warm_up
from wayproof.models.robots.quadrotor.control_law import (
    ROTOR_SPIN,
    ROTOR_X,
    ROTOR_Y,
    allocate,
    desired_torque,
)
from wayproof.models.robots.quadrotor.parameters import FAST, GRAVITY
from wayproof.models.robots.robot import Setpoint
from wayproof.models.sensors.caster import ROBOT_GROUP, make_caster
from wayproof.models.sensors.devices import SensorConfig

HOVER = 1.325 * 9.81 / 4


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def setpoint(position, heading=0.0):
    return Setpoint(tuple(position), (0.0, 0.0, 0.0), heading, 0.0)


def fly(course, seconds, start, heading=0.0):
    """Positions, reference positions (n, 3) and commands (n, 4) of a flight."""
    model, data, controller = build()
    controller.reset(data, np.asarray(start, float), heading)
    base = data.body("robot_base")
    flown, reference, commands = [], [], []
    for tick in range(round(seconds / TIMESTEP)):
        controller.follow(data, course(tick * TIMESTEP))
        flown.append(base.xpos.copy())
        reference.append(controller.reference[0, :3].copy())
        commands.append(data.ctrl.copy())
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
    return np.array(flown), np.array(reference), np.array(commands)


def rms(error):
    return float(np.sqrt(np.square(error).sum(axis=-1).mean()))


def test_spec_fits_the_body():
    quadrotor = Quadrotor()
    model = mujoco.MjModel.from_xml_string(quadrotor.mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    farthest, heights = 0.0, []
    directions = Rotation.random(2000, random_state=0).as_matrix()[:, 0]
    for geom in range(model.ngeom):
        size, R = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
        local = directions @ R
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            points = np.sign(local) * size
        elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            rim = local[:, :2] / np.linalg.norm(local[:, :2], axis=1)[:, None] * size[0]
            points = np.column_stack([rim, np.sign(local[:, 2]) * size[1]])
        else:
            points = local * size[0] + np.outer(np.sign(local[:, 2]), [0.0, 0.0, size[1]])
        points = points @ R.T + data.geom_xpos[geom]
        farthest = max(farthest, np.linalg.norm(points, axis=1).max())
        heights += [points[:, 2].min(), points[:, 2].max()]
    assert farthest <= quadrotor.spec.radius < farthest + 0.011
    assert max(heights) - min(heights) == pytest.approx(quadrotor.spec.height)
    assert quadrotor.spec.radius == 0.36
    assert quadrotor.spec.motion == "air"


def test_compiled_model_has_the_cited_figures():
    model, _, _ = build()
    base = model.body("robot_base")
    assert base.mass == pytest.approx(1.325)
    np.testing.assert_allclose(base.inertia, [0.0366, 0.0254, 0.0546])
    assert model.nu == 4
    np.testing.assert_allclose(model.actuator_ctrlrange, [[0.0, 13.0]] * 4)
    np.testing.assert_allclose(model.actuator_dynprm[:, 0], 0.035)
    np.testing.assert_allclose(np.abs(model.actuator_gear[:, 5]), 0.0201)
    own = model.geom_bodyid == base.id
    assert np.all(model.geom_group[own] == ROBOT_GROUP)
    assert np.all(model.geom_contype[own] == 0)
    assert np.all(model.geom_conaffinity[own] == 1)
    for rotor, (x, y) in enumerate(zip(ROTOR_X, ROTOR_Y, strict=True)):
        site = model.actuator_trnid[rotor, 0]
        np.testing.assert_allclose(model.site_pos[site], [0.14 * x, 0.18 * y, 0.0])
        assert np.sign(model.actuator_gear[rotor, 5]) == ROTOR_SPIN[rotor]


def test_every_sensor_of_the_spec_is_in_the_model():
    model, data, controller = build()
    controller.reset(data, np.array([0.0, 0.0, 1.0]), 0.0)
    base = model.body("robot_base").id
    lidar, depth, _ = Quadrotor().spec.mounts
    for mount in (lidar, depth):
        sweep = cast(make_caster(model, mount, base, "robot_", SensorConfig()), data)
        assert 0 < np.count_nonzero(sweep != 65535) < len(sweep)  # floor below, nothing above
    caster = make_caster(model, lidar, base, "robot_", SensorConfig())
    height = 1.0 + model.site("robot_lidar").pos[2]
    ranges = cast(caster, data).reshape(32, 512)
    assert ranges[0, 0] == pytest.approx(1000.0 * height / sin(pi / 4), abs=1.0)


def cast(caster, data):
    at_rest = Trail(data.qpos[None, :3].copy(), data.qpos[None, 3:7].copy(), 0.002)
    return caster.cast(data, at_rest, 0, 0)


def test_altimeter_reads_the_height_of_the_belly():
    model, data, controller = build()
    mount, base = Quadrotor().spec.mounts[2], model.body("robot_base").id
    caster = make_caster(model, mount, base, "robot_", SensorConfig())
    for height in (0.5, 1.0, 3.25):
        controller.reset(data, np.array([1.0, -2.0, height]), 0.4)
        assert cast(caster, data)[0] == round(1000.0 * (height - 0.1))
    controller.reset(data, np.array([0.0, 0.0, 11.0]), 0.0)
    assert cast(caster, data)[0] == 65535


def test_hover_holds():
    start = (0.3, -0.2, 1.0)
    flown, _, commands = fly(lambda t: setpoint(start, 0.7), 2.0, start, heading=0.7)
    assert np.abs(flown - start).max() < 1e-3
    np.testing.assert_allclose(commands, HOVER, atol=1e-3)


def test_recovers_from_a_kick():
    model, data, controller = build()
    controller.reset(data, np.array([0.0, 0.0, 2.0]), 0.0)
    joint = model.joint("robot_root").dofadr[0]
    data.qvel[joint : joint + 6] = [1.0, -0.5, 0.3, 2.0, -2.0, 1.0]
    for _ in range(2000):
        controller.follow(data, setpoint([0.0, 0.0, 2.0]))
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.body("robot_base").xpos - [0.0, 0.0, 2.0]) < 0.035


def test_figure_of_eight_at_two_metres_a_second():
    length, width, rise = 3.0, 1.5, 0.4
    rate = 2.0 / np.sqrt(length**2 + (2 * width) ** 2 + rise**2)
    ramp = 2.0  # seconds from rest to full speed

    def course(t):
        phase = rate * (t * t / (2 * ramp) if t < ramp else t - ramp / 2)
        offset = length * sin(phase), width * sin(2 * phase), rise * sin(phase)
        return setpoint(np.array([0.0, 0.0, 2.0]) + offset, heading=0.5 * sin(phase))

    flown, reference, commands = fly(course, 15.0, (0.0, 0.0, 2.0))
    assert rms(flown - reference) < 0.005
    assert np.linalg.norm(flown - reference, axis=1).max() < 0.02
    assert commands.min() > 0.5
    assert commands.max() < 9.0
    speed = np.linalg.norm(np.diff(flown, axis=0), axis=1) / TIMESTEP
    assert speed.max() > 1.9


def straight_move(distance):
    spec = Quadrotor().spec
    request = ruckig.InputParameter(1)
    request.current_position, request.target_position = [0.0], [distance]
    request.max_velocity, request.max_acceleration = [spec.max_speed], [spec.max_acceleration]
    request.max_jerk = [spec.max_jerk]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(request, trajectory)
    return trajectory


def test_straight_move_ends_at_rest_without_overshoot():
    move = straight_move(5.0)

    def course(t):
        return setpoint([move.at_time(min(t, move.duration))[0][0], 0.0, 1.0])

    flown, reference, _ = fly(course, move.duration + 1.5, (0.0, 0.0, 1.0))
    assert rms(flown - reference) < 0.005
    assert flown[:, 0].max() < 5.0 + 0.03
    np.testing.assert_allclose(flown[-250:], np.tile([5.0, 0.0, 1.0], (250, 1)), atol=2e-3)
    assert np.abs(flown[:, 1]).max() < 1e-3
    assert np.abs(flown[:, 2] - 1.0).max() < 5e-3


def test_sharp_corner_stays_near_the_path():
    def course(t):
        along = 1.2 * t
        return setpoint([min(along, 3.0), min(max(along - 3.0, 0.0), 3.0), 1.5])

    flown, _, _ = fly(course, 7.0, (0.0, 0.0, 1.5))
    to_first = np.hypot(flown[:, 0] - flown[:, 0].clip(0.0, 3.0), flown[:, 1])
    to_second = np.hypot(flown[:, 0] - 3.0, flown[:, 1] - flown[:, 1].clip(0.0, 3.0))
    assert np.minimum(to_first, to_second).max() < 0.10
    assert np.abs(flown[:, 2] - 1.5).max() < 0.06
    np.testing.assert_allclose(flown[-1], [3.0, 3.0, 1.5], atol=0.02)


def test_a_jump_of_the_setpoint_is_survived():
    goal = np.array([2.0, 2.0, 2.0])
    flown, _, _ = fly(lambda t: setpoint(goal, 2.5), 6.0, (0.0, 0.0, 1.5))
    assert flown[:, 2].min() > 1.0
    np.testing.assert_allclose(flown[-1], goal, atol=0.05)


def test_heading_turns_the_short_way_round():
    model, data, controller = build()
    controller.reset(data, np.array([0.0, 0.0, 1.0]), 3.0)
    for tick in range(1500):
        angle = 3.0 + min(1.5 * tick * TIMESTEP, 1.0)
        wrapped = (angle + pi) % (2 * pi) - pi
        controller.follow(data, setpoint([0.0, 0.0, 1.0], wrapped))
        mujoco.mj_step(model, data)
        assert 2.99 < controller.reference[0, 3] < 4.01
    assert controller.reference[0, 3] == pytest.approx(4.0, abs=1e-3)
    x_axis = data.body("robot_base").xmat.reshape(3, 3)[:, 0]
    np.testing.assert_allclose(x_axis, [cos(4.0), sin(4.0), 0.0], atol=5e-3)


def test_reset_forgets_the_flight_before():
    model, data, controller = build()
    start = np.array([1.0, 2.0, 1.5])
    states = []
    for _ in range(2):
        mujoco.mj_resetData(model, data)
        controller.reset(data, start, 0.5)
        for _ in range(200):
            controller.follow(data, setpoint(start + 0.5, 1.0))
            mujoco.mj_step(model, data)
        states.append(data.qpos.tobytes())
    assert states[0] == states[1]


def test_setpoint_that_is_not_finite_is_refused():
    _, data, controller = build()
    with pytest.raises(ValueError, match="setpoint: got"):
        controller.follow(data, setpoint([0.0, np.nan, 1.0]))


def test_turns_of_the_fast_drone_do_not_lift_it():
    rng = np.random.default_rng(4)
    lifted = 0
    for _ in range(200):
        desired, actual = Rotation.random(2, random_state=int(rng.integers(1 << 30))).as_matrix()
        thrust = rng.uniform(GAINS.least_lift * 1.325 * GRAVITY, 30.0)
        rates = np.zeros(3), rng.normal(0.0, 40.0, 3)
        for gains in (FAST.gains, GAINS):
            torque = desired_torque(
                AIRFRAME, gains, desired, actual, rates, rng.normal(size=3), thrust
            )
            given = allocate(AIRFRAME, gains, thrust, torque).sum()
            if gains == GAINS:
                lifted += given > thrust + 0.1
            else:
                assert given == pytest.approx(thrust)
    assert lifted > 20
