"""Physics steps against their parts one by one in plain Python, bit by bit."""

import math

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.scenario.scenario import build
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.termination import TerminationMonitor, safe_limits
from wayproof.models.robots import Setpoint
from wayproof.planners import MotionLimits, PathState, follow_path, hold

NOISY = [
    "pose_model.white_noise=0.002",
    "pose_model.yaw_white_noise=0.002",
    "pose_model.random_walk=0.02",
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
    way = follow_path(path, PathState(arrival, 0.0, 0.0, 0.0, heading), limits, spec.max_speed)
    return hold(start, 0, heading), arrival, way


class Naive:
    """Physics with the formulas of setpoint and filter in plain floats."""

    def __init__(self, scenario, trajectory):
        self.simulation = Simulation(scenario, trajectory)
        self.model, self.controller = scenario.scene.model, scenario.scene.controller
        self.felt, self.rates = self.simulation.estimate.error_row.tolist(), [0.0] * 4
        self.commanded = b""

    def step(self, trajectory):
        simulation, data = self.simulation, self.simulation.data
        timestep, now_ns = float(self.model.opt.timestep), simulation.now_ns
        pose = np.concatenate([data.qpos[:3], data.qpos[3:7]])
        simulation.estimate.advance(now_ns, pose[:3], pose[3:])
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
        self.commanded += setpoint.row.tobytes()
        self.controller.follow(data, setpoint)
        for i, to in enumerate(simulation.estimate.error_row.tolist()):
            pull = 10.0 * (10.0 * (to - self.felt[i]) - 2.0 * self.rates[i])
            self.rates[i] += timestep * pull
            self.felt[i] += timestep * self.rates[i]
        mujoco.mj_step(self.model, data)


def test_steps_are_their_parts_one_by_one_bit_by_bit(scenario):
    at_rest, arrival, way = trajectories(scenario)
    simulation = Simulation(scenario, at_rest)
    simulation.enqueue([(arrival, way)])
    poses, commanded = [], b""
    for step in range(400):
        ended = simulation.step(save=False)
        poses.append(simulation.data.qpos.tobytes())
        assert not ended
        if step % 70 == 0:
            commanded += simulation.drain_setpoints()
    commanded += simulation.drain_setpoints()
    state = scenario.scene.controller.state()
    naive = Naive(scenario, at_rest)
    for pose in poses:
        naive.step(way if naive.simulation.now_ns >= arrival else at_rest)
        assert naive.simulation.data.qpos.tobytes() == pose
    assert naive.commanded == commanded
    assert simulation.estimate.tracked.tolist() == [naive.felt, naive.rates]
    assert np.abs(simulation.estimate.tracked).min() > 0.0
    for name, array in scenario.scene.controller.state().items():
        np.testing.assert_array_equal(array, state[name])
    places = simulation.truth.state()["places"]
    np.testing.assert_array_equal(places[-1], simulation.data.xpos[scenario.scene.base])


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_a_step_reports_that_the_base_left_the_limits_of_the_termination_monitor(robot):
    scenario = build(Config("empty", robot, 3))
    # Walls stand where the geofence ends: what touches one would be reported for that.
    scenario.scene.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    low, high = safe_limits(scenario)[:3], safe_limits(scenario)[3:6]
    at_rest, *_ = trajectories(scenario)
    for axis, side in ((0, low), (1, low), (2, low), (0, high), (1, high), (2, high)):
        for off, left in ((1e-6, False), (-1e-6, True)):
            simulation = Simulation(scenario, at_rest)
            monitor = TerminationMonitor(scenario, simulation.data, simulation.truth)
            simulation.data.qpos[:3] = 0.5 * (low + high)
            inwards = 1.0 if side is low else -1.0
            simulation.data.qpos[axis] = side[axis] + inwards * off
            simulation.data.qvel[:] = 0.0
            reported = simulation.step(save=False)
            assert (monitor.check_physics() is not None) == reported
            assert reported is left
