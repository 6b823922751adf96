"""Injection of perturbations, on the sensors of a real scene."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.perturbations.latency import Latency
from wayproof.harness.scenario.scenario import build
from wayproof.harness.sim.injector import PerturbationInjector
from wayproof.models.pose_model import PoseError
from wayproof.models.poses import Trail


@pytest.fixture(scope="module")
def scenario():
    return build(Config("warehouse", "quadruped", 3))


@pytest.fixture(scope="module")
def data(scenario):
    data = mujoco.MjData(scenario.scene.model)
    mission = scenario.mission
    scenario.scene.controller.reset(data, np.array(mission.start), mission.start_heading)
    mujoco.mj_kinematics(scenario.scene.model, data)
    return data


def injector(scenario, perturbation=None):
    config = replace(scenario.config, perturbation=perturbation)
    return PerturbationInjector(config, scenario.scene)


def trail_of(scenario, data):
    base = scenario.scene.base
    return Trail(data.xpos[base][None], data.xquat[base][None], 0.002)


def cast(injector, scenario, data, sequence=0):
    """Ranges of the first sensor at one decision, mm."""
    injector.begin_decision(sequence)
    caster = scenario.scene.casters[0]
    sites = data.site_xpos.copy(), data.site_xmat.copy()
    ranges, classes = injector.cast(caster, data, trail_of(scenario, data), sequence)
    data.site_xpos[:], data.site_xmat[:] = sites
    assert classes.shape == (0,)
    return ranges


def test_without_a_perturbation_a_sweep_is_what_the_device_reports(scenario, data):
    caster = scenario.scene.casters[0]
    plain = caster.cast(data, trail_of(scenario, data), scenario.config.seed, 0)
    unperturbed = injector(scenario)
    np.testing.assert_array_equal(cast(unperturbed, scenario, data), plain)
    assert unperturbed.delay == 0.0
    assert unperturbed.message(0, 0, PoseError()) is None


def test_the_count_of_changed_beams_begins_anew_at_each_decision(scenario, data):
    perturbed = injector(scenario, perturbation_from("depth_dropout:5"))
    cast(perturbed, scenario, data)
    assert perturbed.message(0, 0, PoseError()).changed_beams > 0
    perturbed.begin_decision(1)
    assert perturbed.message(1, 0, PoseError()).changed_beams == 0


def test_a_delay_is_added_within_its_window_alone(scenario):
    rate = scenario.scene.casters[0].mount.device.rate
    perturbed = injector(scenario, Latency(severity=4, window=(1.0, 2.0)))
    delays = []
    for time_s in (0.5, 1.5, 2.5):
        perturbed.begin_decision(round(time_s * rate))
        delays.append(perturbed.delay)
    assert delays == [0.0, pytest.approx(0.15), 0.0]


def test_a_displaced_sensor_sees_another_world_and_the_log_says_where_it_sits(scenario, data):
    perturbed = injector(scenario, perturbation_from("calibration:5"))
    assert (cast(perturbed, scenario, data) != cast(injector(scenario), scenario, data)).any()
    message = perturbed.message(0, 0, PoseError())
    turn = 2.0 * np.arccos(abs(message.displaced_quaternion[0]))
    assert np.degrees(turn) == pytest.approx(4.0)
    assert list(message.displaced_position) == [0.0, 0.0, 0.0]
