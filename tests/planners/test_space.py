import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

from tests.planners.worlds import make_space
from wayproof.planners import FreeSpace, point_at, truncate
from wayproof.planners.kernels import free_box, grid, segment, shortcut

SUBCELLS = grid.SUBCELLS


def random_space(seed: int, shape: tuple[int, int, int], share: float = 0.1) -> FreeSpace:
    """Every cell's field is drawn: 0 (forbidden at threshold 0) or a squared distance up to 9."""
    rng = np.random.default_rng(seed)
    field = rng.integers(1, 10, size=shape).astype(np.uint16)
    field[rng.random(shape) < share] = 0
    return FreeSpace(field, np.array([0.5, -0.25, 2.0]), 0.25, 0, 1.0 / np.arange(1.0, 11.0))


def random_points(rng: np.random.Generator, space: FreeSpace, count: int) -> np.ndarray:
    """Points inside the grid and a little around it; some on faces, edges and corners of cells."""
    cells = rng.uniform(-0.5, np.array(space.field.shape) + 0.5, size=(count, 3))
    on_face = rng.random((count, 3)) < 0.3
    return space.origin + space.resolution * np.where(on_face, np.rint(cells), cells)


def touched_cells(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> dict[tuple, tuple]:
    """Every half-open cell on the segment, and those around a crossing, with their time span.

    Written with rationals: the segment is cut at all its crossings of cell faces.
    """
    start, end = (
        [Fraction(math.floor((x - low) / space.resolution * SUBCELLS), SUBCELLS) for x, low in
         zip(p, space.origin, strict=True)]
        for p in (a, b)
    )  # fmt: skip
    times = {Fraction(0), Fraction(1)}
    for p, q in zip(start, end, strict=True):
        low, high = sorted((p, q))
        if p != q:
            faces = range(math.ceil(low), math.floor(high) + 1)
            times |= {(face - p) / (q - p) for face in faces}
    times = sorted(times)
    at = {t: [p + t * (q - p) for p, q in zip(start, end, strict=True)] for t in times}
    spans: dict[tuple, tuple] = {}
    for t in times:  # the points where faces are crossed, with all the cells that meet there
        before = after = tuple(math.floor(x) for x in at[t])
        index = times.index(t)
        if index > 0:
            before = cell_of_middle(at[times[index - 1]], at[t])
        if index + 1 < len(times):
            after = cell_of_middle(at[t], at[times[index + 1]])
        here = tuple(math.floor(x) for x in at[t])
        for cell in {here, *itertools.product(*(sorted({p, q, r}) for p, q, r in
                     zip(before, here, after, strict=True)))}:  # fmt: skip
            spans.setdefault(cell, (t, t))
    for t, u in itertools.pairwise(times):
        cell = cell_of_middle(at[t], at[u])
        spans[cell] = (min(t, spans[cell][0]), u) if cell in spans else (t, u)
    return spans


def cell_of_middle(p: list[Fraction], q: list[Fraction]) -> tuple[int, ...]:
    return tuple(math.floor((x + y) / 2) for x, y in zip(p, q, strict=True))


def field_value(space: FreeSpace, cell: tuple[int, ...]) -> int:
    inside = all(0 <= index < size for index, size in zip(cell, space.field.shape, strict=True))
    return int(space.field[cell]) if inside else -1


def naive_walk(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> tuple[int, float, float]:
    """Least field value, share before the first forbidden cell, and mean cost if all is free."""
    spans = touched_cells(space, a, b)
    least = min(field_value(space, cell) for cell in spans)
    blocked = [span[0] for cell, span in spans.items() if field_value(space, cell) <= 0]
    share = float(min(blocked, default=Fraction(1)))
    cost = 0.0
    if least > 0:
        cost = sum(float(u - t) / (1.0 + field_value(space, c)) for c, (t, u) in spans.items())
    return least, share, cost


@pytest.mark.parametrize("shape", [(12, 9, 1), (8, 7, 6)])
def test_walks_touch_exactly_the_cells_that_geometry_says(shape):
    rng = np.random.default_rng(1)
    verdicts = []
    for seed in range(6):
        space = random_space(seed, shape)
        a, b = random_points(rng, space, 120).reshape(2, 60, 3)
        if shape[2] == 1:
            a[:, 2] = b[:, 2] = space.origin[2] + 0.5 * space.resolution
        for p, q in zip(a, b, strict=True):
            least, share, cost = naive_walk(space, p, q)
            length = float(np.linalg.norm(q - p))
            path = np.array([p, q])
            assert space.edge_free(p, q) == space.edge_free(q, p) == (least > 0)
            assert space.least_clearance(path) == math.sqrt(max(least, 0)) * space.resolution
            assert space.free_length(path) <= share * length + 1e-12
            if least > 0:
                assert space.path_cost(path, 3.0) == pytest.approx(length * (1.0 + 3.0 * cost))
            else:
                assert space.path_cost(path, 3.0) == math.inf
            verdicts.append(least > 0)
    assert 20 < sum(verdicts) < len(verdicts) - 20


def test_compiled_kernels_equal_python():
    rng = np.random.default_rng(2)
    space = random_space(3, (10, 10, 5), share=0.03)
    for path in random_points(rng, space, 80).reshape(20, 4, 3):
        a, b = tuple(path[0].tolist()), tuple(path[1].tolist())
        near, start = grid.to_subcells(space.grid, a)
        assert grid.to_subcells.py_func(space.grid, a) == (near, start)
        end = grid.to_subcells(space.grid, b)[1]
        walked = segment.walk(space.grid, 0, start, end)
        assert segment.walk.py_func(space.grid, 0, start, end) == walked
        walked = segment.walk_path(space.grid, 0, 2.0, path)
        assert segment.walk_path.py_func(space.grid, 0, 2.0, path) == walked
        nearest = segment.nearest_free(space.grid, 5, a, 2.5)
        assert segment.nearest_free.py_func(space.grid, 5, a, 2.5) == nearest


def test_a_walk_is_the_one_that_looks_out_for_corners_and_borders():
    rng = np.random.default_rng(5)
    walked = 0
    for seed in range(20):
        space = random_space(seed, (9, 8, 4), share=0.05)
        for k in range(200):
            # On faces and corners too, and beyond the grid.
            ends = rng.integers(-2, 22, (2, 3)) * (grid.SUBCELLS // 2)
            ends += rng.integers(-1, 2, (2, 3)) * rng.integers(0, grid.SUBCELLS // 3, (2, 3))
            if k % 2:
                ends[1, 2] = ends[0, 2]
            a, b = (tuple(end.tolist()) for end in ends)
            for threshold in (0, 3):
                told = segment.walk_anywhere(space.grid, threshold, a, b)
                assert segment.walk_anywhere.py_func(space.grid, threshold, a, b) == told
                assert segment.walk(space.grid, threshold, a, b) == told
                assert segment.walk.py_func(space.grid, threshold, a, b) == told
                walked += told[0] == 1.0 and a != b
    assert 100 < walked < 15000


def test_a_box_is_free_where_all_its_cells_are():
    rng = np.random.default_rng(6)
    space = make_space(rng.random((14, 12, 5)) < 0.003, resolution=0.25)
    shape = np.array(space.field.shape)
    free = seen = 0
    for _ in range(600):
        low, size = rng.uniform(0.5, shape - 1.0), rng.uniform(0.0, (4.0, 4.0, 2.0))
        corners = [tuple(space.origin + space.resolution * end) for end in (low, low + size)]
        reach = rng.uniform(0.0, 2.0)
        told = free_box.box_free(space.grid, 2, *corners, reach * space.resolution)
        first = np.floor(low - (reach, reach, 0.0)).astype(int) - 1
        end = np.floor(low + size + (reach, reach, 0.0)).astype(int) + 2
        inside = (first >= 0).all() and (end <= shape).all()
        cells = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        assert told == (inside and bool((space.field[cells] > 2).all()))
        assert free_box.box_free.py_func(space.grid, 2, *corners, reach * space.resolution) == told
        free, seen = free + told, seen + inside
    assert 20 < free < seen - 20


def test_distances_tell_of_what_is_near_exactly():
    for value, threshold, squared in np.ndindex(60, 12, 12):
        beyond = math.sqrt(value) - math.sqrt(threshold) - math.sqrt(squared)
        assert free_box.all_above(value, threshold, squared) == (beyond > 1e-9)


def test_compiled_shortcut_equals_python():
    space = random_space(3, (20, 20, 1), share=0.0)
    path = space.origin + space.resolution * np.array([[1, 1, 0.5], [18, 2, 0.5], [17, 18, 0.5]])
    draws = np.random.default_rng(0).uniform(0.0, 1.0, (40, 5)) * [1, 1, 1, 1, 0]
    short = shortcut.shortcut(space.grid, 0, 2.0, 0.2, path, draws)
    assert (
        shortcut.shortcut.py_func(space.grid, 0, 2.0, 0.2, path, draws).tobytes() == short.tobytes()
    )
    assert space.path_cost(short, 2.0) < space.path_cost(path, 2.0)
    assert np.array_equal(short[[0, -1]], path[[0, -1]])


def row_of_cells(values: list[int]) -> FreeSpace:
    """1 m cells along x at y = z = 0.5; forbidden at 1 or below; costs 0, 0, 0.5, 0.25, 0."""
    field = np.array(values, dtype=np.uint16).reshape(-1, 1, 1)
    return FreeSpace(field, np.zeros(3), 1.0, 1, np.array([9.0, 9.0, 0.5, 0.25, 0.0]))


def test_a_row_of_cells_by_hand():
    space = row_of_cells([4, 2, 3, 0, 4])
    path = np.array([[0.5, 0.5, 0.5], [3.5, 0.5, 0.5]])
    assert space.free_length(path) == pytest.approx(2.5, abs=1e-4)
    assert space.free_length(path) < 2.5
    assert space.path_cost(path) == math.inf
    free = np.array([[0.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    # 0.5 m at 0, 1 m at 0.5 and 0.5 m at 0.25, times 2, on top of the length
    assert space.path_cost(free, 2.0) == pytest.approx(2.0 + 2.0 * (0.5 + 0.125))
    assert space.free_length(free) == 2.0
    assert space.least_clearance(free) == math.sqrt(2.0)


def test_a_corner_touches_all_its_cells():
    field = np.full((2, 2, 1), 9, dtype=np.uint16)
    field[0, 1] = 0
    space = FreeSpace(field, np.zeros(3), 1.0, 0, np.zeros(10))
    corner = np.array([[0.5, 0.5, 0.5], [1.5, 1.5, 0.5]])
    assert not space.edge_free(*corner)
    assert space.edge_free(corner[0] + [0.01, 0.0, 0.0], corner[1] + [0.01, 0.0, 0.0])


def test_every_point_before_the_free_length_is_free():
    rng = np.random.default_rng(5)
    cut = 0
    for seed in range(40):
        space = random_space(seed, (12, 12, 6))
        path = random_points(rng, space, 4)
        length = space.free_length(path)
        cut += 0.0 < length < np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        if length > 0.0:
            assert all(space.is_free(point_at(path, s)) for s in np.linspace(0.0, length, 300))
    assert cut > 5


def test_outside_and_senseless_points_are_forbidden():
    space = row_of_cells([4, 4])
    for x in (-1e-9, 2.0, 1e9, math.inf, math.nan):
        away = np.array([x, 0.5, 0.5])
        assert not space.is_free(away)
        assert not space.edge_free(np.array([0.5, 0.5, 0.5]), away)
    assert space.is_free(np.zeros(3))
    path = np.array([[1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    assert space.free_length(path) == pytest.approx(0.5, abs=1e-4)
    assert space.least_clearance(path) == 0.0
    assert space.free_length(path[::-1]) == 0.0


def test_nearest_free_takes_the_nearest_then_the_lowest_index():
    field = np.full((5, 5, 1), 9, dtype=np.uint16)
    field[1:4, 1:4] = 0
    space = FreeSpace(field, np.zeros(3), 1.0, 0, np.zeros(10))
    # From the centre four cells are 2 m away: (0, 2), (2, 0), (2, 4), (4, 2).
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 2.0).tolist() == [0.5, 2.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.6, 0.5]), 2.0).tolist() == [2.5, 4.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 1.9) is None
    assert space.nearest_free(np.array([-0.5, 0.5, 0.5]), 1.0).tolist() == [0.5, 0.5, 0.5]
    assert space.nearest_free(np.array([math.nan, 0.5, 0.5]), 1.0) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"distances": np.zeros((3, 3), dtype=np.uint16)},
            r"space\.distances: got uint16 \(3, 3\)",
        ),
        ({"origin": np.zeros(2)}, r"space\.origin: got shape \(2,\), expected \(3,\)"),
        ({"resolution": 0.0}, r"space\.resolution: got 0\.0, expected above 0"),
        ({"collision_distance_sq": -1}, r"collision_distance_sq: got -1, expected 0 or more"),
        ({"cost_by_distance": np.array([0.0, np.inf])}, r"space\.cost_by_distance: got \[inf\]"),
    ],
)
def test_wrong_spaces_are_refused(change, message):
    right = {
        "distances": np.ones((3, 3, 1), dtype=np.uint16),
        "origin": np.zeros(3),
        "resolution": 0.1,
        "collision_distance_sq": 0,
        "cost_by_distance": np.zeros(4),
    }
    with pytest.raises(ValueError, match=message):
        FreeSpace(**(right | change))


def test_the_fewest_corners_are_kept_that_their_price_is_worth():
    field = np.full((100, 100, 1), 100, dtype=np.uint16)
    space = FreeSpace(field, np.zeros(3), 0.1, 1, np.zeros(101))
    bow = np.array([[1.0, 1.0, 0.05], [3.0, 1.3, 0.05], [5.0, 1.3, 0.05], [7.0, 1.0, 0.05]])
    field[38:42, :12, 0] = 0  # the straight way is closed up to y = 1.2 m
    space = FreeSpace(field, np.zeros(3), 0.1, 1, np.zeros(101))

    def kept(price):
        path = shortcut.fewest_corners(space.grid, 1, 0.0, price, bow)
        slow = shortcut.fewest_corners.py_func(space.grid, 1, 0.0, price, bow)
        assert path.tobytes() == slow.tobytes()
        return path[:, 0].tolist()

    # One corner is enough where its edges pass the wall; two are shorter by less than 0.1 m.
    naive = {
        tuple(chosen): segment.walk_path(space.grid, 1, 0.0, bow[list(chosen)])
        for chosen in ((0, 3), (0, 1, 3), (0, 2, 3), (0, 1, 2, 3))
    }
    for price in (0.0, 0.01, 0.5):
        costs = {
            chosen: cost + price * (len(chosen) - 2)
            for chosen, (_, least, cost) in naive.items()
            if least > 1
        }
        best = min(costs.values())
        chosen = [n for n, x in enumerate(bow[:, 0]) if x in kept(price)]
        assert costs[tuple(chosen)] == pytest.approx(best, abs=1e-8)


def test_a_way_cut_short_at_a_corner_of_cells_ends_in_a_free_cell():
    """A diagonal through the corner of a blocked cell, its ends off by what floats round to."""
    field = np.full((200, 200, 1), 100, dtype=np.uint16)
    field[97, 79, 0] = 0
    space = FreeSpace(field, np.array([0.0, 0.0, 0.025]), 0.1, 1, np.zeros(101))
    for off in itertools.product((-4e-15, 0.0, 4e-15), repeat=4):
        a = np.array([9.65 + off[0], 7.85 + off[1], 0.075])
        b = np.array([10.65 + off[2], 8.85 + off[3], 0.075])
        path = np.array([a, b])
        cut = truncate(path, space.free_length(path))
        assert space.edge_free(cut[0], cut[-1])
