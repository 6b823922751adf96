"""Jerk-limited motion along a path, through zones of speed; bodies that turn into it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.planners.motions import DRONE, LIMITS, LINE, MS, sampled
from wayproof.planners import (
    MotionLimits,
    PathState,
    Trajectory,
    arc_lengths,
    follow_path,
    jerk_limited,
    speed_limits,
    speed_zones,
    stop_along,
)
from wayproof.planners.jerk_limited import AxisLimits, State


def test_lengths_of_changes_of_speed_are_those_of_the_changes():
    rng = np.random.default_rng(3)
    for _ in range(40):
        limits = jerk_limited.AxisLimits(*rng.uniform(0.5, 9.0, 2))
        start = jerk_limited.State(*rng.uniform((-5.0, 0.0, -2.0), (5.0, 3.0, 2.0)))
        length = jerk_limited.change_lengths(start, limits)
        for velocity in rng.uniform(0.0, 3.0, 8):
            end = jerk_limited.change_speed(start, velocity, limits).end
            assert length(velocity) == end.position - start.position


@pytest.mark.parametrize(
    ("start", "target", "speed", "limits", "text"),
    [
        (
            (0.0, 0.0, 0.0),
            (1.0, 5.0, 0.0),
            1.0,
            (2.0, 3.0),
            "motion: got position 0.0, velocity 0.0, acceleration 0.0 to position 1.0, velocity "
            "5.0, expected a motion within velocity 1.0, acceleration 2.0, jerk 3.0; ruckig: "
            "target velocity 5.000000 of DoF 0 exceeds its maximum velocity limit 1.000000.",
        ),
        (
            (0.25, math.nan, 0.0),
            (0.0, 1.0, 0.0),
            None,
            (2.0, 3.0),
            "motion: got position 0.25, velocity nan, acceleration 0.0 to velocity 1.0, expected "
            "a motion within acceleration 2.0, jerk 3.0; ruckig: current velocity nan of DoF 0 "
            "should be a valid number.",
        ),
    ],
)
def test_a_motion_that_ruckig_refuses_is_named_in_one_line(start, target, speed, limits, text):
    ends = jerk_limited.State(*start), jerk_limited.State(*target)
    with pytest.raises(RuntimeError) as raised:
        jerk_limited.solve(*ends, speed, jerk_limited.AxisLimits(*limits))
    assert str(raised.value) == text


def test_compiled_speeds_of_a_body_that_turns_late_equal_python():
    rng = np.random.default_rng(5)
    arcs = np.cumsum(rng.uniform(0.0, 0.1, 90))
    turns, allowed, speeds = (rng.uniform(0.0, most, n) for most, n in ((1, 88), (2, 90), (2, 90)))
    slowed, again = speeds.copy(), speeds.copy()
    speed_zones.slow_while_behind(arcs, turns, allowed, 9.0, 0.5, slowed)
    speed_zones.slow_while_behind.py_func(arcs, turns, allowed, 9.0, 0.5, again)
    assert np.array_equal(slowed, again)
    assert 0 < np.count_nonzero(slowed < speeds) < 80


@pytest.mark.parametrize("interpreted", [False, True])
def test_zones_and_ramps_are_what_numpy_makes_of_them(interpreted, monkeypatch):
    if interpreted:
        monkeypatch.setattr(speed_zones, "cut_zones", speed_zones.cut_zones.py_func)
        monkeypatch.setattr(jerk_limited, "list_ramps", jerk_limited.list_ramps.py_func)
    rng, cut = np.random.default_rng(1), 0
    for number in range(60):
        path = np.cumsum(rng.normal(0.0, 0.3, (1 + number % 9, 3)), axis=0)
        arcs = arc_lengths(path)
        allowed = speed_limits(path, DRONE.lateral_acceleration, DRONE.yaw_rate)
        for s in (0.0, 0.4 * arcs[-1], arcs[-1]):
            slow = allowed < 1.2
            changes = np.flatnonzero(slow[1:] != slow[:-1])
            borders = [0.0, *(0.5 * (arcs[changes] + arcs[changes + 1])), arcs[-1]]
            runs = np.split(
                np.maximum(np.minimum(allowed, 1.2), speed_zones.LEAST_SPEED), changes + 1
            )
            expected = [
                (end - max(begin, s), run.min())
                for begin, end, run in zip(borders[:-1], borders[1:], runs, strict=True)
                if end - max(begin, s) > speed_zones.LEAST_ZONE
            ]
            zones = speed_zones.speed_zones(path, float(s), 1.2, DRONE)
            assert list(map(tuple, zones)) == expected
            cut += len(zones) > 1
        headings = np.round(rng.normal(size=1 + number), 1 - number % 2)
        rates = np.diff(headings) / 0.01
        begins = np.flatnonzero(np.diff(rates, prepend=np.nan) != 0.0)
        ramps = jerk_limited.ramped(headings, 0.01)
        np.testing.assert_array_equal(ramps.times, 0.01 * begins)
        np.testing.assert_array_equal(ramps.states[:, 0], headings[begins])
        np.testing.assert_array_equal(ramps.states[:, 1], rates[begins])
        assert not ramps.states[:, 2].any()
        assert not ramps.jerks.any()
        assert (ramps.duration, ramps.end) == (0.01 * number, headings[-1])
    assert cut > 20


def test_the_first_length_of_zones_is_slowed():
    zones = [speed_zones.SpeedZone(1.0, 0.8), speed_zones.SpeedZone(2.0, 0.2)]
    slowed = speed_zones.slow_at_first(zones, 1.5, 0.3)
    assert slowed == [(1.0, 0.3), (0.5, 0.2), (1.5, 0.2)]
    assert speed_zones.slow_at_first(zones, 0.0, 0.3) == zones


def test_what_is_beyond_a_length_of_zones_is_slowed():
    zones = [speed_zones.SpeedZone(1.0, 0.8), speed_zones.SpeedZone(2.0, 0.2)]
    slowed = speed_zones.slow_at_end(zones, 0.4, 0.3)
    assert slowed == [(0.4, 0.8), (0.6, 0.3), (2.0, 0.2)]
    assert speed_zones.slow_at_end(zones, 3.0, 0.1) == zones
    assert speed_zones.slow_at_end(zones, -1.0, 0.5) == [(1.0, 0.5), (2.0, 0.2)]
    assert speed_zones.slow_at_end(zones, 1.0, 0.0) == [(1.0, 0.8), (2.0, 0.02)]


def test_a_motion_goes_on_from_where_rounding_leaves_a_speed_below_zero():
    limits = MotionLimits(2.0, 4.0, 20.0, 2.5, 2.0)
    slowing = PathState(0, 0.0, 0.1000000000000001, -1.9999999999999996, 0.0)
    stop = stop_along(LINE, slowing, limits)
    last = stop.at(100 * MS)
    assert -1e-15 < last.speed < 0.0
    start = PathState(100 * MS, last.arc_length, last.speed, last.acceleration, 0.0)
    assert follow_path(LINE, start, limits, 1.0).at(300 * MS).speed > 0.0


def test_a_speed_that_is_only_just_reached_from_the_greatest_one_is_reached():
    """The only motion rises above its first speed by 3e-13 m/s, and ruckig alone finds none."""
    start, target = (
        State(5.763481294882441, 1.6355256796978215, 0.0),
        State(6.199733631339036, 0, 0),
    )
    target = target._replace(velocity=1.1422142052198012)
    leg = jerk_limited.solve(start, target, start.velocity, AxisLimits(4.0, 20.0))
    assert sum(leg.durations) == pytest.approx(
        2.0 * np.sqrt((1.63552568 - 1.14221421) / 20.0), abs=1e-5
    )
    assert leg.end.velocity == target.velocity
    assert max(state.velocity for state in leg.states) == pytest.approx(start.velocity, rel=1e-9)


def test_a_target_out_of_reach_is_refused_with_the_limit_that_was_given():
    start, target = State(0.0, 1.0, 0.0), State(0.1, 5.0, 0.0)
    with pytest.raises(RuntimeError, match=r"within velocity 1\.0, acceleration"):
        jerk_limited.solve(start, target, 1.0, AxisLimits(4.0, 20.0))


@pytest.mark.parametrize("turn", [0.3, 0.5, 0.9, 2.0, 3.1])
def test_a_body_that_turns_into_its_path_keeps_to_the_sideways_speed_across_itself(turn):
    zones = [speed_zones.SpeedZone(5.0, 1.5)]
    whole = speed_zones.slow_while_turning(zones, turn, 1.5, 0.35)
    parts = speed_zones.slow_while_turning(zones, turn, 1.5, 0.35, by_direction=True)
    for found in (whole, parts):
        assert sum(zone.length for zone in found) == pytest.approx(5.0)
    assert [zone.speed for zone in parts] == sorted(zone.speed for zone in parts)
    whole_s, parts_s = (sum(zone.length / zone.speed for zone in found) for found in (whole, parts))
    assert parts_s <= whole_s + 1e-9
    assert speed_zones.slow_while_turning(zones, 0.2, 1.5, 0.35, by_direction=True) == zones


def test_no_speed_of_a_turn_is_more_than_the_sideways_speed_across_the_body():
    begin = 0.5 * math.pi
    for above, share in speed_zones.OBLIQUE:
        assert 0.98 < share * math.sin(begin) <= 1.0
        begin = above


QUADRUPED = LIMITS[0]
SIDEWAYS = 0.3  # m/s


def heading_errors(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Angles between heading and motion, rad, and speeds, m/s, where it moves."""
    samples = sampled(trajectory)
    moves = samples["speed"] > 1e-3
    velocity, heading = samples["velocity"][moves], samples["heading"][moves]
    errors = np.arctan2(velocity[:, 1], velocity[:, 0]) - heading
    return np.abs((errors + np.pi) % (2 * np.pi) - np.pi), samples["speed"][moves]


@pytest.mark.parametrize("heading", [0.0, 0.2, 1.5, np.pi, -2.5])
def test_a_body_turns_while_it_moves_sideways_no_faster_than_it_can(heading):
    state = PathState(0, 0.0, 0.0, 0.0, heading)
    turning = follow_path(LINE, state, QUADRUPED, 9.0, sideways_speed=SIDEWAYS)
    errors, speeds = heading_errors(turning)
    assert speeds[errors > 0.3].max(initial=0.0) <= SIDEWAYS + 1e-6
    assert errors[-1] < 1e-6
    assert speeds.max() == pytest.approx(QUADRUPED.speed)
    assert turning.at(round(turning.duration_s * 1e9)).position == pytest.approx(LINE[-1])
    straight = follow_path(LINE, state, QUADRUPED, 9.0)
    slower = turning.duration_s - straight.duration_s
    assert slower == 0.0 if abs(heading) < 0.25 else slower > 0.2


def test_a_body_that_moves_at_full_speed_in_any_direction_is_slowed_by_no_turn():
    angles = np.linspace(0.0, np.pi, 60)
    arc = 2.0 * np.stack([np.sin(angles), 1.0 - np.cos(angles), np.zeros(60)], axis=1)
    slow = replace(DRONE, yaw_rate=0.25)  # rad/s: of 0.5 m/s on this arc
    state = PathState(0, 0.0, 0.0, 0.0, 2.0)
    turning = follow_path(arc, state, slow, 9.0)
    assert sampled(turning)["speed"].max() == pytest.approx(0.5, rel=0.02)
    ahead = follow_path(arc, state, slow, 9.0, sideways_speed=DRONE.speed)
    assert sampled(ahead)["speed"].max() == pytest.approx(DRONE.speed, rel=0.02)
    rates = np.diff(sampled(ahead)["heading"]) / 0.002
    assert np.abs(rates).max() <= 0.25 + 1e-6


def test_a_sharp_corner_is_taken_sideways_and_the_turn_is_made_good_behind_it():
    ahead = np.arange(0.0, 3.0, 0.05)
    still, up = np.zeros_like(ahead), np.ones_like(ahead)
    first, second = np.stack([ahead, still, up], 1), np.stack([still + 3.0, ahead, up], 1)
    path = np.concatenate([first, second])
    state = PathState(0, 0.0, 0.0, 0.0, 0.0)
    aside = follow_path(path, state, QUADRUPED, 9.0, sideways_speed=SIDEWAYS)
    errors, speeds = heading_errors(aside)
    assert errors.max() > 0.5
    assert speeds[errors > 0.3].max() <= SIDEWAYS + 1e-6
    assert speeds[errors > 0.3].min() > 0.1
    assert errors[-1] < 1e-6
