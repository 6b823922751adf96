from math import cos, pi, sin

import mujoco
import numpy as np
import pytest
import ruckig
from scipy.linalg import logm
from scipy.spatial.transform import Rotation

from wayproof.models.poses import Trail
from wayproof.models.robots.linear_algebra import rotation_from_quaternion
from wayproof.models.robots.quadrotor import Quadrotor, warm_up
from wayproof.models.robots.quadrotor.drag import air_drag
from wayproof.models.robots.quadrotor.flight import MEMORY, track
from wayproof.models.robots.quadrotor.geometric import (
    attitude_error,
    desired_attitude,
    desired_rates,
    desired_torque,
    tilt_error,
    tilt_room,
)
from wayproof.models.robots.quadrotor.parameters import (
    FAST,
    GRAVITY,
    Airframe,
    Gains,
    Smoothing,
)
from wayproof.models.robots.quadrotor.rotors import ROTOR_SPIN, ROTOR_X, ROTOR_Y, allocate
from wayproof.models.robots.quadrotor.smoothing import smooth_setpoint
from wayproof.models.robots.robot import Setpoint
from wayproof.models.sensors.caster import ROBOT_GROUP, make_caster
from wayproof.models.sensors.devices import SensorConfig

SCENE = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="decoy" pos="0 0 -5">
      <freejoint/>
      <geom size="0.1" contype="0" conaffinity="0"/>
    </body>
    <geom name="floor" type="plane" size="0 0 1"/>
  </worldbody>
</mujoco>"""
# The decoy's free joint comes first, so that addresses which are assumed and not looked up fail.

TIMESTEP = 0.002
HOVER = 1.325 * 9.81 / 4
AIRFRAME, GAINS, SMOOTHING = Airframe(), Gains(), Smoothing()


@pytest.fixture(scope="module", autouse=True)
def compiled():
    warm_up()


def build(prefix="robot_"):
    quadrotor = Quadrotor()
    world = mujoco.MjSpec.from_string(SCENE)
    drone = mujoco.MjSpec.from_string(quadrotor.mjcf())
    world.attach(drone, prefix=prefix, frame=world.worldbody.add_frame())
    model = world.compile()
    return model, mujoco.MjData(model), quadrotor.controller(model, prefix)


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


def test_same_flight_twice_is_the_same_bytes():
    def course(t):
        return setpoint([sin(t), 0.5 * t, 1.5 + 0.2 * sin(2 * t)], 0.3 * t)

    once, again = (fly(course, 1.0, (0.0, 0.0, 1.5)) for _ in range(2))
    for first, second in zip(once, again, strict=True):
        assert first.tobytes() == second.tobytes()


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


def test_drag_is_the_closed_form():
    model, data, controller = build()
    controller.reset(data, np.array([0.0, 0.0, 1.0]), 0.0)
    joint, dof = model.joint("robot_root").qposadr[0], model.joint("robot_root").dofadr[0]
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 1.0])
    data.qpos[joint + 3 : joint + 7] = turn.as_quat(scalar_first=True)
    data.qvel[dof : dof + 3] = velocity = np.array([2.0, -1.0, 0.5])
    R = turn.as_matrix()
    controller.wind[:] = wind = np.array([0.5, 3.0, -1.0])
    controller.apply_drag(data)
    airspeed = velocity - wind
    expected = -R @ np.diag([0.25, 0.25, 0.15]) @ R.T @ airspeed
    expected -= 0.02 * np.linalg.norm(airspeed) * airspeed
    applied = data.xfrc_applied[model.body("robot_base").id]
    np.testing.assert_allclose(applied, [*expected, 0.0, 0.0, 0.0], atol=1e-12)


def wrench(rotors):
    """Thrust and body torque of four rotor thrusts, from their lever arms."""
    total = np.zeros(4)
    signs = zip(ROTOR_X, ROTOR_Y, ROTOR_SPIN, strict=True)
    for thrust, (x, y, spin) in zip(rotors, signs, strict=True):
        torque = np.cross([0.14 * x, 0.18 * y, 0.0], [0.0, 0.0, thrust])
        total += [thrust, torque[0], torque[1], spin * 0.0201 * thrust]
    return total


def test_mixer_keeps_limits_and_gives_up_yaw_first():
    rng = np.random.default_rng(1)
    for _ in range(2000):
        thrust = rng.uniform(-10.0, 80.0)
        torque = rng.normal(0.0, [3.0, 2.0, 1.0])
        rotors = allocate(AIRFRAME, GAINS, thrust, torque)
        assert rotors.min() >= 0.0
        assert rotors.max() <= 13.0
        got = wrench(rotors)
        spread = 0.5 * (abs(torque[0]) / 0.18 + abs(torque[1]) / 0.14)
        if spread <= 12.87:  # from idle, 1 % of the largest thrust, to the largest
            np.testing.assert_allclose(got[1:3], torque[:2], atol=1e-9)
        else:
            np.testing.assert_allclose(got[1:3], torque[:2] * 12.87 / spread, atol=1e-9)
        assert abs(got[3]) <= abs(torque[2]) + 1e-9
        assert got[3] * torque[2] >= -1e-12


def test_mixer_gives_a_feasible_wrench_exactly():
    rng = np.random.default_rng(2)
    for _ in range(200):
        rotors = rng.uniform(4.0, 7.0, 4)
        demand = wrench(rotors)
        given = allocate(AIRFRAME, GAINS, demand[0], demand[1:])
        np.testing.assert_allclose(given, rotors, atol=1e-9)


@pytest.mark.parametrize(
    ("gains", "thrust", "expected"),
    [
        (GAINS, 0.0, 3.25),  # a quarter of 13 N, whatever the thrust
        (GAINS, 13.0, 3.25),
        (FAST.gains, 9.0, 2.12),  # 9 N / 4 less idle, 1 % of 13 N
        (FAST.gains, 40.0, 3.25),
        (FAST.gains, -3.0, 0.5 * 1.325 * 9.81 / 4 - 0.13),  # as at the least lift
    ],
)
def test_room_for_roll_and_pitch_by_hand(gains, thrust, expected):
    assert tilt_room(AIRFRAME, gains, thrust) == pytest.approx(expected)


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


def test_attitude_error_matches_the_matrix_formula_and_the_logarithm():
    rng = np.random.default_rng(3)
    for _ in range(50):
        desired, actual = Rotation.random(2, random_state=int(rng.integers(1 << 30))).as_matrix()
        skew = 0.5 * (desired.T @ actual - actual.T @ desired)
        naive = [skew[2, 1], skew[0, 2], skew[1, 0]]
        np.testing.assert_allclose(attitude_error(desired, actual), naive, atol=1e-12)
    small = desired @ Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix()
    error = attitude_error(desired, small)
    np.testing.assert_allclose(error, [0.01, -0.02, 0.015], rtol=2e-4)
    logarithm = np.real(logm(desired.T @ small))
    np.testing.assert_allclose(error[2], logarithm[1, 0], rtol=2e-4)


def test_tilt_error_ignores_the_heading_and_is_the_attitude_error_without_one():
    rng = np.random.default_rng(6)
    for _ in range(50):
        actual = Rotation.random(random_state=int(rng.integers(1 << 30)))
        angle, sideways = rng.uniform(0.0, 1.5), rng.uniform(-pi, pi)
        off = angle * np.array([cos(sideways), sin(sideways), 0.0])
        desired = actual * Rotation.from_rotvec(-off)
        expected = sin(angle) * off[:2] / angle
        got = tilt_error(desired.as_matrix(), actual.as_matrix())
        np.testing.assert_allclose(got, expected, atol=1e-12)
        whole = attitude_error(desired.as_matrix(), actual.as_matrix())
        np.testing.assert_allclose([*got, 0.0], whole, atol=1e-12)
        turned = (desired * Rotation.from_rotvec([0.0, 0.0, 1.0])).as_matrix()
        np.testing.assert_allclose(tilt_error(turned, actual.as_matrix()), expected, atol=1e-12)


def smooth_reference(t):
    """Rows position .. snap of a smooth curve with heading, by exact derivatives."""
    rows = np.empty((5, 4))
    for channel, (size, rate) in enumerate([(2.0, 0.9), (1.5, 1.3), (0.3, 1.1), (1.2, 0.7)]):
        for order in range(5):
            rows[order, channel] = size * rate**order * sin(rate * t + order * pi / 2)
    return rows


def desired_rotation(t):
    reference = smooth_reference(t)
    return desired_attitude(reference[2, :3] + [0.0, 0.0, GRAVITY], reference[0, 3])


def test_demanded_rates_are_the_derivative_of_the_demanded_attitude():
    step = 1e-5
    for t in np.linspace(0.0, 5.0, 11):
        reference = smooth_reference(t)
        R = desired_rotation(t)
        lift = float(np.linalg.norm(reference[2, :3] + [0.0, 0.0, GRAVITY]))
        rate, acceleration = desired_rates(reference, R, lift)
        change = desired_rotation(t - step).T @ desired_rotation(t + step)
        measured = Rotation.from_matrix(change).as_rotvec() / (2 * step)
        np.testing.assert_allclose(rate, measured, atol=1e-6)

        def rate_at(time):
            ahead = smooth_reference(time)
            norm = float(np.linalg.norm(ahead[2, :3] + [0.0, 0.0, GRAVITY]))
            return desired_rates(ahead, desired_rotation(time), norm)[0]

        slope = (rate_at(t + step) - rate_at(t - step)) / (2 * step)
        np.testing.assert_allclose(acceleration[:2], slope[:2], atol=1e-4)


def test_demanded_attitude_is_a_rotation_that_faces_the_heading():
    R = desired_attitude(np.array([1.0, -2.0, 9.0]), 0.8)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 2], np.array([1.0, -2.0, 9.0]) / np.sqrt(86.0), atol=1e-12)
    assert R[:, 1] @ [cos(0.8), sin(0.8), 0.0] == pytest.approx(0.0, abs=1e-12)


def test_filter_is_four_equal_poles():
    slow = Smoothing(limits=(1e9,) * 4, heading_limits=(1e9,) * 4)
    reference = np.zeros((5, 4))
    for _ in range(101):
        smooth_setpoint(slow, reference, np.array([1.0, 0.0, 0.0, 0.5]), TIMESTEP)
    x = 20.0 * 100 * TIMESTEP
    expected = 1.0 - np.exp(-x) * (1 + x + x**2 / 2 + x**3 / 6)  # step response of 1/(1+s/b)^4
    assert reference[0, 0] == pytest.approx(expected, abs=0.01)
    assert reference[0, 3] == pytest.approx(expected / 2, abs=0.005)


def test_filter_lags_by_what_it_says():
    reference = np.zeros((5, 4))
    for tick in range(2000):
        target = np.array([1.5 * tick * TIMESTEP, 0.0, 0.0, 0.0])
        smooth_setpoint(SMOOTHING, reference, target, TIMESTEP)
    assert SMOOTHING.lag == pytest.approx(0.2)
    assert target[0] - reference[0, 0] == pytest.approx(1.5 * SMOOTHING.lag, abs=1e-6)
    np.testing.assert_allclose(reference[1:, 0], [1.5, 0.0, 0.0, 0.0], atol=1e-6)


def test_filter_keeps_its_limits():
    reference = np.zeros((5, 4))
    peaks = np.zeros(4)
    for _ in range(3000):
        smooth_setpoint(SMOOTHING, reference, np.array([9.0, 5.0, 2.0, 0.0]), TIMESTEP)
        peaks = np.maximum(peaks, np.linalg.norm(reference[1:, :3], axis=1))
    assert np.all(peaks <= np.multiply(SMOOTHING.limits, 1.02))
    assert peaks[0] > 2.9
    np.testing.assert_allclose(reference[0, :3], [9.0, 5.0, 2.0], atol=0.01)


def test_kernels_equal_their_python():
    rng = np.random.default_rng(4)
    quaternion = np.array([*Rotation.random(random_state=5).as_quat()])
    pose, velocity = np.concatenate([[0.1, 0.2, 0.3], quaternion]), rng.normal(size=6)
    results = []
    for run in (track, track.py_func):
        memory, command = np.zeros(1, MEMORY).view(np.recarray), np.zeros(4)
        memory[0].reference[:], memory[0].lag[:] = smooth_reference(0.4), 3.0
        run(AIRFRAME, GAINS, memory[0], pose, velocity, TIMESTEP, command)
        results.append(np.concatenate([memory[0].integral, memory[0].lag.ravel(), command]))
    assert results[0][:3].any()
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    results = []
    for run in (smooth_setpoint, smooth_setpoint.py_func):
        reference = smooth_reference(0.4)
        run(SMOOTHING, reference, np.array([1.0, 2.0, 3.0, 9.0]), TIMESTEP)
        results.append(reference)
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    results = []
    for run in (rotation_from_quaternion, rotation_from_quaternion.py_func):
        results.append(np.empty((3, 3)))
        run(quaternion, results[-1])
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    R, torque = desired_rotation(1.0), np.array([1.0, -0.5, 0.2])
    rates = torque, 3.0 * torque
    for kernel, arguments in (
        (desired_attitude, (np.array([1.0, 2.0, 9.0]), 0.3)),
        (attitude_error, (R, desired_rotation(1.1))),
        (desired_torque, (AIRFRAME, FAST.gains, R, desired_rotation(1.1), rates, torque, 9.0)),
        (tilt_error, (R, desired_rotation(1.1))),
        (tilt_room, (AIRFRAME, FAST.gains, 9.0)),
        (desired_rates, (smooth_reference(1.0), R, 11.0)),
        (allocate, (AIRFRAME, GAINS, 13.0, torque)),
        (air_drag, (AIRFRAME, R, torque)),
    ):
        np.testing.assert_allclose(kernel(*arguments), kernel.py_func(*arguments), rtol=1e-12)
