"""A stretch of physics is what its parts do one by one in plain Python."""

import math

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config, override
from wayproof.harness.scenario.scenario import build
from wayproof.harness.sim.simulation import Plant
from wayproof.harness.sim.termination import TerminationMonitor, safe_limits
from wayproof.models.robots import Setpoint
from wayproof.planners import MotionLimits, follow_path, hold

NOISY = [
    "odometry.white_noise=0.002",
    "odometry.yaw_white_noise=0.002",
    "odometry.random_walk=0.02",
]


@pytest.fixture(scope="module", params=["quadruped", "drone"])
def scenario(request):
    return build(override(Config("warehouse", request.param, 3), NOISY))


def trajectories(scenario):
    """At rest, and from 0.1 s on ahead and around a corner, in a hurry."""
    start, heading = np.array(scenario.mission.start), scenario.mission.start_heading
    spec = scenario.spec
    limits = MotionLimits(spec.max_speed, spec.max_acceleration, spec.max_jerk, 1.0, 1.0)
    c, s = math.cos(heading), math.sin(heading)
    path = start + np.array([[0.0, 0.0, 0.0], [c, s, 0.0], [c - s, s + c, 0.0]])
    arrival = 100_000_000
    way = follow_path(path, arrival, 0.0, 0.0, 0.0, heading, limits, spec.max_speed)
    return hold(start, 0, heading), arrival, way


class Naive:
    """A plant's physics with the setpoint's and the filter's formulas in plain floats."""

    def __init__(self, scenario, trajectory):
        self.plant = Plant(scenario, trajectory)
        self.model, self.controller = scenario.scene.model, scenario.scene.controller
        self.felt, self.rates = self.plant.estimate.error_row.tolist(), [0.0] * 4
        self.asked = b""

    def step(self, trajectory):
        plant, data = self.plant, self.plant.data
        timestep, now_ns = float(self.model.opt.timestep), plant.now_ns
        pose = np.concatenate([data.qpos[:3], data.qpos[3:7]])
        plant.estimate.advance(now_ns, pose[:3], pose[3:])
        positions, velocities, headings, rates = trajectory.setpoints(np.array([now_ns]))
        (x, y, z), (vx, vy, vz) = positions[0].tolist(), velocities[0].tolist()
        off_x, off_y, off_z, turn = self.felt
        c, s = math.cos(turn), math.sin(turn)
        to_x, to_y = x - float(pose[0]) - off_x, y - float(pose[1]) - off_y
        shifted = (
            x - off_x - ((1.0 - c) * to_x - s * to_y),
            y - off_y - (s * to_x + (1.0 - c) * to_y),
            z - off_z,
        )
        velocity = c * vx + s * vy, c * vy - s * vx, vz
        setpoint = Setpoint(shifted, velocity, float(headings[0]) - turn, float(rates[0]))
        self.asked += setpoint.row.tobytes()
        self.controller.follow(data, setpoint)
        for i, to in enumerate(plant.estimate.error_row.tolist()):
            pull = 10.0 * (10.0 * (to - self.felt[i]) - 2.0 * self.rates[i])
            self.rates[i] += timestep * pull
            self.felt[i] += timestep * self.rates[i]
        mujoco.mj_step(self.model, data)


def test_steps_are_their_parts_one_by_one_bit_by_bit(scenario):
    at_rest, arrival, way = trajectories(scenario)
    plant = Plant(scenario, at_rest)
    plant.expect([(arrival, way)])
    poses, asked = [], b""
    for step in range(400):
        ended = plant.step(remember=False)
        poses.append(plant.data.qpos.tobytes())
        assert not ended
        if step % 70 == 0:
            asked += plant.drain_setpoints()
    asked += plant.drain_setpoints()
    state = scenario.scene.controller.state()
    naive = Naive(scenario, at_rest)
    for pose in poses:
        naive.step(way if naive.plant.now_ns >= arrival else at_rest)
        assert naive.plant.data.qpos.tobytes() == pose
    assert naive.asked == asked
    assert plant.estimate.tracked.tolist() == [naive.felt, naive.rates]
    assert np.abs(plant.estimate.tracked).min() > 0.0
    for name, array in scenario.scene.controller.state().items():
        np.testing.assert_array_equal(array, state[name])
    places = plant.truth.state()["places"]
    np.testing.assert_array_equal(places[-1], plant.data.xpos[scenario.scene.base])


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_a_step_tells_where_the_base_leaves_what_the_judge_lets_it(robot):
    scenario = build(Config("empty", robot, 3))
    # Walls stand where the geofence ends: what touches one would be told for that.
    scenario.scene.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    low, high = safe_limits(scenario)[:3], safe_limits(scenario)[3:6]
    at_rest, *_ = trajectories(scenario)
    for axis, side in ((0, low), (1, low), (2, low), (0, high), (1, high), (2, high)):
        for off, left in ((1e-6, False), (-1e-6, True)):
            plant = Plant(scenario, at_rest)
            judge = TerminationMonitor(scenario, plant.data, plant.truth)
            plant.data.qpos[:3] = 0.5 * (low + high)
            inwards = 1.0 if side is low else -1.0
            plant.data.qpos[axis] = side[axis] + inwards * off
            plant.data.qvel[:] = 0.0
            told = plant.step(remember=False)
            assert (judge.of_physics() is not None) == told
            assert told is left


def test_touching_an_obstacle_is_told_at_every_step(scenario):
    at_rest, *_ = trajectories(scenario)
    plant = Plant(scenario, at_rest)
    judge = TerminationMonitor(scenario, plant.data, plant.truth)
    obstacle = int(np.flatnonzero(plant.truth.is_obstacle)[-1])
    axes = 2 if scenario.spec.motion == "ground" else 3
    plant.data.qpos[:axes] = scenario.scene.model.geom_pos[obstacle, :axes]
    assert plant.step(remember=False)
    assert plant.truth.collisions == 1
    assert judge.of_physics()[0] == "collision"
    assert plant.step(remember=False)
    assert plant.truth.collisions == 1
