"""Work between two physics steps: compiled, interpreted, and by the formulas."""

import copy
import math

import numpy as np
import pytest

from tests.models.interpreting import interpret_kernels
from wayproof.models import step_kernels
from wayproof.models.poses import rotation_matrices
from wayproof.models.robots import Setpoint
from wayproof.models.step_kernels import StepArrays, StepCheck, command, filter_error


@pytest.fixture(params=["compiled", "interpreted"])
def between(request, monkeypatch):
    """The kernels, all of one kind."""
    if request.param == "interpreted":
        interpret_kernels(monkeypatch, "wayproof.models.step_kernels")
    return step_kernels


def heading_quaternion(angle):
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def draw_inputs(rng):
    """Arguments of a check and its arrays, the base inside its limits more often than not."""
    is_robot = rng.uniform(size=6) < 0.5
    is_obstacle = ~is_robot & (rng.uniform(size=6) < 0.6)
    pairs = rng.integers(0, 6, (int(rng.integers(0, 4)), 4)).astype(np.int32)[:, ::2]
    limits = np.array([-2.0, -2.0, -2.0, 2.0, 2.0, 2.0, -0.5])
    position, rotation = rng.normal(size=3), rng.uniform(-1.0, 1.0, 9)
    if rng.uniform() < 0.1:
        position[rng.integers(3)] = math.nan
    planned, commanded = rng.normal(size=(4, 8)), np.full((4, 8), math.nan)
    arrays = StepArrays(
        is_robot=is_robot,
        is_obstacle=is_obstacle,
        position=position,
        rotation=rotation,
        limits=limits,
        places=np.zeros((3, 3)),
        error=rng.normal(size=4),
        filtered=rng.normal(size=(2, 4)),
        pose=rng.normal(size=7),
        timestep=0.002,
    )
    return (pairs, int(rng.integers(9)), int(rng.integers(5)), planned, commanded), arrays


def naive(pairs, step, row, planned, commanded, arrays):
    """The same in plain floats, written from the formulas."""
    is_robot, is_obstacle, position, rotation, limits, places, error, tracked, pose, timestep = (
        arrays
    )
    places[step % 3] = position
    filtered, rates = tracked.tolist()
    for i in range(4):
        rates[i] += timestep * (10.0 * (10.0 * (error[i] - filtered[i]) - 2.0 * rates[i]))
        filtered[i] += timestep * rates[i]
    tracked[:] = filtered, rates
    if row < 4:
        x, y, z, vx, vy, vz, heading, rate = planned[row].tolist()
        c, s = math.cos(filtered[3]), math.sin(filtered[3])
        to_x, to_y = x - pose[0] - filtered[0], y - pose[1] - filtered[1]
        commanded[row] = [
            x - filtered[0] - ((1.0 - c) * to_x - s * to_y),
            y - filtered[1] - (s * to_x + (1.0 - c) * to_y),
            z - filtered[2],
            *(c * vx + s * vy, c * vy - s * vx, vz, heading - filtered[3], rate),
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
        arguments, arrays = draw_inputs(rng)
        again, copies = copy.deepcopy((arguments, arrays))
        result = StepCheck(arrays)(*arguments)
        assert result == naive(*again, copies)
        for array, expected in zip((*arguments, *arrays), (*again, *copies), strict=True):
            np.testing.assert_array_equal(array, expected)
        seen.add((result[0] >= 0, result[1]))
    assert len(seen) == 4


def test_the_setpoint_commands_at_the_true_pose_what_the_plan_does_at_the_estimated_one():
    """Offset and velocity in the body's axes are those that the estimated pose would give."""
    error = np.array([0.4, -0.3, 0.1, 0.5])
    position, heading = np.array([2.0, 1.0, 1.5]), 0.7
    estimated, estimated_heading = position + error[:3], heading + error[3]
    planned = Setpoint((3.0, 2.0, 1.0), (1.0, 0.5, 0.2), 1.0, 0.3)
    setpoint = Setpoint.of(np.empty(8))
    command(
        planned.row, error, np.concatenate([position, heading_quaternion(heading)]), setpoint.row
    )
    true_axes = rotation_matrices(heading_quaternion(heading)[None])[0].T
    estimated_axes = rotation_matrices(heading_quaternion(estimated_heading)[None])[0].T
    np.testing.assert_allclose(
        true_axes @ (setpoint.position - position),
        estimated_axes @ (planned.position - estimated),
        atol=1e-12,
    )
    np.testing.assert_allclose(
        true_axes @ setpoint.velocity, estimated_axes @ planned.velocity, atol=1e-12
    )
    assert setpoint.heading - heading == pytest.approx(planned.heading - estimated_heading)
    assert setpoint.yaw_rate == 0.3


def test_without_error_the_setpoint_is_the_plans_own_bit_by_bit():
    planned, commanded = Setpoint((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.7, 0.8), np.empty(8)
    command(planned.row, np.zeros(4), np.array([5.1, -3.3, 0.0, 1.0, 0.0, 0.0, 0.0]), commanded)
    assert commanded.tobytes() == planned.row.tobytes()


def test_the_controller_feels_a_step_of_the_error_without_a_kink():
    """The step response of a critically damped filter: 1 - (1 + w t) exp(-w t)."""
    error, tracked, filtered = np.array([1.0, 0.0, 0.0, 0.5]), np.zeros((2, 4)), []
    for _ in range(500):
        filter_error(error, tracked, 0.002)
        filtered.append(tracked[0].copy())
    wt = 10.0 * 0.002 * np.arange(1, 501)
    expected = 1.0 - (1.0 + wt) * np.exp(-wt)
    np.testing.assert_allclose(np.array(filtered)[:, 0], expected, atol=0.02)
    np.testing.assert_allclose(np.array(filtered)[:, 3], 0.5 * expected, atol=0.01)
    assert not np.array(filtered)[:, 1:3].any()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("off", "outside"), [(0.0, False), (1e-9, True), (math.nan, True)])
def test_the_limits_themselves_are_inside(between, axis, off, outside):
    limits = np.array([-1.0, -2.0, -3.0, 1.0, 2.0, 3.0, 0.5])
    upright = np.array([0.0] * 8 + [0.6])
    for sign in (-1.0, 1.0):
        position = np.zeros(3)
        position[axis] = sign * (limits[3 + axis] + off)
        assert between._outside(position, upright, limits) is outside
    for lowest, leaves in ((0.6, True), (math.nan, True), (0.59, False)):
        limits[6] = lowest  # a tilt at the limit is a fall
        assert between._outside(np.zeros(3), upright, limits) is leaves
