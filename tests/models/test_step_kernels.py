"""What happens between two physics steps: compiled, interpreted, and by the formulas."""

import math

import numpy as np
import pytest

from wayproof.models import step_kernels
from wayproof.models.poses import rotation_matrices
from wayproof.models.robots import Setpoint
from wayproof.models.step_kernels import ask, smooth

KERNELS = "look_and_ask", "ask", "smooth", "touched", "_outside"


@pytest.fixture(params=["compiled", "interpreted"])
def between(request, monkeypatch):
    """The kernels, all of one kind."""
    if request.param == "interpreted":
        for name in KERNELS:
            monkeypatch.setattr(step_kernels, name, getattr(step_kernels, name).py_func)
    return step_kernels


def heading_quaternion(angle):
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def draw_inputs(rng):
    """Arguments of `look_and_ask`, the base inside its limits more often than not."""
    is_robot = rng.uniform(size=6) < 0.5
    is_obstacle = ~is_robot & (rng.uniform(size=6) < 0.6)
    pairs = rng.integers(0, 6, (int(rng.integers(0, 4)), 4)).astype(np.int32)[:, ::2]
    limits = np.array([-2.0, -2.0, -2.0, 2.0, 2.0, 2.0, -0.5])
    position, rotation = rng.normal(size=3), rng.uniform(-1.0, 1.0, 9)
    if rng.uniform() < 0.1:
        position[rng.integers(3)] = math.nan
    planned, asked = rng.normal(size=(4, 8)), np.full((4, 8), math.nan)
    places, error = np.zeros((3, 3)), rng.normal(size=4)
    return [
        *(pairs, int(rng.integers(9)), int(rng.integers(5)), planned, asked, is_robot, is_obstacle),
        *(position, rotation, limits, places, error, rng.normal(size=(2, 4)), 0.002),
        rng.normal(size=7),
    ]


def naive(pairs, step, row, planned, asked, is_robot, is_obstacle, *rest):
    """The same in plain floats, written from the formulas."""
    position, rotation, limits, places, error, tracked, timestep, pose = rest
    places[step % 3] = position
    felt, rates = tracked.tolist()
    for i in range(4):
        rates[i] += timestep * (10.0 * (10.0 * (error[i] - felt[i]) - 2.0 * rates[i]))
        felt[i] += timestep * rates[i]
    tracked[:] = felt, rates
    if row < 4:
        x, y, z, vx, vy, vz, heading, rate = planned[row].tolist()
        c, s = math.cos(felt[3]), math.sin(felt[3])
        to_x, to_y = x - pose[0] - felt[0], y - pose[1] - felt[1]
        asked[row] = [
            x - felt[0] - ((1.0 - c) * to_x - s * to_y),
            y - felt[1] - (s * to_x + (1.0 - c) * to_y),
            z - felt[2],
            *(c * vx + s * vy, c * vy - s * vx, vz, heading - felt[3], rate),
        ]
    met = -1
    for a, b in pairs[::-1].tolist():
        hit = [g for g, other in ((b, a), (a, b)) if is_obstacle[g] and is_robot[other]]
        met = hit[0] if hit else met
    inside = all(limits[i] <= position[i] <= limits[3 + i] for i in range(3))
    return met, not (inside and rotation[8] > limits[6])


def test_all_of_it_is_what_the_formulas_say_bit_by_bit(between):
    rng, seen = np.random.default_rng(0), set()
    for _ in range(300):
        given = draw_inputs(rng)
        again = [np.array(part) if isinstance(part, np.ndarray) else part for part in given]
        told = between.look_and_ask(*given)
        assert told == naive(*again)
        for one, other in zip(given, again, strict=True):
            np.testing.assert_array_equal(one, other)
        seen.add((told[0] >= 0, told[1]))
    assert len(seen) == 4


def test_the_setpoint_asks_of_the_true_pose_what_the_plan_asks_of_the_believed_one():
    """The offset and the velocity in the body's own axes are those that a believer would see."""
    error = np.array([0.4, -0.3, 0.1, 0.5])
    position, heading = np.array([2.0, 1.0, 1.5]), 0.7
    believed, believed_heading = position + error[:3], heading + error[3]
    planned = Setpoint((3.0, 2.0, 1.0), (1.0, 0.5, 0.2), 1.0, 0.3)
    setpoint = Setpoint.of(np.empty(8))
    ask(planned.row, error, np.concatenate([position, heading_quaternion(heading)]), setpoint.row)
    true_axes = rotation_matrices(heading_quaternion(heading)[None])[0].T
    believed_axes = rotation_matrices(heading_quaternion(believed_heading)[None])[0].T
    np.testing.assert_allclose(
        true_axes @ (setpoint.position - position),
        believed_axes @ (planned.position - believed),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        true_axes @ setpoint.velocity, believed_axes @ planned.velocity, atol=1e-12
    )
    assert setpoint.heading - heading == pytest.approx(planned.heading - believed_heading)
    assert setpoint.yaw_rate == 0.3


def test_without_error_the_setpoint_is_the_plans_own_bit_by_bit():
    planned, asked = Setpoint((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7, 0.8), np.empty(8)
    ask(planned.row, np.zeros(4), np.array([5.1, -3.3, 0.0, 1.0, 0.0, 0.0, 0.0]), asked)
    assert asked.tobytes() == planned.row.tobytes()


def test_the_controller_feels_a_step_of_the_error_without_a_kink():
    """The step response of a critically damped filter: 1 - (1 + w t) exp(-w t)."""
    error, tracked, felt = np.array([1.0, 0.0, 0.0, 0.5]), np.zeros((2, 4)), []
    for _ in range(500):
        smooth(error, tracked, 0.002)
        felt.append(tracked[0].copy())
    wt = 10.0 * 0.002 * np.arange(1, 501)
    expected = 1.0 - (1.0 + wt) * np.exp(-wt)
    np.testing.assert_allclose(np.array(felt)[:, 0], expected, atol=0.02)
    np.testing.assert_allclose(np.array(felt)[:, 3], 0.5 * expected, atol=0.01)
    assert not np.array(felt)[:, 1:3].any()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("off", "outside"), [(0.0, False), (1e-9, True), (math.nan, True)])
def test_the_limits_themselves_are_inside(between, axis, off, outside):
    limits = np.array([-1.0, -2.0, -3.0, 1.0, 2.0, 3.0, 0.5])
    upright = np.array([0.0] * 8 + [0.6])
    for sign in (-1.0, 1.0):
        position = np.zeros(3)
        position[axis] = sign * (limits[3 + axis] + off)
        assert between._outside(position, upright, limits) is outside
    for least, leaves in ((0.6, True), (math.nan, True), (0.59, False)):
        limits[6] = least  # a tilt at the limit is a fall
        assert between._outside(np.zeros(3), upright, limits) is leaves
