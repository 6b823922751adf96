"""The pipeline on a real map, its records, and the limits of motion that it plans with."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.harness.interface.stacks.hand_made import task
from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, to_json
from wayproof.harness.decision import add_points, chain_hash, path_of, widened_in_words, widening_of
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.models.robots import LIMITS_IN_STATIC_WORLDS, ROBOTS, ROBOTS_BY_LIMITS

DRONE = replace(
    task("drone").mission,
    low=(0.0, 0.0, 0.0),
    high=(6.0, 4.0, 3.0),
    start=(1.05, 2.05, 1.05),
    goal=(5.05, 2.05, 1.05),
)


def navigator(*settings):
    return build_navigator(override(Config("empty", "drone", 1), settings), DRONE, {})


def inputs(sequence=0, position=DRONE.start, sigma=0.0):
    """The pose of one instant, without sweeps: the map stays as it is."""
    pose = Pose(np.array(position), np.array([1.0, 0.0, 0.0, 0.0]), sigma)
    return Inputs(sequence * 100_000_000, sequence, pose, (), "digest")


def all_free(stack):
    """Mark the whole operating area free."""
    stack.map.mark_free(DRONE.low, DRONE.high, 0)
    return stack


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


coordinates = st.floats(allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize(("kind", "field"), [(pb.Trajectory, "path"), (pb.Decision, "global_path")])
@given(points=st.lists(st.tuples(coordinates, coordinates, coordinates), max_size=20))
def test_points_in_wire_format_are_the_messages_that_protobuf_makes_itself(kind, field, points):
    """Down to what is left out when serialized: a zero, but not a negative one, and no path."""
    nothing = pb.Decision()
    add_points(nothing, "global_path", None)
    assert nothing == pb.Decision()
    quick, slow = kind(), kind()
    for message in (quick, slow):  # what is there already stays
        getattr(message, field).add(x=1.0)
    add_points(quick, field, np.array(points).reshape(-1, 3))
    getattr(slow, field).extend(pb.Point(x=x, y=y, z=z) for x, y, z in points)
    assert quick.SerializeToString(deterministic=True) == slow.SerializeToString(deterministic=True)
    np.testing.assert_array_equal(
        path_of(getattr(quick, field))[1:], path_of(getattr(slow, field))[1:]
    )


def test_a_widening_is_named_by_its_axis_and_a_forged_one_refused():
    wider = pb.Decision(resolution_m=0.1, widening=[0, 5])
    assert widened_in_words(wider) == ", 0.50 m more along y"
    assert widening_of(pb.Decision()) == (0, 0)
    for forged in ([1], [1, 2, 3], [0, 4_000_000_000]):
        with pytest.raises(InputError, match=r"widening .* expected two of at most 400 cells"):
            widening_of(pb.Decision(widening=forged))


SLOPES = "costmap.max_slope=0.2"


@pytest.mark.parametrize(
    ("robot", "world", "settings", "limits", "speed", "sideways"),
    [
        ("quadruped", "empty", [], "full", 1.5, 0.35),
        ("quadruped", "crossing", [], "cautious", 1.0, 0.0),
        ("quadruped", "ghosts", [], "cautious", 1.0, 0.0),
        ("quadruped", "crossing", ["motion.limits=full"], "full", 1.5, 0.35),
        ("quadruped", "empty", ["motion.limits=cautious"], "cautious", 1.0, 0.0),
        ("quadruped", "empty", [SLOPES], "sloping", 0.7, None),
        ("quadruped", "crossing", [SLOPES], "sloping", 0.7, None),
        ("quadruped", "empty", [SLOPES, "motion.limits=full"], "full", 1.5, 0.35),
        ("drone", "empty", [], "full", 4.0, 4.0),
        ("drone", "crossing", [], "cautious", 2.0, 0.0),
        ("drone", "empty", ["motion.limits=cautious"], "cautious", 2.0, 0.0),
    ],
)
def test_a_log_says_which_limits_a_robot_had_in_its_world(
    robot, world, settings, limits, speed, sideways
):
    built = build(override(Config(world, robot, 0), settings))
    config, mission = built.config, built.mission
    assert (config.motion.limits, mission.max_speed) == (limits, speed)
    assert sideways is None or mission.sideways_speed == sideways
    # What walks turns by the acceleration of its gait.
    turns = 4.0 if robot == "quadruped" and SLOPES not in settings else 0.0
    assert mission.max_yaw_acceleration == turns
    assert motion_limits(config, mission).yaw_acceleration == (turns or math.inf)
    assert from_json(to_json(config)) == config


def test_the_registry_says_of_every_robot_what_auto_stands_for():
    assert set(LIMITS_IN_STATIC_WORLDS) == set(ROBOTS)
    assert all(set(robots) == set(ROBOTS) for robots in ROBOTS_BY_LIMITS.values())
