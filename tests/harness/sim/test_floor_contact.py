"""A robot that flies collides with the floor, but for the one that it takes off from."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config, MotionConfig
from wayproof.harness.scenario.scenario import build
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.termination import TerminationMonitor
from wayproof.planners import hold


@pytest.fixture(scope="module")
def scenario():
    config = Config("empty", "drone", 1, motion=MotionConfig(altitude_low=-1.0))
    return build(config)


def flight(scenario, start_z):
    """A simulation from a height at the start, which holds its place."""
    mission = scenario.mission
    start = np.array([*mission.start[:2], start_z])
    scenario = replace(scenario, mission=replace(mission, start=tuple(start.tolist())))
    simulation = Simulation(scenario, hold(start, 0, mission.start_heading))
    return simulation, TerminationMonitor(scenario, simulation.data, simulation.truth), start


def go_to(simulation, start, heights):
    """Hold each height for a second; return whether a step may have ended the episode."""
    for height in heights:
        target = hold(np.array([*start[:2], height]), simulation.now_ns, 0.0)
        simulation.enqueue([(simulation.now_ns, target)])
        for _ in range(500):
            if simulation.step(save=False):
                return True
    return False


def test_a_drone_that_flies_into_the_floor_has_collided_with_it(scenario):
    simulation, monitor, start = flight(scenario, 0.6)
    assert simulation.truth.clearance(simulation.data) < 0.6
    assert go_to(simulation, start, (0.6, 0.4, 0.2, 0.0, -0.2))
    outcome, reason = monitor.check_physics()
    assert outcome == "collision"
    assert reason.startswith("touched the floor at (")
    assert simulation.truth.clearance(simulation.data) < 0.01


def test_a_drone_takes_off_from_the_floor_and_may_not_come_back(scenario):
    lowest = resting_height(scenario)
    simulation, _, start = flight(scenario, lowest)
    assert simulation.truth.state()["standing"] == 1
    assert not go_to(simulation, start, (lowest, lowest + 0.6))
    assert simulation.truth.collisions == 0
    state = simulation.truth.state()
    assert state["standing"] == 0
    assert go_to(simulation, start, (0.5, 0.3, 0.1, -0.1, -0.3))
    assert simulation.truth.collisions == 1


def resting_height(scenario):
    """Height of the base, m, at which the lowest part of the drone is a millimetre above z = 0."""
    scene, data = scenario.scene, mujoco.MjData(scenario.scene.model)
    scene.controller.reset(data, np.array([*scenario.mission.start[:2], 1.0]), 0.0)
    mujoco.mj_kinematics(scene.model, data)
    robot = np.flatnonzero(scene.model.geom_group == 3)
    gaps = [
        mujoco.mj_geomDistance(scene.model, data, int(one), floor, 2.0, np.zeros(6))
        for one in robot
        for floor in scene.floor
    ]
    return 1.0 - min(gaps) + 0.001
