"""Missions of several goals: order, endings, figures, and the log of each."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import task
from wayproof.harness.config import Config, EpisodeConfig
from wayproof.harness.config_document import from_json, override, to_json
from wayproof.harness.ending import Limits
from wayproof.harness.errors import InputError
from wayproof.harness.goals import distance_left, goal_message, goal_name, goals_reached
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.metrics import score
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.what_if import what_if
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.trace import read_trace

THERE_AND_BACK = ("waypoints=[[4.5,3.0]]", "goal=home", "start=[3.0,3.0]")
CLOSE = ("waypoints=[[3.0,3.0],[4.2,3.0],[4.3,3.0]]", "goal=[4.35,3.1]", "start=[3.0,3.0]")


def mission(*goals, motion="ground"):
    area = {"low": (0.0, 0.0, 0.0), "high": (20.0, 20.0, 3.0), "start": (1.0, 1.0, 0.3)}
    route = {"goal": goals[-1], "waypoints": goals[:-1]}
    return replace(task().mission, **area, **route, motion=motion, discs=())


ANGLE = mission((4.0, 1.0, 0.3), (4.0, 5.0, 0.3), (1.0, 1.0, 0.3))


def decision(action, number=0):
    message = pb.Decision(action=action, reason="why", sequence=number)
    message.timestamp.FromNanoseconds(number * 10**8)
    return message


def test_the_way_left_leads_through_all_goals():
    assert distance_left(ANGLE, 0, np.array([1.0, 1.0, 9.0])) == 3.0 + 4.0 + 5.0
    assert distance_left(ANGLE, 2, np.array([1.0, 3.0, 9.0])) == 2.0
    assert distance_left(ANGLE, 3, np.array([1.0, 3.0, 9.0])) == 0.0
    above = replace(ANGLE, motion="air")
    assert distance_left(above, 2, np.array([1.0, 1.0, 2.3])) == pytest.approx(2.0)


def test_a_mission_of_one_goal_has_no_goals_as_inputs_and_no_field():
    single = mission((4.0, 1.0, 0.3))
    assert goal_message(single, 0, 7, 0) is None
    assert goal_name(single, 0) == "the goal"
    assert b"waypoints" not in single.to_json()
    assert b"waypoints" not in to_json(Config("empty", "drone", 1))
    for one in (ANGLE, single):
        assert Mission.from_json(one.to_json()) == one
        assert Mission.from_json(one.to_json()).to_json() == one.to_json()


def test_each_claim_is_checked_against_its_own_goal():
    limits = Limits(EpisodeConfig(), ANGLE, 0.1)
    at = [np.array(goal) for goal in ANGLE.goals]
    assert limits.ending_at(decision("goal"), [at[0]], 0) is None
    assert limits.ending_at(decision("goal"), [at[1]], 1) is None
    assert limits.ending_at(decision("goal"), [at[2]], 2) == (
        "success",
        "at rest 0.00 m from goal 3 of 3",
    )
    outcome, reason = limits.ending_at(decision("goal"), [at[0]], 1)
    assert (outcome, reason) == ("aborted", "claimed goal 2 of 3 from 4.00 m away")


def test_the_time_limit_holds_for_the_whole_mission_and_names_the_next_goal():
    limits = Limits(EpisodeConfig(time_limit=1.0), ANGLE, 0.1)
    at = [np.array(goal) for goal in ANGLE.goals]
    late = decision("goal", 10)
    assert limits.ending_at(late, [at[0]], 0) == ("timeout", "4.00 m from goal 2 of 3 after 1 s")
    assert limits.ending_at(late, [at[2]], 2) == ("success", "at rest 0.00 m from goal 3 of 3")


def test_a_false_claim_reaches_no_goal():
    claims = [decision("goal"), decision("follow", 1), decision("goal", 2)]
    assert goals_reached(claims, "aborted") == 1
    assert goals_reached(claims, "success") == 2
    assert goals_reached(claims[:2], "aborted") == 1
    assert goals_reached([], "error") == 0


@pytest.mark.few(1)
@pytest.mark.parametrize(("robot", "settings"), [("drone", THERE_AND_BACK), ("quadruped", CLOSE)])
def test_a_mission_replays_simulates_again_and_is_audited(recorded, robot, settings):
    result = recorded("empty", robot, 1, *settings)
    assert result.outcome == "success", result.reason
    path = Path(result.log)
    log = open_log(path)
    goals = [one for one in read_messages(path) if isinstance(one, pb.Goal)]
    claims = [one.sequence for one in log.decisions() if one.action == "goal"]
    assert len(claims) == len(log.mission.goals)
    assert [one.index for one in goals] == [
        sum(claim < one.sequence for claim in claims) for one in goals
    ]
    assert replay(path).identical
    assert simulate_again(path).identical
    assert audit(path).violations == ()
    assert from_json(to_json(log.config)) == log.config


def test_figures_count_the_whole_mission(recorded):
    result = recorded("empty", "drone", 1, *THERE_AND_BACK)
    assert result.route_length_m == pytest.approx(3.0, abs=1e-6)
    assert result.goal_distance_m < 0.25
    trace = read_trace(open_log(Path(result.log)))
    assert trace.start_distance == pytest.approx(3.0)
    assert (trace.goals, trace.goals_reached) == (2, 2)
    figures = score(trace)
    assert figures["progress"] == figures["success"] == 1.0
    assert figures["path_ratio"] == pytest.approx(trace.path_length / 3.0)
    assert figures["spl"] == pytest.approx(min(3.0 / trace.path_length, 1.0))


def test_time_that_runs_out_after_the_first_goal(recorded):
    result = recorded("empty", "drone", 1, *THERE_AND_BACK, "episode.time_limit=2.6")
    assert result.outcome == "timeout"
    assert "from goal 2 of 2 after 2.6 s" in result.reason
    trace = read_trace(open_log(Path(result.log)))
    figures = score(trace)
    assert (figures["success"], figures["progress"]) == (0.0, 0.5)
    left = trace.goal_distance / 3.0
    assert figures["soft_spl"] == pytest.approx((1.0 - left) * min(3.0 / trace.path_length, 1.0))
    assert replay(Path(result.log)).identical


def test_the_cause_of_a_mission_that_cannot_be_done_in_time_counts_all_legs(recorded):
    result = recorded("empty", "drone", 1, *THERE_AND_BACK, "episode.time_limit=1.6")
    assert (result.outcome, result.cause) == ("timeout", "impossible"), result.cause_evidence


def test_a_collision_between_goals(recorded):
    result = recorded(
        "warehouse", "drone", 4, "stack.name=blind", 'waypoints=["home","world"]', "goal=home"
    )
    assert result.outcome == "collision", result.reason
    log = open_log(Path(result.log))
    assert score(read_trace(log))["progress"] == pytest.approx(1 / 3)
    assert result.goal_distance_m > distance_left(log.mission, 2, np.array(log.mission.goals[1]))
    assert simulate_again(Path(result.log)).identical


@pytest.mark.large
def test_a_stack_on_trial_is_led_from_goal_to_goal(recorded):
    stack = f"exec:{sys.executable} -m wayproof serve gap"
    result = recorded("empty", "quadruped", 1, f"stack.name={stack}", *THERE_AND_BACK)
    assert result.outcome == "success", result.reason
    assert simulate_again(Path(result.log)).identical


def claims_of(log):
    return [one.sequence for one in log.decisions() if one.action == "goal"]


def test_a_fork_after_the_first_goal_ends_alike_or_goes_elsewhere(recorded, tmp_path):
    result = recorded("empty", "drone", 1, *THERE_AND_BACK)
    path = Path(result.log)
    first = claims_of(open_log(path))[0]
    assert fork(path, first + 1, (), tmp_path / "same.mcap").chain == result.chain
    other = fork(path, first + 5, ["goal=[4.5,4.0]"], tmp_path / "other.mcap")
    assert other.outcome == "success"
    assert simulate_again(Path(other.log)).identical
    last = list(open_log(Path(other.log)).truth())[-1].position
    assert np.linalg.norm(np.subtract(last[:2], (4.5, 4.0))) < 0.25


@pytest.mark.parametrize(
    ("mission", "setting", "expected"),
    [
        (THERE_AND_BACK, "waypoints=[]", "a mission of 1 goals, expected several"),
        (THERE_AND_BACK, 'waypoints=["aisle"]', "expected a point or home"),
        (CLOSE[1:], "waypoints=[[4.0,3.0]]", "a mission of 2 goals, expected one"),
    ],
)
def test_a_fork_keeps_one_goal_or_several(recorded, tmp_path, mission, setting, expected):
    path = Path(recorded("empty", "drone", 1, *mission).log)
    with pytest.raises(InputError, match=expected):
        fork(path, 5, [setting], tmp_path / "fork.mcap")


def test_a_what_if_leads_to_the_goal_of_the_same_number(recorded):
    path = Path(recorded("empty", "drone", 1, *THERE_AND_BACK).log)
    first = claims_of(open_log(path))[0]
    answer = what_if(path, ["goal=[4.5,4.5]"])
    assert answer.faithful
    assert min(one.sequence for one in answer.changes) == first + 1
    answer = what_if(path, ["waypoints=[[4.5,4.5]]"])
    assert min(one.sequence for one in answer.changes) == 0
    assert max(one.sequence for one in answer.changes) <= first


def test_a_goal_that_was_altered_is_found(recorded, tmp_path):
    path = Path(recorded("empty", "drone", 1, *THERE_AND_BACK).log)
    forged = tmp_path / "forged.mcap"

    def altered():
        for message in read_messages(path):
            if isinstance(message, pb.Goal) and message.sequence == 3:
                message.index = 1
            yield message

    head = read_head(walk(path, head_only=True), path, allow_plugins=False)
    write_copy(forged, head, altered(), open_log(path).result)
    found = [one.field for one in contradictions(open_log(forged))]
    assert "/goal[3]" in found
    assert "/decision[3].input_digest" in found


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (['waypoints=["aisle"]'], "goal aisle: world 'empty' has none; expected a point, home"),
        (["waypoints=[[40,3]]"], r"waypoints: got \(40, 3, 1\), expected inside the geofence"),
        (["waypoints=[[1]]"], "waypoints: got 1 numbers, expected x,y or x,y,z"),
        (["goal=there"], "goal: got 'there', expected x,y, x,y,z or home, world or aisle"),
        ([f"waypoints={[[1, 1]] * 101}"], "waypoints: got 101, expected at most 100"),
    ],
)
def test_a_wrong_goal_is_refused(settings, expected):
    with pytest.raises(InputError, match=expected):
        build(override(Config("empty", "drone", 1), settings))


def test_a_body_that_does_not_move_sideways_has_no_such_field():
    ahead = mission((1.0, 1.0, 0.3))
    assert b"sideways_speed" not in ahead.to_json()
    aside = replace(ahead, sideways_speed=0.5)
    assert Mission.from_json(aside.to_json()) == aside
    with pytest.raises(ValueError, match="sideways_speed: got 2, expected 0 to max_speed"):
        replace(ahead, sideways_speed=2.0)
    assert b"max_yaw_acceleration" not in ahead.to_json()
    turning = replace(ahead, max_yaw_acceleration=4.0)
    assert Mission.from_json(turning.to_json()) == turning
    with pytest.raises(ValueError, match="max_yaw_acceleration: got -1, expected 0 to 1e4"):
        replace(ahead, max_yaw_acceleration=-1.0)
