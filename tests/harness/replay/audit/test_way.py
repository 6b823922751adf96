"""Rules of paths by action."""

import dataclasses

import numpy as np
import pytest

from wayproof.harness.config import Config, StackConfig
from wayproof.harness.inputs import Inputs, Pose
from wayproof.harness.judge.body import Body
from wayproof.harness.log.reader import Record
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.committed import Committed
from wayproof.harness.replay.audit.evidence import filtered_length
from wayproof.harness.replay.audit.run import judge
from wayproof.harness.replay.audit.way import judge_way
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import VoxelMap

AIR = Mission(
    "air", 0.2, 0.2, 0.0, 2.0, 2.0, 10.0, 1.0,
    (-3.0, -3.0, -3.0), (3.0, 3.0, 3.0), (0.0, 0.0, 1.0), 0.0, (2.0, 0.0, 1.0),
)  # fmt: skip
"""A ball of 0.2 m; with the margin of 0.1 m and half a diagonal of its cells it needs 3.9 cells."""


def in_the_air(way, arcs, action, before=None, mission=AIR):
    """The ball in a box of free cells, x and y up to 1 and 2 m, on its way at so many samples."""
    config = Config("empty", "drone", 1)
    voxel_map = VoxelMap(config.map, mission.low, mission.high)
    voxel_map.mark_free((-2.0, -2.0, -0.5), (1.0, 2.0, 2.5), 0)
    decision = pb.Decision(action=action, trajectory=trajectory(way, arcs))
    pose = Pose(np.array(way[0]), np.array([1.0, 0.0, 0.0, 0.0]), position_sigma=0.0)
    record = Record(Inputs(0, 1, pose, (), ""), pb.Latency(), decision)
    body = Body(config, mission, "forbid")
    before = before or trajectory(way, arcs)
    return Committed(record, config, mission, voxel_map, voxel_map, "", body, (before,))


def trajectory(way, arcs):
    return pb.Trajectory(
        path=[pb.Point(x=x, y=y, z=z) for x, y, z in way],
        arc_length=arcs,
        heading=np.zeros(len(arcs)),
        sample_period_s=0.1,
    )


def at_speed(way, speed):
    """Samples of a way at one speed."""
    total = np.linalg.norm(np.diff(np.array(way), axis=0), axis=1).sum()
    return np.append(np.arange(0.0, total, 0.1 * speed), total)


def test_a_stop_leaves_the_way_only_where_that_is_blocked_and_comes_no_nearer():
    """Free is x < 1 and what is beside; a ball of 0.2 m flew along x."""

    def is_last_resort(way, stop):
        way, stop = ([(0.2, 0.0, 1.0), *points] for points in (way, stop))
        before = trajectory(way, at_speed(way, 1.0))
        return judge_way(in_the_air(stop, at_speed(stop, 1.0), "stop_and_wait", before)).kind

    ahead, short, aside = [(0.9, 0.0, 1.0)], [(0.5, 0.0, 1.0)], [(0.6, 0.3, 1.0), (0.75, 0.9, 1.0)]
    beyond = [(0.6, 0.3, 1.0), (0.98, 0.6, 1.0)]
    assert is_last_resort(ahead, aside) == "stop"
    assert is_last_resort(ahead, [(0.8, 0.0, 1.0)]) == "stop"  # along it
    assert is_last_resort(ahead, beyond) == "swept"
    assert is_last_resort(short, aside) == "swept"


def test_a_stop_that_cannot_but_enter_a_blocked_cell_ends_farther_from_it():
    """Free is x < 1; the centre of the ball enters what is beyond either way."""
    before = [(0.8, 0.0, 1.0), (1.4, 0.0, 1.0)]
    earlier = trajectory(before, at_speed(before, 1.0))

    def kind(*points):
        stop = [(0.8, 0.0, 1.0), (1.05, 0.1, 1.0), *points]
        return judge_way(in_the_air(stop, at_speed(stop, 1.0), "stop_and_wait", earlier)).kind

    assert kind((0.85, 0.35, 1.0)) == "stop"
    assert kind((1.2, 0.3, 1.0)) == "swept"  # within it as well


def test_a_stop_leaves_the_way_where_only_the_cell_that_it_begins_in_is_blocked():
    """Blocked is x > 0.7; of the way before that is sampled, the nearest point lies 3 mm on."""
    before = [(0.718, 0.0, 1.0), (0.0, 0.0, 1.0)]
    aside = [(0.7015, 0.0, 1.0), (0.5, 0.1, 1.0), (0.4, 0.3, 1.0)]
    earlier = trajectory(before, at_speed(before, 1.0))
    way = judge_way(in_the_air(aside, at_speed(aside, 1.0), "stop_and_wait", earlier))
    assert way.kind == "stop"


def test_a_stop_on_a_way_that_has_closed_brakes_at_once():
    """From 1.6 m/s with 2 m/s^2 it is 0.64 m; the way leads 0.9 m on, into the unknown."""
    way = [(0.05, 0.0, 1.0), (0.95, 0.0, 1.0)]
    before = trajectory(way, at_speed(way, 1.6))
    braked = [1.6 * t - t * t for t in np.arange(0.0, 0.81, 0.1)]
    stopped = judge_way(in_the_air(way, braked, "stop_and_wait", before))
    assert (stopped.kind, stopped.violations) == ("stop", ())
    rode_on = judge_way(in_the_air(way, at_speed(way, 0.5), "stop_and_wait", before))
    assert [one.rule for one in rode_on.violations] == ["stop"]
    sped_up = judge_way(in_the_air(way, at_speed(way, 3.0), "stop_and_wait", before))
    assert [one.rule for one in sped_up.violations] == ["stop"]


def test_the_last_centimetre_of_a_stop_may_go_by_another_name():
    """The body rests in what has become unknown, and ends the turn that it was in."""
    begin, end = (0.95, 0.0, 1.0), (0.9505, 0.0, 1.0)
    earlier = trajectory([(0.2, 0.0, 1.0), end], at_speed([(0.2, 0.0, 1.0), end], 0.1))
    long = dataclasses.replace(AIR, motion="ground", discs=((-0.2, 0.15), (0.2, 0.15)))

    def kind(way, turn, stack="builtin"):
        moment = in_the_air(way, at_speed(way, 0.01), "slow", earlier, mission=long)
        moment.decision.trajectory.heading[:] = np.linspace(
            0.0, turn, len(moment.decision.trajectory.heading)
        )
        on_trial = dataclasses.replace(moment.config, stack=StackConfig(stack))
        return judge_way(dataclasses.replace(moment, config=on_trial)).kind

    assert kind([begin, end], 0.03) == "stop"
    assert kind([begin, (0.98, 0.0, 1.0)], 0.03) == "swept"
    assert kind([begin, end], 0.03, stack="dwa") == "swept"


def test_what_is_free_by_the_word_of_a_filter_alone():
    """Of 0.4 m along x the ball has room up to x = 0.3 in the map of the returns as they came.

    From there on fewer than 3.9 cells are left to what that map does not know, x > 0.6.
    """
    way = [(0.0, 0.0, 1.0), (0.4, 0.0, 1.0)]
    committed = in_the_air(way, at_speed(way, 1.0), "follow")
    committed.decision.collision_distance_sq = 15  # cells^2
    returns = VoxelMap(committed.config.map, AIR.low, AIR.high)
    returns.mark_free((-2.0, -2.0, -0.5), (0.6, 2.0, 2.5), 0)
    committed = dataclasses.replace(committed, returns=returns)
    assert filtered_length(committed) == pytest.approx(0.1)
    same = dataclasses.replace(committed, returns=committed.measured)
    assert filtered_length(same) == 0.0
    swept = [judge(committed, as_measured=one)[1] for one in (False, True)]
    assert ["swept" in {one.rule for one in found} for found in swept] == [False, True]


def test_a_recovery_is_held_against_its_rules_along_its_whole_way():
    """The first cell that is unknown is ten cells from x = 0; 3.9 cells are needed."""

    def broken(way, speed=0.5, mission=AIR):
        points = [(x, y, 1.0) for x, y in way]
        way = judge_way(in_the_air(points, at_speed(points, speed), "recover", mission=mission))
        return way.kind, [one.text for one in way.violations]

    assert broken([(0.75, 0.0), (0.55, 0.0)]) == ("recovery", [])
    assert broken([(0.55, 0.0), (0.0, 0.0)]) == ("swept", [])  # back where it came along
    _, texts = broken([(0.75, 0.0), (0.55, 0.0)], speed=1.5)
    assert texts == ["1.50 m/s, 0.60 allowed on the way out of the inflation"]
    _, texts = broken([(0.79, 0.0), (0.71, 0.0)])
    assert texts == ["its end is no admitted place"]
    _, texts = broken([(0.75, 0.0), (0.95, 0.0), (0.55, 0.0)])
    assert "it comes nearer to what blocks it, by more than a cell" in texts
    _, texts = broken([(0.75, 0.0), (0.85, 0.0), (0.55, 0.0)])
    assert texts == []  # by a cell
    _, texts = broken([(0.55, 0.0), (0.95, 0.0), (0.55, 0.0)])
    assert "it starts outside of the inflation, and leads through it" in texts
    # It starts a cell from the unknown, and passes a cell from a fence that is as good as a wall.
    wide = dataclasses.replace(AIR, radius=0.35)
    fenced = dataclasses.replace(wide, high=(1.0, 3.0, 3.0))
    way = [(0.4, 1.95), (0.95, 1.4), (0.4, 1.4)]
    assert broken(way, mission=wide)[1] == []
    assert broken(way, mission=fenced)[1] == [
        "the bare body overlaps an occupied cell, deeper than at its start"
    ]
