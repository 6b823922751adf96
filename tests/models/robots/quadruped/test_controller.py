"""The quadruped walks, stands, follows and stops in MuJoCo, within its motors' limits."""

import itertools
import math

import mujoco
import numpy as np
import pytest

from wayproof.models.robots.kernel_data import packed
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.quadruped.body import MEMORY, OBSERVATION, record
from wayproof.models.robots.quadruped.gait import advance, velocity_command
from wayproof.models.robots.quadruped.legs import arch, glide, joint_torques, limit_torque
from wayproof.models.robots.quadruped.parameters import (
    Actuators,
    Gait,
    Parameters,
    Tracking,
)
from wayproof.models.robots.robot import Setpoint

QUADRUPED = Quadruped()
TIMESTEP = 0.002
REST = 0.0, 0.0, 0.0
TORQUE_LIMIT = np.tile([23.7, 23.7, 35.55], 4)
UPRIGHT = math.cos(QUADRUPED.spec.max_tilt)


@pytest.fixture(scope="module")
def model():
    world = mujoco.MjSpec()
    world.option.timestep = TIMESTEP
    world.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    world.option.iterations = 50
    world.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    robot = mujoco.MjSpec.from_string(QUADRUPED.mjcf())
    world.attach(robot, prefix="robot_", frame=world.worldbody.add_frame())
    return world.compile()


class Ride:
    """One robot on the floor, driven tick by tick, its torques checked at every one of them."""

    def __init__(self, model, heading=0.0):
        self.model, self.data = model, mujoco.MjData(model)
        self.controller = QUADRUPED.controller(model, "robot_")
        self.controller.reset(self.data, np.array([0.0, 0.0, QUADRUPED.spec.rest_height]), heading)

    def walk(self, command, seconds):
        """Body-frame velocities (n, 3) of forward, left and yaw rate."""
        return self._run(seconds, lambda _: self.controller.walk(self.data, np.array(command)))

    def follow(self, setpoint_at, seconds):
        return self._run(seconds, lambda t: self.controller.follow(self.data, setpoint_at(t)))

    def _run(self, seconds, act):
        velocity = np.empty((round(seconds / TIMESTEP), 3))
        for i in range(len(velocity)):
            act(i * TIMESTEP)
            assert (np.abs(self.data.ctrl) <= TORQUE_LIMIT).all()
            mujoco.mj_step(self.model, self.data)
            R = self.data.xmat[self.model.body("robot_base").id].reshape(3, 3)
            assert R[2, 2] > UPRIGHT, f"fell after {i * TIMESTEP} s"
            forward = R[:2, 0] / np.hypot(*R[:2, 0])
            vx, vy = self.data.qvel[:2]
            velocity[i] = forward @ (vx, vy), forward @ (vy, -vx), self.data.qvel[5]
        return velocity

    @property
    def walking(self):
        return bool(self.controller.memory.walking)


def test_stands_without_stepping_or_creeping(model):
    ride = Ride(model)
    feet = ride.data.geom_xpos[[model.geom(f"robot_{n}_foot").id for n in ("FL", "RR")]].copy()
    for _ in range(10):
        ride.walk((0.0, 0.0, 0.0), 0.2)
        assert not ride.walking
    after = ride.data.geom_xpos[[model.geom(f"robot_{n}_foot").id for n in ("FL", "RR")]]
    assert np.abs(ride.data.qpos[:2]).max() < 0.001
    assert abs(ride.data.qpos[2] - QUADRUPED.spec.rest_height) < 0.002
    assert np.abs(after - feet).max() < 0.002


@pytest.mark.few(2)
@pytest.mark.parametrize(
    "command",
    [(1.0, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.8)],
)
def test_tracks_a_constant_command(model, command):
    velocity = Ride(model).walk(command, 4.0)[1000:]  # settled, and whole strides
    np.testing.assert_allclose(velocity.mean(axis=0), command, atol=0.01)


def test_survives_a_push_while_standing_and_stands_again(model):
    ride = Ride(model)
    ride.data.qvel[1] = 0.6
    ride.walk((0.0, 0.0, 0.0), 0.2)
    assert ride.walking
    ride.walk((0.0, 0.0, 0.0), 3.0)
    assert not ride.walking


def test_stops_short_and_stands(model):
    ride = Ride(model)
    ride.walk((1.0, 0.0, 0.0), 2.0)
    start = ride.data.qpos[0]
    ride.walk((0.0, 0.0, 0.0), 2.0)
    assert ride.data.qpos[0] - start < 0.42
    assert not ride.walking


def line(distance, speed, acceleration, heading):
    """A trapezoidal speed profile from the origin."""
    ramp, along = speed / acceleration, (math.cos(heading), math.sin(heading))
    cruise = distance / speed - ramp

    def at(t):
        v = min(speed, acceleration * t, acceleration * max(2 * ramp + cruise - t, 0.0))
        s = 0.5 * acceleration * min(t, ramp) ** 2 + speed * min(max(t - ramp, 0.0), cruise)
        left = min(max(t - ramp - cruise, 0.0), ramp)
        s += speed * left - 0.5 * acceleration * left**2
        position, velocity = ((x * along[0], x * along[1], 0.0) for x in (s, v))
        return Setpoint(position, velocity, heading, 0.0)

    return at


def test_follows_a_line_and_stops_at_its_end(model):
    heading = 0.4
    ride, setpoint_at = Ride(model), line(3.0, 0.8, 1.5, heading)  # it has to turn first, too
    across = np.array([-math.sin(heading), math.cos(heading)])
    for second in range(8):
        for part in range(10):
            begin = second + part / 10
            ride.follow(lambda t, begin=begin: setpoint_at(begin + t), 0.1)
            assert abs(across @ ride.data.qpos[:2]) < 0.05
    end = setpoint_at(8.0)
    np.testing.assert_array_equal(end.velocity, 0.0)
    np.testing.assert_allclose(ride.data.qpos[:2], end.position[:2], atol=0.05)
    assert not ride.walking


def test_setpoint_at_the_start_takes_no_step(model):
    ride = Ride(model, heading=2.0)
    still = Setpoint((0.01, 0.0, 0.0), REST, 2.0, 0.0)
    ride.follow(lambda _: still, 1.0)
    assert not ride.walking
    assert ride.controller.memory.calm_time > 0.9


def outline(model, data):
    """Points (n, 3) and radii (n,): legs as spheres at their geoms' ends, the rest as corners."""
    points, radii = [], []
    for geom in np.flatnonzero(model.geom_group == 3):
        R, (radius, half, _) = data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom]
        if model.geom_type[geom] in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE):
            local = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
        else:
            local = model.geom_aabb[geom, 3:] * list(itertools.product((-1.0, 1.0), repeat=3))
            radius = 0.0
        points.extend(data.geom_xpos[geom] + local @ R.T)
        radii.extend([radius] * len(local))
    return np.array(points), np.array(radii)


def test_spec_encloses_the_walking_body(model):
    ride, spec = Ride(model), QUADRUPED.spec
    base = model.body("robot_base").id
    for command in [(1.0, 0.0, 0.0), (0.9, 0.3, -1.0), (-0.4, -0.4, 1.0), (0.0, 0.0, 0.0)]:
        for _ in range(40):
            ride.walk(command, 0.03)
            points, radii = outline(model, ride.data)
            reach = np.hypot(*(points - ride.data.xpos[base])[:, :2].T) + radii
            assert reach.max() < spec.radius
            assert points[:, 2].max() < spec.height + 0.005


def test_discs_hold_the_body_that_walks_ahead_and_turns(model):
    """Every point of it lies in one of the spec's discs at the heading of the base.

    But for the millimetre by which the farthest point of all that were measured, 0.236 m from the
    nearest centre, is outside of a disc of 0.235 m.
    """
    ride, spec = Ride(model), QUADRUPED.spec
    base = model.body("robot_base").id
    assert [offset for offset, _ in spec.discs] == [-0.245, 0.0, 0.245]
    for command in [(1.0, 0.0, 0.0), (0.5, 0.0, 1.0), (0.0, 0.0, -1.0), (-0.4, 0.0, 0.3)]:
        for _ in range(40):
            ride.walk(command, 0.03)
            points, radii = outline(model, ride.data)
            R = ride.data.xmat[base].reshape(3, 3)
            ahead = R[:2, 0] / np.linalg.norm(R[:2, 0])
            reach = [
                np.hypot(*(points[:, :2] - ride.data.xpos[base][:2] - offset * ahead).T) - radius
                for offset, radius in spec.discs
            ]
            assert (np.min(reach, axis=0) + radii).max() <= 0.001, command


def test_torques_stay_finite_and_limited_however_it_lies(model):
    rng, data = np.random.default_rng(0), mujoco.MjData(model)
    controller = QUADRUPED.controller(model, "robot_")
    for _ in range(50):
        controller.reset(data, rng.normal(scale=0.3, size=3), rng.uniform(-4.0, 4.0))
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[7:] = rng.uniform(-3.0, 3.0, 12)
        data.qvel[:] = rng.normal(scale=10.0, size=18)
        mujoco.mj_forward(model, data)
        for _ in range(30):
            controller.walk(data, rng.uniform(-2.0, 2.0, 3))
            assert (np.abs(data.ctrl) <= TORQUE_LIMIT).all()  # false for NaN too
            mujoco.mj_step(model, data)


def test_a_setpoint_that_is_not_finite_is_refused(model):
    ride = Ride(model)
    broken = Setpoint((math.nan, 0.0, 0.0), REST, 0.0, 0.0)
    with pytest.raises(ValueError, match="expected finite numbers"):
        ride.controller.follow(ride.data, broken)


class Body:
    """The velocity command for a body in one place after another, compiled or not."""

    def __init__(self, function):
        self._function = function
        self._parameters = packed(Tracking()).view(np.recarray)[0]
        (self.observation, _), (self.memory, _) = record(OBSERVATION), record(MEMORY)

    def command(self, setpoint, x, y, yaw):
        self.observation.position[:2] = x, y
        self.observation.angles[2] = yaw
        command = np.full(3, math.nan)
        made = self._function(
            self._parameters, 0.02, setpoint.row, self.observation, self.memory, command
        )
        return command if made else None


@pytest.fixture(params=["compiled", "interpreted"])
def tracking(request):
    return Body(velocity_command if request.param == "compiled" else velocity_command.py_func)


def test_velocity_command_turns_into_the_body_frame_and_clips(tracking):
    north = Setpoint((0.0, 0.0, 0.0), (0.0, 0.7, 0.0), math.pi / 2, 0.1)
    command = tracking.command(north, 0.0, 0.0, math.pi / 2)
    np.testing.assert_allclose(command, [0.7, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(tracking.command(north, -9.0, 9.0, 0.0), [1.5, -0.4, 1.2])


def test_arrival_has_hysteresis(tracking):
    goal = Setpoint((0.0, 0.0, 0.0))
    moves = [
        tracking.command(goal, x, 0.0, 0.0).any() for x in (0.05, 0.03, 0.01, 0.05, 0.07, 0.05)
    ]
    assert moves == [True, True, False, False, True, True]


@pytest.mark.parametrize("field", [0, 1, 3, 4, 6, 7])
def test_no_command_leads_to_what_is_no_number(tracking, field):
    goal = Setpoint((0.0, 0.0, 0.0))
    assert not tracking.command(goal, 0.0, 0.0, 0.0).any()
    goal.row[field] = math.nan
    assert tracking.command(goal, 0.0, 0.0, 0.0) is None
    assert tracking.memory.arrived  # as it was


@pytest.mark.parametrize(
    ("demand", "velocity", "expected"),
    [
        (10.0, 0.0, 10.0),
        (40.0, 0.0, 23.7),
        (-40.0, 10.0, -23.7),  # braking: full torque at any speed
        (40.0, 30.1, 0.0),  # no torque left at the no-load speed
        (40.0, 0.8 * 30.1, 0.5 * 23.7),  # halfway down the slope from 0.6
        (-40.0, -50.0, 0.0),
    ],
)
def test_motor_envelope(demand, velocity, expected):
    for function in (limit_torque, limit_torque.py_func):
        assert function(Actuators(), 0, demand, velocity) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("curve", [lambda s: glide(s, 1.0, 3.0), lambda s: arch(s, 0.1, 0.2, 0.0)])
def test_swing_curves_differentiate(curve):
    for s in (0.1, 0.3, 0.45, 0.6, 0.9):
        step = 1e-6
        ahead, here, behind = curve(s + step), curve(s), curve(s - step)
        assert here[1] == pytest.approx((ahead[0] - behind[0]) / (2 * step), abs=1e-8)
        assert here[2] == pytest.approx((ahead[1] - behind[1]) / (2 * step), abs=1e-7)


def test_diagonal_pairs_alternate():
    memory, memories = record(MEMORY)
    _, observations = record(OBSERVATION)
    parameters = packed(Parameters(), timestep=TIMESTEP)
    seen = set()
    for _ in range(400):
        arguments = np.array([1.0, 0.0, 0.0]), np.zeros(4)
        advance(parameters, *arguments, observations, memories)
        seen.add(tuple(int(s) for s in memory.swinging))
    assert seen == {(0, 0, 0, 0), (1, 0, 0, 1), (0, 1, 1, 0)}


def test_compiled_gait_and_torques_equal_python():
    rng = np.random.default_rng(3)
    observation, compiled, python = (
        np.zeros(1, dtype).view(np.recarray) for dtype in (OBSERVATION, MEMORY, MEMORY)
    )
    parameters = packed(Parameters(), timestep=TIMESTEP).view(np.recarray)
    for name in OBSERVATION.names:
        observation[name][...] = rng.normal(scale=0.2, size=observation[name].shape)
    inputs = *(rng.normal(size=12) for _ in range(3)), rng.normal(size=(4, 3, 3))
    for _ in range(300):
        step = parameters, rng.normal(size=3), rng.uniform(0.0, 9.0, 4)
        advance(*step, observation, compiled)
        advance.py_func(*step, observation, python)
        torques = np.empty(12), np.empty(12)
        joint_torques(parameters, *inputs, observation, compiled, torques[0])
        joint_torques.py_func(parameters, *inputs, observation, python, torques[1])
        np.testing.assert_allclose(*torques, rtol=1e-10, atol=1e-12)
    for name in MEMORY.names:
        np.testing.assert_allclose(compiled[name], python[name], rtol=1e-10, atol=1e-12)


def test_other_parameters_reach_the_spec():
    spec = Quadruped(Parameters(gait=Gait(height=0.28))).spec
    assert spec.rest_height == 0.28
    assert spec.height < Quadruped().spec.height


def test_whether_it_has_arrived_is_restored_from_logs_that_hold_it_apart(model):
    there = Setpoint((0.0, 0.0, 0.0))
    ride, other = Ride(model), Ride(model)
    ride.follow(lambda _: there, 0.2)
    state = ride.controller.state()
    assert state["arrived"]
    memory = state["memory"].view(MEMORY)
    memory["arrived"] = False  # padding, then
    other.controller.restore(state)
    assert other.controller.memory.arrived
