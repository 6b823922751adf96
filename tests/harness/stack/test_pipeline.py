"""The pipeline on a real map: integrate, update the costmap, decide, record, commit."""

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.decision import chain_hash
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.mission import Mission
from wayproof.harness.stack.build import build_navigator
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

DRONE = Mission(
    motion="air",
    radius=0.3,
    height=0.2,
    step_height=0.0,
    max_speed=2.0,
    max_acceleration=2.5,
    max_jerk=15.0,
    max_yaw_rate=2.0,
    low=(0.0, 0.0, 0.0),
    high=(6.0, 4.0, 3.0),
    start=(1.05, 2.05, 1.05),
    start_heading=0.0,
    goal=(5.05, 2.05, 1.05),
)


def navigator(*settings, mission=DRONE, robot="drone"):
    return build_navigator(override(Config("empty", robot, 1), settings), mission, {})


def inputs(sequence=0, position=DRONE.start, sigma=0.0):
    """The pose of one instant, without sweeps: the map stays as it is."""
    pose = Pose(np.array(position), np.array([1.0, 0.0, 0.0, 0.0]), sigma)
    return Inputs(sequence * 100_000_000, sequence, pose, (), "digest")


def all_free(stack):
    """Mark the whole operating area free."""
    stack.map.mark_free(DRONE.low, DRONE.high, 0)
    return stack


def test_in_a_free_map_the_first_decision_leads_to_the_goal():
    stack = all_free(navigator())
    decision = stack.step(inputs())
    assert (decision.action, decision.label) == ("follow", "none")
    end = decision.global_path[-1]
    assert (end.x, end.y, end.z) == pytest.approx(DRONE.goal, abs=1e-5)
    assert decision.trigger == "pose"
    assert decision.map_version == stack.mapper.version()
    assert decision.input_digest == "digest"


def test_only_the_declared_start_is_free_in_the_map_of_a_new_navigator():
    stack = navigator()
    decision = stack.step(inputs())
    states = stack.costmap.state
    assert (states == FREE).any()
    assert not (states == OCCUPIED).any()
    assert (states == UNKNOWN).mean() > 0.5
    assert (decision.action, decision.label) == ("stop_and_wait", "unknown_ahead")


def test_a_decision_past_its_deadline_is_discarded_and_labelled():
    stack = all_free(navigator("latency.deadline=0.1"))
    before = stack.state
    decision = stack.commit(stack.step(inputs()), delay_s=0.2)
    assert (decision.action, decision.label) == ("stop_and_wait", "deadline_missed")
    assert decision.deadline_missed
    assert decision.committed_length_m == 0.0
    assert stack.state is before
    assert stack.chain == decision.chain != ""
    moving = stack.commit(stack.step(inputs(1)), delay_s=0.1)
    assert moving.label == "none"
    late = stack.commit(stack.step(inputs(2)), delay_s=0.11)
    assert (late.action, late.label) == ("follow", "deadline_missed")  # the last trajectory
    assert late.trajectory == moving.trajectory


def test_the_chain_leaves_out_latencies_and_covers_all_else():
    stack = all_free(navigator())
    decision = stack.step(inputs())
    chain = chain_hash(decision, "before")
    decision.stages.map_ms += 5.0
    decision.chain = "anything"
    assert chain_hash(decision, "before") == chain
    assert chain_hash(decision, "other") != chain
    decision.position[0] += 1e-15
    assert chain_hash(decision, "before") != chain


def test_a_state_space_that_the_body_cannot_be_planned_in_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"^robot 'drone': ") as refused:
        navigator("planner.name=rrtstar", "planner.state_space=dubins")
    assert "\n" not in str(refused.value)
