"""Trajectories of commands: within the limits, at rest in the end, or refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.interface.limits import joins
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.motion_checks import MotionError
from wayproof.harness.interface.types import Reference, Samples, Velocity, Waypoints
from wayproof.planners import MotionLimits, PathState, Trajectory, follow_path, hold
from wayproof.planners.jerk_limited import Profile, at_rest, ramped

LIMITS = MotionLimits(1.0, 2.0, 10.0, 2.0, 1.0)
EFFECT_NS = 50_000_000
HERE = Reference(np.array([1.0, 2.0, 0.5]), np.zeros(3), 0.0, 0.0, at_rest=True)


def made(motion, reference=HERE, planar=True):
    return followed(motion, reference, planar).trajectory


def followed(motion, reference=HERE, planar=True):
    return trajectory_of(motion, (reference, reference), EFFECT_NS, LIMITS, planar=planar)


def test_a_velocity_is_held_for_its_time_and_then_braked():
    """1 m/s at 2 m/s^2: 0.25 m to get there, 0.5 m in the second half, 0.25 m to brake."""
    trajectory = made(Velocity(1.0, duration_s=1.0))
    assert trajectory.start_ns == EFFECT_NS
    assert trajectory.duration_s == pytest.approx(1.5, abs=0.011)
    assert trajectory.stop_point == pytest.approx([2.0, 2.0, 0.5], abs=0.011)


AHEAD = Waypoints(HERE.position + np.array([[3.0, 0.0, 0.0]]), 3.0)


@pytest.mark.parametrize(
    ("motion", "speed", "rate", "limited"),
    [
        (Velocity(1.0, yaw_rate=-1.0, duration_s=1.5), 1.0, 1.0, False),
        (Velocity(9.0, yaw_rate=9.0, duration_s=1.5), 1.0, 1.0, True),
        (Velocity(0.8, -0.8, duration_s=1.5), 1.0, 0.0, True),  # 1.13 m/s aslant
        (Velocity(-0.8, up=0.8, duration_s=1.5), 1.0, 0.0, True),
        (Velocity(0.0, yaw_rate=-1.1, duration_s=1.5), 0.0, 1.0, True),
        (AHEAD, 1.0, 0.0, False),  # in its own time, whatever speed it is asked for
    ],
)
def test_no_motion_is_faster_than_the_body_and_what_asks_for_more_is_limited(
    motion, speed, rate, limited
):
    """The body: 1 m/s and 1 rad/s."""
    trajectory, was_limited = followed(motion, planar=False)
    times_ns = EFFECT_NS + np.arange(0, round(trajectory.duration_s * 1e9), 10_000_000)
    setpoints = trajectory.setpoints(times_ns)
    speeds = np.linalg.norm(np.diff(setpoints.positions, axis=0), axis=1) / 0.01
    assert speeds.max() == pytest.approx(speed, abs=0.01)
    assert np.abs(np.diff(setpoints.headings)).max() / 0.01 == pytest.approx(rate, abs=0.01)
    assert was_limited == limited


def test_a_velocity_is_of_the_body():
    """To the left of the world's x axis, where it faces."""
    turned = Reference(HERE.position, np.zeros(3), math.pi / 2, 0.0, at_rest=True)
    x, y, _ = made(Velocity(1.0), turned).stop_point - HERE.position
    assert (x, y > 0.2) == (pytest.approx(0.0, abs=1e-6), True)


def test_a_walking_body_ignores_heights_and_a_flying_one_does_not():
    assert made(Velocity(0.0, up=1.0)).stop_point[2] == 0.5
    assert made(Velocity(0.0, up=1.0), planar=False).stop_point[2] > 0.7


def braking(direction):
    """Samples at 1 m/s for half a second, then braked at 2 m/s^2, along a direction."""
    arcs = 0.1 * np.cumsum([0.0, *[1.0] * 5, 0.8, 0.6, 0.4, 0.2])
    return Samples(0.1, HERE.position + np.outer(arcs, direction), np.zeros(len(arcs)))


@pytest.mark.parametrize("direction", [(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_a_body_that_is_commanded_back_or_aside_at_once_goes_on_ahead_first(direction):
    """From 1 m/s at 2 m/s^2 it rolls on for 0.25 m along x."""
    moving = replace(HERE, velocity=np.array([1.0, 0.0, 0.0]), at_rest=False)
    found = followed(braking(direction), moving)
    assert found.limited
    assert found.trajectory.path[:, 0].max() == pytest.approx(1.25, abs=0.12)
    assert not followed(braking((1.0, 0.0, 0.0)), moving).limited


def test_a_corner_after_ten_seconds_counts_as_well():
    """It stands for 12 s, speeds up to 1 m/s at 2 m/s^2, and is commanded back at once."""
    speeds = np.array([0.0] * 120 + [0.2, 0.4, 0.6, 0.8] + [1.0] * 10)
    back = -np.array([1.0] * 5 + [0.8, 0.6, 0.4, 0.2])
    ahead = 0.1 * np.cumsum(np.concatenate([[0.0], speeds]))
    whole = 0.1 * np.cumsum(np.concatenate([[0.0], speeds, back]))
    for arcs, expected in ((ahead[:-9], False), (whole, True)):
        if not expected:
            arcs = np.append(arcs, arcs[-1] + 0.1 * np.cumsum([0.8, 0.6, 0.4, 0.2]))
        positions = HERE.position + np.outer(arcs, (1.0, 0.0, 0.0))
        assert followed(Samples(0.1, positions, np.zeros(len(arcs)))).limited == expected


@pytest.mark.parametrize("turn", [math.pi / 2, -3.0, 2.0 * math.pi - 1.0])
def test_a_first_heading_that_the_body_does_not_have_is_turned_into(turn):
    heading = 0.4 + turn
    still = Samples(0.1, np.tile(HERE.position, (4, 1)), np.full(4, heading))
    found = followed(still, replace(HERE, heading=0.4))
    assert found.limited
    headings = found.trajectory.turning.positions(np.arange(0.0, 9.0, 0.01))
    assert headings[0] == pytest.approx(0.4)
    assert np.abs(np.diff(headings)).max() <= 0.01 * LIMITS.yaw_rate + 1e-9
    shorter = (turn + math.pi) % (2.0 * math.pi) - math.pi
    assert np.sign(headings[-1] - 0.4) == np.sign(shorter)
    assert 0.75 * abs(shorter) < abs(headings[-1] - 0.4) <= abs(shorter) + 1e-6
    assert not followed(
        replace(still, headings=np.full(4, 0.5)), replace(HERE, heading=0.4)
    ).limited
    full_turn = replace(still, headings=np.full(4, 0.4 + 2.0 * math.pi))
    assert not followed(full_turn, replace(HERE, heading=0.4)).limited


def test_a_trajectory_that_goes_back_along_its_path_is_refused():
    """Only what lies between its first and its last arc length is swept."""
    path = HERE.position + np.outer([0.0, 1.0], (1.0, 0.0, 0.0))
    smooth = 3.0 * np.linspace(0, 1, 31) ** 2 - 2.0 * np.linspace(0, 1, 31) ** 3
    ahead = Trajectory(EFFECT_NS, path, ramped(smooth, 0.1), at_rest(0.0))
    assert not followed(ahead).limited
    there_and_back = replace(ahead, motion=ramped(np.append(smooth, smooth[-2::-1]), 0.1))
    with pytest.raises(
        MotionError, match=r"arc length of 0\.00 m after 1\.00 m, expected one that"
    ):
        followed(there_and_back)
    at_end = replace(HERE, position=path[1])
    with pytest.raises(MotionError, match="expected one that rises from 0 on"):
        followed(replace(ahead, motion=ramped(1.0 - smooth, 0.1)), at_end)


def test_waypoints_end_at_rest_at_the_last_one_or_before_a_sharp_corner():
    straight = made(Waypoints(np.array([[2.0, 2.0, 9.0], [3.0, 2.0, 9.0]])))
    assert straight.stop_point == pytest.approx([3.0, 2.0, 0.5], abs=1e-6)
    corner = made(Waypoints(np.array([[2.0, 2.0, 0.5], [2.0, 3.0, 0.5]])))
    assert corner.stop_point == pytest.approx([2.0, 2.0, 0.5], abs=1e-6)
    behind = made(Waypoints(np.array([[0.0, 2.0, 0.5]])))  # it turns first
    assert behind.stop_point == pytest.approx(HERE.position)
    assert abs(behind.turning.end) == pytest.approx(math.pi)


def test_waypoints_that_are_sent_again_and_again_turn_as_those_sent_once():
    """Each command takes effect 0.1 s after the last, where that has the body by then."""
    behind, reference = Waypoints(np.array([[0.0, 2.0, 0.5]])), HERE
    for _ in range(20):
        then = followed(behind, reference).trajectory.at(EFFECT_NS + 100_000_000)
        reference = replace(reference, heading=then.heading, yaw_rate=then.yaw_rate)
    once = made(behind).at(EFFECT_NS + 2_000_000_000)
    assert abs(reference.heading) > 0.5 * abs(once.heading)  # its acceleration begins anew


def timed(path, reference, **timing):
    motion = Waypoints(HERE.position + np.array(path))
    return trajectory_of(
        motion, (reference, reference), EFFECT_NS, LIMITS, planar=False, **timing
    ).trajectory


def test_waypoints_go_on_with_the_part_of_an_acceleration_that_points_along_them():
    moving = replace(HERE, velocity=np.array([0.4, 0.0, 0.0]), at_rest=False)
    ahead, aside = [[3.0, 0.0, 0.0]], [[3.0, 4.0, 0.0]]
    for path, share in ((ahead, 1.0), (aside, 0.6)):
        now = timed(path, moving, acceleration=1.5).at(EFFECT_NS)
        assert now.acceleration == pytest.approx(share * 1.5)
        assert now.speed == pytest.approx(share * 0.4)
        assert timed(path, moving).at(EFFECT_NS).acceleration == 0.0
    assert timed(ahead, HERE, acceleration=1.5).at(EFFECT_NS).acceleration == 0.0


def test_a_body_that_need_not_face_along_its_waypoints_takes_their_bends_faster():
    """An arc of 0.4 m radius: 0.4 m/s by the yaw rate, 0.89 m/s by the lateral acceleration."""
    angles = np.linspace(0.0, 3.0, 61)[1:, None]
    arc = 0.4 * np.hstack([np.sin(angles), 1.0 - np.cos(angles), 0.0 * angles])
    durations = [timed(arc, HERE, sideways_speed=speed).motion.duration for speed in (0.0, 1.0)]
    assert durations[0] > 1.4 * durations[1]


STEPS = np.arange(31)[:, None] * np.array([0.1, 0.0, 0.0])
"""1 m/s in the x axis for 3 s."""

MOVING = Reference(HERE.position, np.array([1.0, 0.0, 0.0]), 0.0, 0.0, at_rest=False)


def test_samples_beyond_the_greatest_speed_are_followed_at_it():
    trajectory, limited = followed(Samples(0.1, HERE.position + 2.0 * STEPS, np.zeros(31)))
    assert limited
    speeds = np.diff(trajectory.motion.positions(np.arange(0.0, 4.0, 0.01))) / 0.01
    assert speeds.max() == pytest.approx(1.0, abs=0.01)
    assert np.diff(speeds).max() < 2.0 * 0.01 + 1e-6
    # 0.25 m to get to 1 m/s in 0.5 s, 2.5 m until its time is over, 0.25 m to brake
    assert trajectory.stop_point[0] - HERE.position[0] == pytest.approx(3.0, abs=0.02)


def test_a_stop_that_no_body_can_make_is_judged_where_the_body_comes_to_rest():
    """0.1 m at 1 m/s and a dead stop: the body takes 0.25 m to brake at 2 m/s^2."""
    dead = Samples(0.1, HERE.position + STEPS[:2], np.zeros(2))
    trajectory, limited = followed(dead, MOVING)
    assert limited
    assert trajectory.stop_point[0] - HERE.position[0] == pytest.approx(0.35, abs=0.03)
    possible = HERE.position + np.outer([0.0, 0.09, 0.16, 0.21, 0.24, 0.25], [1.0, 0.0, 0.0])
    assert not followed(Samples(0.1, possible, np.zeros(6)), MOVING).limited


def test_waypoints_behind_a_moving_body_begin_with_its_braking():
    """From 1 m/s at 2 m/s^2 it rolls on for 0.25 m; its speed never jumps."""
    trajectory, limited = followed(Waypoints(HERE.position - np.array([[1.0, 0.0, 0.0]])), MOVING)
    assert limited
    assert trajectory.path[:, 0].max() == pytest.approx(HERE.position[0] + 0.25, abs=0.03)
    times_ns = EFFECT_NS + np.arange(0, round(trajectory.duration_s * 1e9), 10_000_000)
    steps = np.diff(trajectory.setpoints(times_ns).positions[:, 0]) / 0.01
    assert steps[0] == pytest.approx(1.0, abs=0.03)
    assert np.abs(np.diff(steps)).max() <= 2.0 * 0.01 * 1.05
    assert trajectory.stop_point[0] < HERE.position[0] - 0.7  # it lags, and is then braked


def test_a_velocity_begins_at_the_reference_wherever_the_body_believes_to_be():
    believed = replace(HERE, position=HERE.position + 0.3)
    motion = Velocity(0.5)
    given = trajectory_of(motion, (HERE, believed), EFFECT_NS, LIMITS, planar=True).trajectory
    assert given.path[0].tolist() == HERE.position.tolist()


def test_headings_that_turn_too_fast_are_followed_at_the_greatest_yaw_rate():
    turning = Samples(0.1, np.tile(HERE.position, (11, 1)), np.linspace(0.0, 3.0, 11))
    trajectory, limited = followed(turning)
    assert limited
    rates = np.diff(trajectory.turning.positions(np.arange(0.0, 2.0, 0.01))) / 0.01
    assert rates.max() == pytest.approx(1.0, abs=0.01)
    assert len(trajectory.path) == 1


def profiled(start_ns=EFFECT_NS, path=HERE.position[None], **parts):
    still = {"motion": at_rest(0.0), "turning": at_rest(0.0)}
    return Trajectory(start_ns, np.array(path), **(still | parts))


PIECE = np.zeros(1), np.zeros((1, 3)), np.zeros(1)
FAR = HERE.position + np.array([[0.0, 0.0, 0.0], [2000.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        (Velocity(math.inf), "velocity: got .*, expected finite numbers"),
        (Velocity(1.0, duration_s=11.0), "duration_s: got 11, expected 0 to 10 s"),
        (Velocity(1.0, duration_s=math.nan), "duration_s: got nan"),
        (Waypoints(np.array([[math.nan, 0.0, 0.0]])), "expected finite coordinates"),
        (Waypoints(np.zeros((0, 3))), r"got shape \(0, 3\)"),
        (Waypoints(FAR), "got a path of 2000 m, expected 1000 m"),
        (Waypoints(FAR[:1] + 900.0, 1.001), "got a path of 1273 m, expected 1000 m"),
        (
            Waypoints(0.75 * FAR[:1] + 0.25 * FAR[1:], 0.03),
            "comes to rest after .* s, expected at most 600 s",
        ),
        (Waypoints(FAR[:1], -1.0), "speed: got -1.0, expected 0 or more"),
        (Samples(0.1, FAR[:1] + 1.0, np.zeros(1)), "starts 1.41 m from where the robot is then"),
        (Samples(0.1, FAR[:1], np.array([1e9])), "each within 10000 rad"),
        (Samples(0.1, FAR[:1], np.zeros(2)), r"got shape \(2,\), expected \(1,\)"),
        (Samples(10.0, FAR[[0] * 99], np.linspace(0.0, 1.0, 99)), "expected at most 600 s"),
        (Samples(0.0, FAR[:1], np.zeros(1)), "period_s: got 0, expected 0.001 to 10 s"),
        (profiled(EFFECT_NS + 1), "start_ns: got 50000001, expected 0 to 50000000"),
        (profiled(-1), "start_ns: got -1"),
        (profiled(turning=at_rest(1e9)), "numbers beyond 10000"),
        (profiled(motion=Profile(*PIECE, math.nan, 0.0)), "numbers beyond 10000"),
        (profiled(motion=Profile(PIECE[0] + 1.0, *PIECE[1:], 2.0, 0.0)), "expected times from 0"),
        (profiled(motion=Profile(PIECE[0], np.zeros((2, 3)), PIECE[2], 1.0, 0.0)), "are unequal"),
        (hold(HERE.position + 1.0, 0, 0.0), "starts 1.41 m from where the robot is then"),
    ],
)
def test_a_motion_that_no_body_can_follow_is_one_line(motion, text):
    with pytest.raises(MotionError, match=text) as error:
        made(motion)
    assert "\n" not in str(error.value)


def test_a_trajectory_joins_the_one_before_by_the_speed_that_the_audit_measures():
    """Little at once and much in the next 0.1 s, as of samples that creep: 0.01, then 0.04 m."""
    before = follow_path(
        HERE.position + np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
        PathState(EFFECT_NS, 0.0, 0.3, 0.0, 0.0, 0.0),
        LIMITS,
        0.3,
    )
    moving = replace(HERE, velocity=np.array([0.3, 0.0, 0.0]), at_rest=False)
    for speeds, joined in (((0.3, 0.1, 0.0), True), ((0.02, 0.02, 0.0), False)):
        arcs = 0.1 * np.cumsum([0.0, *speeds])
        samples = Samples(0.1, HERE.position + np.outer(arcs, [1.0, 0.0, 0.0]), np.zeros(4))
        result = trajectory_of(
            samples, (moving, moving), EFFECT_NS, LIMITS, planar=True, followed=before
        )
        assert result.limited != joined
        assert joins(result.trajectory, before, EFFECT_NS, LIMITS, planar=True)
    late = replace(before, start_ns=before.start_ns - 1)
    assert not joins(late, before, EFFECT_NS, LIMITS, planar=True)
