"""What the decision makes of an uncertain pose, and the margin that it leads to."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    at_rest,
    drive,
    make_input,
    make_states,
    next_input,
    place,
    top_speed,
)
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.decision import MOST_WIDENING
from wayproof.harness.inputs import Pose
from wayproof.harness.judge.body import believed_of
from wayproof.harness.metrics import score
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.replay.audit.run import audit
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.mapping import MOST_DOUBT, margin_of
from wayproof.harness.stack.planner_input import localization_of
from wayproof.harness.stack.reasons import sentence
from wayproof.harness.stack.types import Localization
from wayproof.harness.trace import read_trace

HELD, LOST = Localization(0.01, True), Localization(0.6, False)


def pose(*sigmas, unheld=()):
    covariance = np.diag(np.square([*sigmas, 0.01]))
    return Pose(
        np.zeros(3),
        np.array([1.0, 0, 0, 0]),
        max(sigmas),
        covariance=covariance,
        unheld=np.array(unheld, float).reshape(-1, 3),
    )


def mission_of(robot, *settings):
    scenario = build(override(Config("empty", robot, 0), settings))
    return scenario.config, scenario.mission


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
@pytest.mark.parametrize(
    "sigmas",
    [(0.01, 0.01, 0.01), (0.5, 0.01, 0.01), (0.02, 0.31, 0.05), (1e5, 1e5, 1.0), (0.0, 1e5, 0.0)],
)
def test_the_margin_is_two_deviations_along_each_axis(robot, sigmas):
    config, mission = mission_of(robot)
    size = config.map.resolution
    certain = margin_of(pose(0.0, 0.0, 0.0), config, mission).least
    margin = margin_of(pose(*sigmas), config, mission)
    for axis in range(2):
        most = (MOST_DOUBT if sum(margin.widening) == 0 else MOST_WIDENING) * size
        along = margin.least - certain + margin.widening[axis] * size
        assert along >= min(2.0 * sigmas[axis], most) - 1e-9
    if not mission.planar:
        assert margin.least - certain >= min(2.0 * sigmas[2], MOST_DOUBT * size) - 1e-9
    believed, widening = believed_of(pose(*sigmas), size, flat=mission.planar)
    assert believed == pytest.approx(margin.least - certain)
    assert (widening or (0, 0)) == margin.widening


def test_a_model_of_an_estimator_states_no_axes():
    config, mission = mission_of("quadruped")
    modelled = replace(pose(0.4, 0.01, 0.01), covariance=None)
    assert margin_of(modelled, config, mission).widening == (0, 0)
    assert localization_of(modelled, 2) is None


def test_what_is_unheld_above_the_plane_does_not_matter_on_the_ground():
    above = pose(0.01, 0.01, 0.3, unheld=[(0.0, 0.0, 1.0)])
    assert localization_of(above, 2).held
    assert not localization_of(above, 3).held
    assert not localization_of(pose(0.3, 0.01, 0.01, unheld=[(0.8, 0.6, 0.0)]), 2).held


def test_it_drives_slower_while_the_sweeps_do_not_hold_its_pose():
    command, _ = decide(make_input(localization=Localization(0.2, False)), at_rest())
    assert (command.action, command.label) == ("slow", "none")
    assert "slowed, as the sweeps do not hold the pose to 0.20 m" in sentence(command.reason)
    plain, _ = decide(make_input(localization=Localization(0.2, True)), at_rest())
    assert plain.action == "follow"
    assert top_speed(command.trajectory) < 0.6 * top_speed(plain.trajectory)


def test_a_lost_robot_brakes_goes_back_to_where_it_was_held_and_gives_up():
    state = drive(1, localization=HELD)
    for sequence in range(1, 12):
        input = next_input(state, sequence, localization=Localization(0.2, False))
        _, state = decide(input, state)
    kinds = []
    for sequence in range(12, 200):
        input = next_input(state, sequence, localization=LOST)
        command, state = decide(input, state)
        kinds.append((command.action, command.reason.kind, command.label))
        if command.action == "abort":
            break
    assert list(dict.fromkeys(kinds)) == [
        ("stop_and_wait", "localization_lost", "localization_lost"),
        ("recover", "going_back", "localization_lost"),
        ("abort", "localization_lost", "localization_lost"),
    ]
    assert np.abs(input.position[:2] - (1.05, 2.05)).max() < 0.3  # where it set out, held


def test_it_goes_on_to_the_goal_once_the_pose_is_held_again():
    state = drive(1, localization=HELD)
    for sequence in range(1, 40):
        sigma = LOST if sequence > 12 else Localization(0.2, False)
        _, state = decide(next_input(state, sequence, localization=sigma), state)
        if state.returning:
            break
    assert state.returning
    command, state = decide(next_input(state, sequence + 1, localization=HELD), state)
    assert not state.returning
    assert command.label != "localization_lost"


@pytest.mark.parametrize(("sigma", "action"), [(0.09, "goal"), (0.11, "abort")])
def test_a_goal_is_claimed_only_with_a_pose_that_can_tell(sigma, action):
    input = make_input(position=GOAL, localization=Localization(sigma, False))
    command, _ = decide(input, at_rest(position=GOAL))
    assert command.action == action
    assert (command.reason.kind == "localization_lost") == (action == "abort")


def test_it_gives_up_at_the_end_of_a_path_to_a_place_in_stead_of_the_goal():
    """The margin has grown over the goal since the path was planned: it would stand there on."""
    states = make_states(occupied=[(6.75, 6.95, 1.8, 2.3)])
    place_beside = (6.15, 2.05)
    ended = np.array([place(5.15, 2.05), place(*place_beside)])
    state = at_rest(position=place_beside, global_path=ended[1:])
    input = make_input(states, position=place_beside, localization=Localization(0.22, True))
    command, _ = decide(input, state)
    assert (command.action, command.reason.kind) == ("abort", "localization_lost")
    certain, _ = decide(replace(input, localization=HELD), state)
    assert certain.action != "abort"


@pytest.mark.parametrize(
    "trail",
    [
        np.array([place(1.05, 2.05), place(3.05, 2.05)]),  # the way back is blocked
        np.empty((0, 3)),  # it was never held
    ],
)
def test_it_gives_up_where_there_is_no_way_back(trail):
    state = at_rest(position=(3.05, 2.05), unheld=trail)
    blocked = make_states(occupied=[(1.5, 1.7, 0.0, 4.0)])
    command, _ = decide(make_input(blocked, position=(3.05, 2.05), localization=LOST), state)
    assert (command.action, command.reason.kind) == ("abort", "localization_lost")


def test_an_episode_in_a_tunnel_ends_before_it_guesses(tmp_path):
    """Nothing holds its way from the start; slow enough to find its way back free."""
    settings = ["estimate.kind=lidar", "start=[15, 1.3]", "behaviour.lost_sigma=0.1"]
    config = override(Config("tunnel", "drone", 0), [*settings, "motion.limits=cautious"])
    run_episode(build(config), tmp_path / "tunnel.mcap")
    log = open_log(tmp_path / "tunnel.mcap")
    assert log.result["outcome"] == "aborted"
    assert "localization lost" in log.result["reason"]
    decisions = list(log.decisions())
    assert decisions[-1].label == "localization_lost"
    assert any(one.widening and one.widening[0] > one.widening[1] == 0 for one in decisions)
    assert {"localization_lost", "going_back"} <= {one.predicate.kind for one in decisions}
    assert audit(tmp_path / "tunnel.mcap").violations == ()
    figures = score(read_trace(log))
    assert figures["coverage_x"] >= 0.9
    assert figures["coverage_y"] >= 0.93
    assert 0.0 < figures["nees"] < 3.0


@pytest.mark.large
def test_noise_that_hides_the_planes_ends_in_a_lost_pose_and_no_collision(tmp_path):
    """Sweeps placed by prediction were mapped, and the drone flew into a shelf 1.8 m away."""
    config = override(Config("warehouse", "drone", 4), ["estimate.kind=lidar"])
    config = replace(config, perturbation=perturbation_from("depth_noise:2.5"))
    run_episode(build(config), tmp_path / "noise.mcap")
    log = open_log(tmp_path / "noise.mcap")
    assert log.result["outcome"] == "aborted"
    assert "localization lost" in log.result["reason"]
    figures = score(read_trace(log))
    assert figures["coverage_x"] >= 0.9
    assert figures["coverage_y"] >= 0.9
    assert figures["ate"] > 0.1  # it was off indeed
