"""Termination of an episode, on a scene placed by hand."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config, MotionConfig
from wayproof.harness.ending import STUCK_RADIUS
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.sim.simulation import Simulation
from wayproof.harness.sim.termination import (
    FALLEN_SHARE,
    TerminationMonitor,
    first_contact,
)
from wayproof.planners import hold


@pytest.fixture(scope="module", params=["quadruped", "drone"])
def scenario(request):
    return build(Config("warehouse", request.param, 3))


@pytest.fixture
def simulation(scenario):
    mission = scenario.mission
    return Simulation(scenario, hold(np.array(mission.start), 0, mission.start_heading))


@pytest.fixture
def monitor(scenario, simulation):
    return TerminationMonitor(scenario, simulation.data, simulation.truth)


def decision(action="follow", time_s=1.0):
    message = pb.Decision(action=action, reason="why")
    message.timestamp.FromNanoseconds(round(time_s * 1e9))
    return message


def at(scenario, offset):
    """A position at a distance from the goal along x."""
    return np.array(scenario.mission.goal) + np.array([offset, 0.0, 0.0])


def test_a_claim_of_the_goal_is_checked_against_the_truth(scenario, monitor):
    tolerance = scenario.config.episode.goal_tolerance
    near, far = at(scenario, 0.99 * tolerance), at(scenario, 1.01 * tolerance)
    reached = "success", f"at rest {0.99 * tolerance:.2f} m from the goal"
    assert monitor.check_decision(decision("goal"), [near]) == reached
    outcome, reason = monitor.check_decision(decision("goal"), [far])
    assert outcome == "aborted"
    assert reason == f"claimed the goal from {1.01 * tolerance:.2f} m away"


def test_a_robot_on_the_ground_is_at_the_goal_whatever_its_height(scenario, monitor):
    above = at(scenario, 0.0) + np.array([0.0, 0.0, 2.0])
    outcome, _ = monitor.check_decision(decision("goal"), [above])
    assert outcome == ("success" if scenario.spec.motion == "ground" else "aborted")


def test_an_abort_and_the_time_limit_end_an_episode(scenario, monitor):
    limit = scenario.config.episode.time_limit
    far = [at(scenario, 3.0)]
    assert monitor.check_decision(decision("abort"), far) == ("aborted", "why")
    assert monitor.check_decision(decision(time_s=limit - 0.1), far) is None
    assert monitor.check_decision(decision(time_s=limit), far)[0] == "timeout"


def test_a_robot_that_has_not_moved_for_long_is_stuck(scenario, monitor):
    period = 1.0 / scenario.scene.casters[0].mount.device.rate
    window = round(scenario.config.episode.stuck_after / period)
    far = at(scenario, 5.0)
    moved = at(scenario, 5.0 + 1.01 * STUCK_RADIUS)
    assert monitor.check_decision(decision(), [far] * (window - 1)) is None
    assert monitor.check_decision(decision(), [far] * window)[0] == "stuck"
    assert monitor.check_decision(decision(), [*[far] * (window - 1), moved]) is None


def test_a_tilt_beyond_the_robots_limit_is_a_fall(scenario, simulation, monitor):
    for share, fallen in ((0.95, False), (1.05, True)):
        half = 0.5 * share * scenario.spec.max_tilt
        simulation.data.qpos[3:7] = [np.cos(half), np.sin(half), 0.0, 0.0]
        simulation.step(save=False)
        verdict = monitor.check_physics()
        assert (verdict is not None) is fallen
    assert verdict[0] == "fall"
    assert verdict[1].startswith(f"tilted beyond {scenario.spec.max_tilt:g} rad")


def test_a_walking_robot_below_a_share_of_its_height_has_fallen(scenario, simulation, monitor):
    if scenario.spec.motion != "ground":
        pytest.skip("only what walks can lie")
    simulation.data.qpos[2] = 0.98 * FALLEN_SHARE * scenario.spec.rest_height
    simulation.step(save=False)
    assert monitor.check_physics()[0] == "fall"


@pytest.mark.parametrize(("value", "outcome"), [(1e3, "out_of_bounds"), (np.nan, "error")])
def test_a_robot_outside_the_geofence_or_without_a_position_ends_the_episode(
    simulation, monitor, value, outcome
):
    position = simulation.position
    position[0] = value  # where the base is, as kinematics leave it
    verdict = monitor.check_physics()
    assert verdict[0] == outcome
    assert "left the geofence" in verdict[1]


def test_a_contact_is_named_with_its_position(scenario, simulation, monitor):
    obstacle = int(np.flatnonzero(simulation.truth.is_obstacle)[-1])
    axes = 2 if scenario.spec.motion == "ground" else 3
    simulation.data.qpos[:axes] = scenario.scene.model.geom_pos[obstacle, :axes]
    for _ in range(2):
        assert simulation.step(save=False)
        assert simulation.truth.collisions == 1
        outcome, reason = monitor.check_physics()
        assert outcome == "collision"
        assert reason.startswith("touched an obstacle at (")
    contact = first_contact(scenario.scene, simulation.truth, simulation.data)
    assert contact.name == scenario.scene.model.geom(obstacle).name
    distance = np.linalg.norm(np.array(contact.position) - simulation.position)
    assert distance < 2.0 * scenario.spec.radius + 1.0


@pytest.fixture(scope="module")
def low_scenario():
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


def test_a_drone_that_flies_into_the_floor_has_collided_with_it(low_scenario):
    simulation, monitor, start = flight(low_scenario, 0.6)
    assert simulation.truth.clearance(simulation.data) < 0.6
    assert go_to(simulation, start, (0.6, 0.4, 0.2, 0.0, -0.2))
    outcome, reason = monitor.check_physics()
    assert outcome == "collision"
    assert reason.startswith("touched the floor at (")
    assert simulation.truth.clearance(simulation.data) < 0.01


def test_a_drone_takes_off_from_the_floor_and_may_not_come_back(low_scenario):
    lowest = resting_height(low_scenario)
    simulation, _, start = flight(low_scenario, lowest)
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
