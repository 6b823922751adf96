import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import make_space, point
from wayproof.planners import (
    arc_lengths,
    blend_corners,
    first_stop,
    point_at,
    remaining,
    speed_limits,
    tangent_at,
    truncate,
    without_hooks,
)
from wayproof.planners.kernels import angles, blend, curvature, headed, polyline
from wayproof.planners.path import edge_lengths, edge_tangents

ELL = np.array([[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 4.0, 1.0]])


def test_an_ell_by_hand():
    assert arc_lengths(ELL).tolist() == [0.0, 3.0, 7.0]
    assert point_at(ELL, 5.0).tolist() == [3.0, 2.0, 1.0]
    assert point_at(ELL, -1.0).tolist() == ELL[0].tolist()
    assert point_at(ELL, 9.0).tolist() == ELL[2].tolist()
    assert tangent_at(ELL, 2.9).tolist() == [1.0, 0.0, 0.0]
    assert tangent_at(ELL, 3.0).tolist() == [0.0, 1.0, 0.0]
    assert tangent_at(ELL, 7.0).tolist() == [0.0, 1.0, 0.0]
    assert truncate(ELL, 5.0).tolist() == [[0, 0, 1], [3, 0, 1], [3, 2, 1]]
    assert truncate(ELL, 0.0).tolist() == [[0, 0, 1], [0, 0, 1]]
    assert remaining(ELL, 5.0).tolist() == [[3, 2, 1], [3, 4, 1]]
    assert remaining(ELL, 8.0).tolist() == [[3, 4, 1], [3, 4, 1]]


def test_paths_without_length_have_a_place_but_no_direction():
    for path in (ELL[:1], ELL[[0, 0]]):
        assert arc_lengths(path)[-1] == 0.0
        assert point_at(path, 1.0).tolist() == ELL[0].tolist()
        assert tangent_at(path, 0.0).tolist() == [0.0, 0.0, 0.0]
        assert first_stop(path, 0.0) == 0.0


def test_places_and_parts_of_paths_are_those_of_numpy_bit_by_bit():
    rng = np.random.default_rng(6)
    for seed in range(60):
        path = np.repeat(rng.uniform(-9.0, 9.0, (1 + seed % 7, 3)), rng.integers(1, 3), axis=0)
        arcs = arc_lengths(path)
        for s in [*arcs, *rng.uniform(0.0, 1.2 * arcs[-1] + 0.1, 4), max(arcs[-1] - 1e-7, 0.0)]:
            edge = min(max(int(np.searchsorted(arcs, s, side="right")) - 1, 0), len(path) - 2)
            point = path[-1]
            if s < arcs[-1]:
                share = (s - arcs[edge]) / (arcs[edge + 1] - arcs[edge])
                point = path[edge] + share * (path[edge + 1] - path[edge])
            before, beyond = arcs < s - 1e-6, arcs > s + 1e-6
            before[0] = beyond[-1] = True
            assert np.array_equal(point_at(path, s), point)
            assert np.array_equal(truncate(path, s), np.vstack((path[before], point)))
            assert np.array_equal(remaining(path, s), np.vstack((point, path[beyond])))
            if len(path) > 1:
                assert np.array_equal(tangent_at(path, s), edge_tangents(path)[edge])
            for one in (polyline.point_at, polyline.tangent_at, polyline.truncate):
                assert np.array_equal(one(path, s), one.py_func(path, s))
            assert np.array_equal(polyline.remaining.py_func(path, s), remaining(path, s))
        assert np.array_equal(point_at(path, -1.0), path[0])


def test_blends_never_leave_free_space():
    blended = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        space = make_space(rng.random((50, 50, 1)) < 0.004)
        cells = rng.uniform(2.0, 48.0, size=(400, 2))
        waypoints = [point(space, 25.5, 25.5)]
        for x, y in cells:
            candidate = point(space, x, y)
            if space.is_free(waypoints[0]) and space.edge_free(waypoints[-1], candidate):
                waypoints.append(candidate)
        waypoints = np.array(waypoints[:12])
        path = blend_corners(space, waypoints, blend_length=1.0)
        assert np.array_equal(path[[0, -1]], waypoints[[0, -1]])
        if len(waypoints) > 2:
            assert all(space.edge_free(a, b) for a, b in itertools.pairwise(path))
            assert np.diff(arc_lengths(path)).max() <= 0.05 + 1e-12
            blended += arc_lengths(path)[-1] < arc_lengths(waypoints)[-1] - 0.1
    assert blended > 15


def test_a_blocked_blend_shrinks_and_at_last_leaves_the_corner():
    blocked = np.zeros((40, 40, 1), dtype=bool)
    blocked[17, 22] = True  # inside the corner, 2 cells from both edges: forbidden up to 2 cells
    space = make_space(blocked)
    free = make_space(np.zeros((40, 40, 1), dtype=bool))
    corner = np.array([point(space, 5.5, 19.5), point(space, 20.5, 19.5), point(space, 20.5, 35.5)])
    nearest = [
        np.linalg.norm(blend_corners(s, corner, 1.0) - corner[1], axis=1).min()
        for s in (free, space)
    ]
    # A parabola passes its corner at half the distance from the corner to its chord: d / sqrt(8).
    assert nearest[0] == pytest.approx(1.0 / math.sqrt(8.0), abs=1e-3)
    assert 0.02 < nearest[1] < nearest[0] / 1.9  # smaller, but not the bare corner


@pytest.mark.parametrize("oriented", [False, True])
def test_compiled_blends_equal_python(oriented):
    rng = np.random.default_rng(4)
    space = make_space(rng.random((40, 40, 1)) < 0.006)
    waypoints = np.array([point(space, x, y) for x, y in ((5, 5), (20, 8), (22, 8), (30, 30))])
    tangents = np.stack([edge_tangents(waypoints[n : n + 3]) for n in range(2)])
    arguments = (space.grid, space.shape, oriented, waypoints, tangents, np.array([0.6, 0.1]), 0.05)
    found = blend.blend_path(*arguments)
    assert blend.blend_path.py_func(*arguments).tobytes() == found.tobytes()
    free = headed.path_free(space.grid, space.shape, oriented, found)
    assert headed.path_free.py_func(space.grid, space.shape, oriented, found) == free
    bare = blend.blend_path(*arguments[:5], np.zeros(2), 0.05)
    assert all((bare == at).all(axis=1).any() for at in waypoints)
    assert not (found == waypoints[1]).all(axis=1).any()


def test_corners_share_an_edge_by_how_far_each_turns(room):
    # A quarter turn and one of 2 atan(1 / 3): changes of the tangent by sqrt(2) and 2 / sqrt(10).
    waypoints = np.array([point(room, 20, 20), point(room, 60, 20), point(room, 60, 44)])
    along = np.array([-0.6, 0.8, 0.0])
    waypoints = np.vstack([waypoints, waypoints[-1] + 4.0 * along])
    path = blend_corners(room, waypoints, blend_length=10.0)
    steps = np.diff(path, axis=0)
    assert np.linalg.norm(steps, axis=1).min() > 1e-3  # no edge of no length between the blends
    met = path[np.argmin(np.abs(path[:, 1] - waypoints[1, 1] - 2.4 * 2**0.5 / (2**0.5 + 0.4**0.5)))]
    share = (met[1] - waypoints[1, 1]) / 2.4
    assert share == pytest.approx(2**0.5 / (2**0.5 + 0.4**0.5), abs=1e-3)


def test_blends_have_the_curvature_of_their_parabola(room):
    corner = np.array([point(room, 50, 50), point(room, 100, 50), point(room, 100, 100)])
    path = blend_corners(room, corner, blend_length=1.0, spacing=0.01)
    curvature = math.sin(math.pi / 4) / math.cos(math.pi / 4) ** 2  # of a quarter turn, d = 1
    limits = speed_limits(path, lateral_acceleration=0.5, yaw_rate=100.0)
    assert limits.min() == pytest.approx(math.sqrt(0.5 / curvature), rel=1e-3)
    by_yaw_rate = speed_limits(path, lateral_acceleration=1e9, yaw_rate=0.5)
    assert by_yaw_rate.min() == pytest.approx(0.5 / curvature, rel=1e-3)


def test_a_circle_is_taken_at_the_speed_of_its_radius():
    angle = np.linspace(0.0, 2.0, 81)
    circle = np.stack([2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.0 * angle], axis=1)
    limits = speed_limits(circle, lateral_acceleration=2.0, yaw_rate=100.0)
    assert limits[1:-1] == pytest.approx(np.full(79, 2.0), rel=1e-3)  # sqrt(2 * 2)
    assert limits[[0, -1]].tolist() == [math.inf, math.inf]
    cut = speed_limits(remaining(circle, 0.0999), lateral_acceleration=2.0, yaw_rate=100.0)
    assert cut.min() > 1.9  # the short edge that a cut leaves is no sharp bend
    straight = speed_limits(ELL[:2], lateral_acceleration=2.0, yaw_rate=1.0)
    assert straight.tolist() == [math.inf, math.inf]


def test_the_first_stop_is_the_first_sharp_corner(room):
    assert first_stop(ELL, 0.0) == 3.0
    assert first_stop(ELL, 3.0) == 7.0
    slight = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 1.0, 0.0]])
    assert first_stop(slight, 0.0) == arc_lengths(slight)[-1]
    assert first_stop(slight, 0.0, angle=0.4) == 2.0
    two_steps = np.array([[0, 0, 0], [1, 0, 0], [1.1, 0.1, 0], [1.12, 2.0, 0]], dtype=float)
    assert first_stop(two_steps, 0.0) == pytest.approx(1.0)
    climb = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 2.0]])
    assert first_stop(climb, 0.0) == 2.0
    corner = np.array([point(room, 50, 50), point(room, 100, 50), point(room, 100, 100)])
    smooth = blend_corners(room, corner, blend_length=1.0)
    assert first_stop(smooth, 0.0) == arc_lengths(smooth)[-1]


@pytest.fixture(params=["compiled", "interpreted"])
def compiled_or_not(request, monkeypatch):
    if request.param == "interpreted":
        monkeypatch.setattr(polyline, "edge_lengths", polyline.edge_lengths.py_func)
        for name in ("limit_speeds", "first_sharp_corner", "cosine_between", "edge_lengths"):
            monkeypatch.setattr(curvature, name, getattr(curvature, name).py_func)


def random_paths():
    """With corners, straight pieces, climbs, and points that lie together."""
    rng = np.random.default_rng(0)
    for number in range(120):
        steps = rng.normal(0.0, 0.2, (number % 13, 3))
        steps[rng.uniform(size=len(steps)) < 0.2] = 0.0
        for k in np.flatnonzero(rng.uniform(size=max(len(steps) - 1, 0)) < 0.3):
            steps[k + 1] = steps[k]
        yield np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def test_speed_limits_are_what_numpy_makes_of_them(compiled_or_not):
    for path in random_paths():
        expected = np.full(len(path), math.inf)
        if len(path) > 2:
            lengths, tangents = edge_lengths(path), edge_tangents(path)
            around = 0.5 * (lengths[:-1] + lengths[1:])
            around[0] = max(around[0], lengths[1])
            around[-1] = max(around[-1], lengths[-2])
            turn = np.abs(np.diff(angles.edge_headings(tangents, 0.0)))
            with np.errstate(divide="ignore", invalid="ignore"):
                by_acceleration = np.sqrt(2.0 * around / edge_lengths(tangents))
                by_yaw_rate = 0.7 * around / turn
            expected[1:-1] = np.fmin(np.fmin(by_acceleration, by_yaw_rate), math.inf)
        assert speed_limits(path, 2.0, 0.7).tobytes() == expected.tobytes()


def test_first_stops_are_what_numpy_makes_of_them(compiled_or_not):
    found = 0
    for path in random_paths():
        arcs, tangents = arc_lengths(path), edge_tangents(path)
        for s in (-0.1, 0.0, 0.3 * arcs[-1], arcs[-1] + 1.0):
            first = min(max(int(np.searchsorted(arcs, s, side="right")) - 1, 0), len(arcs) - 2)
            expected = arcs[-1]
            for edge in range(max(first, 0), len(tangents)):
                # np.dot may sum in another order.
                near = [
                    k for k in range(edge + 1, len(tangents)) if arcs[k] <= arcs[edge + 1] + 0.3
                ]
                if any((tangents[k] * tangents[edge]).sum() < math.cos(0.9) for k in near):
                    turns = [(tangents[k - 1] * tangents[k]).sum() for k in near]
                    expected = arcs[near[int(np.argmin(turns))]]
                    found += 1
                    break
            assert first_stop(path, float(s), angle=0.9, window=0.3) == expected
    assert found > 100


def test_a_short_step_back_is_left_out_and_a_long_one_is_not(room):
    """A hook of 3 cm costs a stop; a turn about after 1.5 m is a way."""
    x, y, z = point(room, 100.0, 100.0)
    hooked = np.array([(x, y, z), (x + 0.5, y, z), (x + 0.47, y, z), (x + 1.5, y + 0.1, z)])
    kept = without_hooks(room, hooked)
    assert len(kept) < len(hooked)
    assert np.array_equal(kept[[0, -1]], hooked[[0, -1]])
    assert ((kept[1:] - kept[:-1])[:, 0] > 0.0).all()
    back = np.array([(x, y, z), (x + 1.5, y, z), (x + 0.2, y + 0.4, z)])
    assert np.array_equal(without_hooks(room, back), back)
