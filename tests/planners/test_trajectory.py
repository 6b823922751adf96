"""Trajectories keep their limits, end at rest and repeat to the bit."""

import math
from dataclasses import replace

import numpy as np
import pytest
import ruckig

from tests.planners.motions import DRONE, LIMITS, LINE, MS, sampled
from tests.planners.worlds import point
from wayproof.planners import (
    MotionLimits,
    PathState,
    SlowEnd,
    arc_lengths,
    blend_corners,
    follow_path,
    hold,
    jerk_limited,
    keeps_limits,
    remaining,
    speed_limits,
    speed_zones,
    stop_along,
    stopping_distance,
    time_along,
    trajectory,
    turn_in_place,
)


def random_case(room, seed: int):
    """A winding path, limits, a speed cap and a state (s, speed, acceleration) on the path."""
    rng = np.random.default_rng(seed)
    limits = LIMITS[seed % len(LIMITS)]
    count = rng.integers(2, 7)
    steps = np.stack([rng.uniform(-5, 20, count), rng.uniform(-15, 15, count)], axis=1)
    cells = np.array([50.0, 100.0]) + np.cumsum(steps, axis=0)
    waypoints = np.array([point(room, x, y) for x, y in cells])
    path = blend_corners(room, waypoints, float(rng.choice([0.05, 0.3, 0.6])))
    cap = float(rng.choice([9.0, limits.speed / 2.0]))
    if seed % 2:
        return path, limits, cap, (0.0, 0.0, 0.0)
    speed = rng.uniform(0.0, 1.3 * limits.speed)
    least = -min(limits.acceleration, math.sqrt(2.0 * limits.jerk * speed))
    acceleration = rng.uniform(least, limits.acceleration)
    return path, limits, cap, (rng.uniform(0.0, 0.9) * arc_lengths(path)[-1], speed, acceleration)


def test_a_straight_line_by_hand():
    # To 2 m/s at 4 m/s^2 and 30 m/s^3: T = v/a + a/j = 0.6333 s over v T / 2 = 0.6333 m, as long
    # to stop, and the 8.7333 m between in 4.3667 s.
    trajectory = follow_path(LINE, PathState(5 * MS, 0.0, 0.0, 0.0, 0.0), DRONE, speed_cap=9.0)
    assert trajectory.duration_s == pytest.approx(2 * 0.5 + 2 * 4 / 30 + 4.3666667)
    middle = trajectory.at(5 * MS + int(trajectory.duration_s * 0.5e9))
    assert middle.position == pytest.approx([5.0, 0.0, 1.0])
    assert middle.velocity == pytest.approx([2.0, 0.0, 0.0])
    first_jerk = trajectory.at(105 * MS)  # j t^3 / 6, j t^2 / 2, j t after 0.1 s
    assert first_jerk.arc_length == pytest.approx(0.005)
    assert first_jerk.speed == pytest.approx(0.15)
    assert first_jerk.acceleration == pytest.approx(3.0)
    assert not first_jerk.at_rest
    assert trajectory.stop_point.tolist() == [10.0, 0.0, 1.0]
    assert trajectory.at(0).position.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("seed", range(12))
def test_limits_hold_on_dense_samples(room, seed):
    path, limits, cap, state = random_case(room, seed)
    trajectory = follow_path(path, PathState(0, *state, 0.3), limits, cap)
    samples = sampled(trajectory)
    assert np.abs(samples["acceleration"]).max() <= limits.acceleration + 1e-9
    assert np.abs(np.diff(samples["acceleration"])).max() / 0.002 <= limits.jerk + 1e-6
    assert samples["speed"].min() >= 0.0
    s, speed, _ = state
    assert samples["arc_length"][0] == pytest.approx(s, abs=1e-12)
    assert (samples["speed"][0], samples["acceleration"][0]) == state[1:]
    means = 0.5 * (samples["speed"][1:] + samples["speed"][:-1])
    assert np.diff(samples["arc_length"]) == pytest.approx(0.002 * means, abs=1e-7)
    assert samples["speed"][-1] == 0.0
    assert samples["at_rest"][-1]
    end = arc_lengths(path)[-1] + trajectory.overshoot_m
    assert samples["arc_length"][-1] == pytest.approx(end, abs=1e-5)
    if speed == 0.0:  # nothing to slow down from: the curvature's limits hold throughout
        assert trajectory.overshoot_m == 0.0
        allowed = speed_limits(path, limits.lateral_acceleration, limits.yaw_rate)
        arcs = arc_lengths(path)
        nearest = np.searchsorted(0.5 * (arcs[1:] + arcs[:-1]), samples["arc_length"])
        allowed = np.maximum(np.minimum(allowed, min(cap, limits.speed)), 0.02)
        assert (samples["speed"] <= allowed[nearest] + 1e-6).all()


@pytest.mark.parametrize("seed", range(1, 12, 2))
def test_a_slow_end_limits_the_speed_there_alone(room, seed):
    path, limits, cap, state = random_case(room, seed)
    length = arc_lengths(path)[-1]
    begin, slow = 0.6 * length, 0.4 * min(cap, limits.speed)
    start = PathState(0, *state, 0.3)
    ends_slowly = follow_path(path, start, limits, cap, slow_end=SlowEnd(begin, slow))
    samples = sampled(ends_slowly)
    beyond = samples["arc_length"] > begin + 1e-6
    assert samples["speed"][beyond].max() <= slow + 1e-6
    assert samples["speed"][~beyond].max() > slow + 1e-3
    assert samples["arc_length"][-1] == pytest.approx(length, abs=1e-5)
    assert ends_slowly.duration_s > follow_path(path, start, limits, cap).duration_s


@pytest.mark.parametrize("seed", range(0, 12, 4))
def test_heading_follows_the_path_no_faster_than_the_yaw_rate(room, seed):
    path, limits, cap, state = random_case(room, seed)
    samples = sampled(follow_path(path, PathState(0, *state, 2.0), limits, cap))
    assert samples["heading"][0] == 2.0
    assert np.abs(np.diff(samples["heading"])).max() / 0.002 <= limits.yaw_rate + 1e-6
    assert np.abs(samples["yaw_rate"]).max() <= limits.yaw_rate + 1e-6


@pytest.mark.parametrize("seed", range(0, 12, 4))
def test_heading_follows_the_path_within_the_yaw_acceleration(room, seed):
    path, limits, cap, state = random_case(room, seed)
    limits = replace(limits, yaw_acceleration=4.0)
    begins = PathState(0, *state, 2.0, yaw_rate=0.5)
    trajectory = follow_path(path, begins, limits, cap)
    times = np.arange(0.0, 0.01 * math.floor(trajectory.motion.duration / 0.01), 0.01)
    headings = trajectory.turning.motion(times)[0]
    rates = np.diff(headings) / 0.01
    assert headings[0] == 2.0
    assert abs(rates[0] - 0.5) <= 0.04 + 1e-6
    assert np.abs(np.diff(rates)).max() <= 0.04 + 1e-6
    assert np.abs(rates).max() <= limits.yaw_rate + 1e-6


def test_heading_stays_with_a_blended_corner(room):
    corner = np.array([point(room, 50, 50), point(room, 80, 50), point(room, 80, 80)])
    path = blend_corners(room, corner, blend_length=0.6)
    samples = sampled(follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), LIMITS[0], 9.0))
    moving = samples["speed"] > 0.05
    course = np.arctan2(samples["velocity"][:, 1], samples["velocity"][:, 0])
    assert np.abs(course - samples["heading"])[moving].max() < 0.1
    assert samples["heading"][-1] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("recut", [False, True])
@pytest.mark.parametrize("seed", [1, 3, 5, 7])
def test_replanning_every_tenth_second_does_not_jump(room, seed, recut):
    path, limits, cap, _ = random_case(room, seed)
    once = follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), limits, cap)
    goal, now, trajectory = path[-1], 0, once
    while not trajectory.at(now + 100 * MS).at_rest:
        now += 100 * MS
        before = trajectory.at(now)
        s = before.arc_length
        if recut:
            path, s = remaining(path, s), 0.0
        trajectory = follow_path(
            path, PathState(now, s, before.speed, before.acceleration, before.heading), limits, cap
        )
        after = trajectory.at(now)
        assert after.position == pytest.approx(before.position, abs=1e-9)
        assert after.speed == pytest.approx(before.speed, abs=1e-12)
        assert after.acceleration == pytest.approx(before.acceleration, abs=1e-9)
        assert after.heading == before.heading
        assert now < 2e9 * once.duration_s
    assert trajectory.stop_point == pytest.approx(goal, abs=1e-4)
    # A bend is taken at its slowest limit throughout; replanning sees what is left of it.
    assert now * 1e-9 + trajectory.duration_s == pytest.approx(once.duration_s, rel=0.1)


def time_to_the_end(path):
    """Time of a motion that is replanned on what is left of its path every tenth second, s."""
    now, trajectory = 0, follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), DRONE, 9.0)
    while now < 20_000 * MS and not trajectory.at(now + 100 * MS).at_rest:
        now += 100 * MS
        at = trajectory.at(now)
        path = remaining(path, at.arc_length)
        state = PathState(now, 0.0, at.speed, at.acceleration, at.heading)
        trajectory = follow_path(path, state, DRONE, 9.0)
    return now * 1e-9 + trajectory.duration_s


def test_replanning_in_a_bend_does_not_end_the_acceleration():
    """Along an arc of 1 m radius, which allows sqrt(3) m/s."""
    angles = np.linspace(0.0, 1.5, 30)
    arc = np.column_stack([np.sin(angles), 1.0 - np.cos(angles), np.zeros(30)])
    once = follow_path(arc, PathState(0, 0.0, 0.0, 0.0, 0.0), DRONE, 9.0)
    assert time_to_the_end(arc) == pytest.approx(once.duration_s, rel=0.01)


def test_a_bend_that_is_entered_too_fast_begins_in_the_middle_of_its_edge():
    angles = np.linspace(0.0, 1.5, 30)
    arc = np.column_stack([np.sin(angles), 1.0 - np.cos(angles), np.zeros(30)])
    (bend,) = speed_zones.speed_zones(arc, 0.0, 9.0, DRONE, speed=0.5)
    assert bend.speed == pytest.approx(math.sqrt(DRONE.lateral_acceleration), rel=1e-3)
    straight, *_ = speed_zones.speed_zones(arc, 0.0, 9.0, DRONE, speed=bend.speed + 0.1)
    assert straight.speed == 9.0
    assert straight.length == pytest.approx(0.5 * 1.5 / 29, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "acceleration"), [(2.0, 0.0), (1.0, 3.0), (0.05, 0.0), (1.5, -4.0)]
)
def test_a_stop_is_the_one_that_ruckig_finds(speed, acceleration):
    request, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.current_velocity, request.current_acceleration = [speed], [acceleration]
    request.max_acceleration, request.max_jerk = [DRONE.acceleration], [DRONE.jerk]
    ruckig.Ruckig(1).calculate(request, found)
    (distance,), _, _ = found.at_time(found.duration)
    trajectory = stop_along(LINE, PathState(0, 3.0, speed, acceleration, 0.0), DRONE)
    assert stopping_distance(speed, acceleration, DRONE) == pytest.approx(distance)
    assert trajectory.stop_point == pytest.approx([3.0 + distance, 0.0, 1.0])
    for time in np.linspace(0.0, found.duration, 50):
        (s,), (v,), (a,) = found.at_time(time)
        sample = trajectory.at(round(time * 1e9))
        assert sample.arc_length == pytest.approx(3.0 + s, abs=1e-7)
        assert sample.speed == pytest.approx(v, abs=1e-7)
        assert sample.acceleration == pytest.approx(a, abs=1e-6)


def test_stopping_distance_by_hand():
    assert stopping_distance(2.0, 0.0, DRONE) == pytest.approx(0.5 * 2.0 * (2.0 / 4.0 + 4.0 / 30.0))
    # The acceleration never reaches its limit: T = 2 sqrt(v / j)
    assert stopping_distance(0.3, 0.0, DRONE) == pytest.approx(0.3 * math.sqrt(0.3 / 30.0))
    assert stopping_distance(0.0, 0.0, DRONE) == 0.0


def test_a_path_too_short_to_stop_is_left_straight_on():
    trajectory = follow_path(LINE, PathState(0, 9.8, 2.0, 0.0, 0.0), DRONE, 9.0)
    beyond = stopping_distance(2.0, 0.0, DRONE) - 0.2
    assert trajectory.overshoot_m == pytest.approx(beyond)
    assert trajectory.stop_point == pytest.approx([10.0 + beyond, 0.0, 1.0])
    fits = follow_path(LINE, PathState(0, 9.3, 2.0, 0.0, 0.0), DRONE, 9.0)
    assert fits.overshoot_m == 0.0
    assert fits.stop_point == pytest.approx([10.0, 0.0, 1.0])


CORNER = [[0.0, 0.0, 0.0], [0.45, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.05, 0.0], [0.5, 1.5, 0.0]]
"""After half a metre, with a limit of 0.33 m/s."""


@pytest.mark.parametrize(
    ("path", "speed", "kept"),
    [
        (LINE, 2.0, True),
        (LINE, 2.1, False),  # faster than the limit
        ([[0.0, 0.0, 0.0], [0.7, 0.0, 0.0]], 2.0, True),
        ([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0]], 2.0, False),  # it takes 0.63 m to stop
        (CORNER, 2.0, False),
        (CORNER, 0.5, True),
        (LINE[:1], 0.0, False),
    ],
)
def test_limits_are_kept_on_a_path_that_leaves_room_to_slow_down_and_to_stop(path, speed, kept):
    path, state = np.array(path), PathState(0, 0.0, speed, 0.0, 0.0)
    assert keeps_limits(path, state, DRONE, sideways_speed=9.0) is kept
    if kept:
        driven = sampled(follow_path(path, state, DRONE, 9.0, sideways_speed=9.0))
        assert driven["arc_length"].max() == pytest.approx(arc_lengths(path)[-1])


def test_slower_than_a_crawl_is_a_stop():
    trajectory = follow_path(LINE, PathState(0, 1.0, 1.0, 0.0, 0.0), DRONE, speed_cap=0.0)
    assert trajectory.motion.end == pytest.approx(1.0 + stopping_distance(1.0, 0.0, DRONE))
    still = follow_path(LINE, PathState(0, 1.0, 0.0, 0.0, 0.5), DRONE, speed_cap=0.0)
    assert still.stop_point.tolist() == [1.0, 0.0, 1.0]
    assert still.at(0).at_rest


@pytest.mark.parametrize("path", [LINE[:1], LINE[[0, 0]]])
def test_a_path_without_length_is_a_rest(path):
    trajectory = follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.7), DRONE, 9.0)
    sample = trajectory.at(0)
    assert (sample.at_rest, sample.heading, sample.speed) == (True, 0.7, 0.0)
    assert sample.position.tolist() == LINE[0].tolist()


def test_a_turn_in_place_takes_the_shorter_way():
    limits = LIMITS[0]
    trajectory = turn_in_place(LINE[0], 0, 3.0, -3.0, limits)
    samples = sampled(trajectory)
    assert samples["heading"][0] == 3.0
    assert samples["heading"][-1] == pytest.approx(2.0 * math.pi - 3.0)
    assert np.abs(samples["yaw_rate"]).max() <= limits.yaw_rate + 1e-9
    assert np.ptp(samples["position"], axis=0).tolist() == [0.0, 0.0, 0.0]
    assert samples["at_rest"].tolist() == [False] * (len(samples["at_rest"]) - 2) + [True] * 2
    # Acceleration and jerk have the proportion to the yaw rate that they have to the speed:
    # 1.5 * 1.2 / 1.0 = 1.8 rad/s^2 and 7.2 rad/s^3.
    yaw = turn_in_place(LINE[0], 0, 0.0, 3.0, limits)
    assert yaw.duration_s == pytest.approx(3.0 / 1.2 + 1.2 / 1.8 + 1.8 / 7.2)


def test_holding_is_rest_from_the_start():
    sample = hold(LINE[1], 7, 0.4).at(0)
    assert sample.position.tolist() == LINE[1].tolist()
    assert (sample.heading, sample.at_rest, sample.arc_length) == (0.4, True, 0.0)


def test_wrong_input_is_refused():
    with pytest.raises(ValueError, match=r"limits\.jerk: got 0\.0, expected above 0, finite"):
        MotionLimits(1.0, 1.0, 0.0, 1.0, 1.0)
    with pytest.raises(ValueError, match=r"speed: got -0\.1, expected 0 or more"):
        follow_path(LINE, PathState(0, 0.0, -0.1, 0.0, 0.0), DRONE, 1.0)
    with pytest.raises(ValueError, match=r"path: got shape \(0, 3\), expected \(m, 3\)"):
        stop_along(LINE[:0], PathState(0, 0.0, 0.0, 0.0, 0.0), DRONE)


@pytest.mark.parametrize("points", [1, 2, 9])
@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("interpreted", [False, True])
def test_setpoints_are_the_samples_one_by_one(points, ordered, interpreted, monkeypatch):
    """To the bit, before the begin and past the end too, and by the interpreter as compiled."""
    if interpreted:
        monkeypatch.setattr(jerk_limited, "sample", jerk_limited.sample.py_func)
        monkeypatch.setattr(trajectory, "locate_all", trajectory.locate_all.py_func)
    rng = np.random.default_rng(points)
    for _ in range(10):
        path = np.cumsum(rng.normal(0.0, 0.7, (points, 3)), axis=0)
        begin = int(rng.integers(0, 5_000 * MS))
        way = follow_path(path, PathState(begin, 0.1, 0.3, 0.2, float(rng.normal())), DRONE, 1.5)
        times = begin + rng.integers(-300 * MS, round(way.duration_s * 1e9) + 300 * MS, 80)
        at_ns = np.sort(times) if ordered else times
        setpoints = way.setpoints(at_ns)
        samples = [way.at(time) for time in at_ns.tolist()]
        fields = ("position", "velocity", "heading", "yaw_rate")
        for name, field in zip(setpoints._fields, fields, strict=True):
            expected = np.array([getattr(sample, field) for sample in samples])
            np.testing.assert_array_equal(getattr(setpoints, name), expected)


BENT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.5, 1.0], [3.0, 1.5, 1.0]])


def test_poses_with_the_corners_are_the_path_and_without_them_cut_it():
    along = follow_path(BENT, PathState(0, 0.0, 0.0, 0.0, 0.0), DRONE, 1.0)
    cut, whole = (along.poses(0.05, corners=corners) for corners in (False, True))
    assert arc_lengths(cut[:, :3])[-1] < 4.499
    assert arc_lengths(whole[:, :3])[-1] == pytest.approx(4.5, abs=1e-12)
    assert len(whole) == len(cut) + 2
    corners = [np.flatnonzero((whole[:, :3] == corner).all(axis=1)) for corner in BENT[1:3]]
    assert [len(found) for found in corners] == [1, 1]
    for (n,) in corners:
        before, at, after = whole[n - 1 : n + 2, 3]
        assert min(before, after) <= at <= max(before, after)
    np.testing.assert_array_equal(np.delete(whole, np.concatenate(corners), axis=0), cut)


def test_poses_and_path_after_a_time_are_the_rest_of_the_whole():
    along = follow_path(BENT, PathState(0, 0.0, 0.0, 0.0, 0.0), DRONE, 1.0)
    for corners in (False, True):
        whole = along.poses(0.05, corners=corners)
        for elapsed in (-1.0, 0.0, 0.52, 1.31, 2.0, 99.0):
            left = along.poses(0.05, elapsed, corners=corners)
            np.testing.assert_array_equal(left, whole[len(whole) - len(left) :])
    for elapsed in (0.0, 0.5, 1.0, 1.5, along.duration_s):
        left = along.path_after(elapsed)
        now = along.at(round(elapsed * 1e9))
        np.testing.assert_allclose(left[0], now.position, atol=1e-9)
        np.testing.assert_allclose(left[-1], along.stop_point, atol=1e-12)
        assert arc_lengths(left)[-1] == pytest.approx(along.motion.end - now.arc_length, abs=1e-9)


@pytest.mark.parametrize("points", [1, 2, 9])
@pytest.mark.parametrize("speed_cap", [0.0, 0.3, 1.5])
def test_the_time_along_a_path_is_that_of_its_trajectory(points, speed_cap):
    rng = np.random.default_rng(points)
    for _ in range(20):
        path = np.cumsum(rng.normal(0.0, 0.3, (points, 3)), axis=0)
        state = PathState(0, float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.0, 1.5)), 0.2, 1.0)
        for options in ({}, {"reverse": True}, {"sideways_speed": 0.4}):
            trajectory = follow_path(path, state, DRONE, speed_cap, **options)
            assert time_along(path, state, DRONE, speed_cap, **options) == trajectory.duration_s
