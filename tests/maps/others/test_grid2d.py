import itertools

import numpy as np
import pytest

from tests.maps.sweeps import scan, scattered
from wayproof.maps import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Costmap,
    CostmapConfig,
    Grid2D,
    MapConfig,
    VoxelMap,
    states_in,
)
from wayproof.maps.kernels.grid2d import clip_to_band

SECOND = 10**9
FORWARD = np.array([[1.0, 0.0, 0.0]])
EYE = (0.55, 1.05, 0.475)  # the middle of a cell


def make(**settings):
    return Grid2D(MapConfig(**({"half_life": 0.0, "memory_mib": 16} | settings)))


def look(grid, *ranges_mm, directions=None, origin=EYE, time_ns=0, limit=3.0):
    directions = np.repeat(FORWARD, len(ranges_mm), 0) if directions is None else directions
    ranges_mm = np.array(ranges_mm, np.uint16)
    return grid.integrate(origin, np.array(directions, float), ranges_mm, limit, time_ns)


def log_odds(grid, *cells):
    """Of cells ahead of the eye, whose own is 0, in units of 1/30."""
    odds = grid.probability_at(np.array(EYE) + np.array(cells)[:, None] * [0.1, 0.0, 0.0])
    return np.rint(30.0 * np.log(odds / (1.0 - odds))).astype(int).tolist()


def unit(*direction):
    return [list(np.array(direction) / np.linalg.norm(direction))]


def test_one_beam_by_hand():
    grid = make()
    statistics = look(grid, 2000, 2001)
    assert (statistics.hits, statistics.cells_updated) == (2, 21)
    assert log_odds(grid, *range(23)) == [-12] * 20 + [27, 0, 0]
    assert grid.counts() == {"free": 20, "occupied": 1}
    look(grid, 2000, 2500)  # occupied wins
    assert log_odds(grid, 19, 20, 21, 25, 26) == [-24, 54, -12, 27, 0]
    for _ in range(20):
        look(grid, 2000)
    assert log_odds(grid, 10, 20) == [-60, 104]  # the clamps


def test_a_cell_stands_for_its_column_and_the_floor():
    grid = make()
    look(grid, 2000)
    heights = np.array([-0.2, 0.0, 0.1, 1.0, 5.0])
    for x, expected in (
        (2.55, [UNKNOWN, OCCUPIED, OCCUPIED, OCCUPIED, OCCUPIED]),
        (1.05, [UNKNOWN, OCCUPIED, FREE, FREE, FREE]),
        (2.85, [UNKNOWN] * 5),
    ):
        at = np.stack([np.full(5, x), np.full(5, 1.05), heights], axis=1)
        assert grid.state_at(at).tolist() == expected
    occupied, free = grid.columns((10, 10, -3), (16, 1, 1))
    assert occupied[0, 0, 0] == 1 << 3
    assert free[0, 0, 0] == (1 << 64) - (1 << 4)
    assert (occupied[15, 0, 0], free[15, 0, 0]) == ((1 << 64) - (1 << 3), 0)


@pytest.mark.parametrize(
    ("direction", "millimetres", "cleared", "hits"),
    [
        # From 0.475 m down a slope of 1/4 to the floor at 1.9 m: out of the band at 1.7 m.
        ((4.0, 0.0, -1.0), 1958, 18, 0),
        # Half as far, 0.95 m, it is at 0.2375 m: a return in the band.
        ((4.0, 0.0, -1.0), 979, 9, 1),
        # Up a slope of 2 it leaves the band, at 2 m, after 0.7625 m.
        ((1.0, 0.0, 2.0), 2500, 8, 0),
        # Straight down nothing but the sensor's own cell is crossed.
        ((0.0, 0.0, -1.0), 475, 1, 0),
    ],
)
def test_a_beam_clears_where_it_is_within_the_band(direction, millimetres, cleared, hits):
    grid = make()
    look(grid, millimetres, directions=unit(*direction), origin=(0.52, 1.05, 0.475))
    at = np.array([0.55, 1.05, 0.3]) + np.arange(24)[:, None] * [0.1, 0.0, 0.0]
    known = [FREE] * cleared + [OCCUPIED] * hits
    assert grid.state_at(at).tolist() == known + [UNKNOWN] * (24 - len(known))
    assert sum(grid.counts().values()) == len(known)


def test_from_above_the_band_it_clears_from_where_it_enters():
    grid = make(max_obstacle_height=0.5)
    # From 1.5 m down a slope of 1: in the band from 1.0 to 1.45 m ahead.
    look(grid, 2121, directions=unit(1.0, 0.0, -1.0), origin=(0.501, 1.05, 1.5))
    free = states_in(grid, (0.5, 1.01, -0.07), (3.0, 1.09, 0.28))[:, 0, -1] == FREE
    assert np.flatnonzero(free).tolist() == [10, 11, 12, 13, 14]


def test_a_climb_is_clipped_to_the_band():
    heights = range(-7, 8, 2)
    for start, end in itertools.product(heights, heights):
        enters, leaves = clip_to_band(start, end, (-4, 2))
        inside = [z for z in range(min(start, end), max(start, end) + 1) if -4 <= z <= 2]
        span = len(inside) - 1 if start != end else len(inside)
        assert max(leaves - enters, 0) == max(span, 0)


def naive_marks(origin, directions, ranges_mm, band):
    """Cells that beams cross in the band and hit there, by slabs, and those in doubt."""
    cells = np.moveaxis(np.indices((60, 60)), 0, -1).reshape(-1, 2) - 30
    crossed, hit, doubt = (np.zeros(len(cells), bool) for _ in range(3))
    for direction, millimetres in zip(directions, ranges_mm, strict=True):
        way = direction * (int(millimetres) / 1000)
        enter, leave = np.zeros(len(cells)), np.ones(len(cells))
        slabs = [(cells[:, axis] * 0.1, cells[:, axis] * 0.1 + 0.1) for axis in (0, 1)]
        for axis, (low, high) in enumerate([*slabs, band]):
            times = np.stack([(low - origin[axis]) / way[axis], (high - origin[axis]) / way[axis]])
            enter, leave = np.maximum(enter, times.min(0)), np.minimum(leave, times.max(0))
        length = (leave - enter) * millimetres
        crossed |= length > 0
        doubt |= np.abs(length) < 2.0  # mm: sub-cells are 0.2 mm, and ends lie between them
        end = origin + way
        if band[0] < end[2] < band[1]:
            hit |= np.all(cells == np.floor(end[:2] * 10), axis=1)
        near = np.abs(end[:2] * 10 - np.rint(end[:2] * 10)).min() < 0.01
        doubt |= np.all(np.abs(cells - np.floor(end[:2] * 10)) <= 1, axis=1) & near
    return cells, crossed, hit, doubt


def test_sweeps_are_those_of_naive_slabs():
    grid = make(minimum_range=0.0, min_obstacle_height=0.1, max_obstacle_height=0.7)
    directions, ranges_mm = scattered(np.random.default_rng(1), 60, 300, 2500)
    origin = np.array([0.013, -0.021, 0.4])
    look(grid, *ranges_mm, directions=directions, origin=origin)
    cells, crossed, hit, doubt = naive_marks(origin, directions, ranges_mm, (0.1, 0.7))
    points = np.pad((cells + 0.5) * 0.1, ((0, 0), (0, 1)), constant_values=0.3)
    got = grid.state_at(points)
    expected = np.where(hit, OCCUPIED, np.where(crossed, FREE, UNKNOWN))
    assert hit[~doubt].sum() > 8
    assert crossed[~doubt].sum() > 150
    assert doubt.mean() < 0.1
    assert (got == expected)[~doubt].all()


def scene_sweep(origin, boxes, hole=None):
    """A dense sweep over a floor with boxes (low, high); millimetres and directions."""
    rows, columns = np.linspace(-60.0, 75.0, 90), np.linspace(-40.0, 40.0, 120)
    directions = scan(np.deg2rad(rows), np.deg2rad(columns))
    ranges = np.full(len(directions), np.inf)
    with np.errstate(divide="ignore"):
        floor = np.where(directions[:, 2] < 0, -origin[2] / directions[:, 2], np.inf)
        if hole is not None:
            x = origin[0] + floor * directions[:, 0]
            deeper = (origin[2] + 0.5) / -directions[:, 2]
            floor = np.where((hole[0] < x) & (x < hole[1]), deeper, floor)
        ranges = np.minimum(ranges, floor)
        for low, high in boxes:
            faces = (np.array([low, high])[:, None] - origin) / directions
            enter, leave = faces.min(axis=0).max(axis=1), faces.max(axis=0).min(axis=1)
            ranges = np.where((enter < leave) & (enter > 0), np.minimum(ranges, enter), ranges)
    return directions, np.where(ranges > 6.0, 65535, np.rint(ranges * 1000)).astype(np.uint16)


def both(boxes, hole=None, **settings):
    """The voxel map and the grid of the same sweeps, and the state of each for a low body ahead."""
    config = MapConfig(half_life=0.0, memory_mib=16, **settings)
    maps, beliefs = (VoxelMap(config), Grid2D(config)), []
    for map_ in maps:
        for k in range(4):
            origin = np.array([0.31 + 0.1 * k, 0.02, 0.42])
            directions, ranges_mm = scene_sweep(origin, boxes, hole)
            map_.integrate(origin, directions, ranges_mm, 6.0, k)
        box = (-0.2, -1.0, -0.3), (4.0, 1.0, 2.5)
        costmap = Costmap(CostmapConfig(), map_, *box, "ground", 0.2, 0.45, 0.03)
        ahead = slice(22, 28), slice(7, 13)  # 2.0 to 2.6 m
        beliefs.append(costmap.state[:, :, 0][ahead])
    return maps, beliefs


def test_a_shelf_board_above_the_scan_is_not_seen():
    board = (2.0, -0.8, 0.36), (2.6, 0.8, 0.40)  # below the body's back, above the band
    _, (seen, blind) = both([board], max_obstacle_height=0.3)
    assert (seen == OCCUPIED).any(axis=0).all()  # across the whole way
    assert (blind == FREE).all()


def test_what_can_be_passed_below_is_taken_for_an_obstacle():
    beam = (2.0, -0.8, 1.0), (2.6, 0.8, 1.2)
    _, (seen, blind) = both([beam])
    assert (seen == FREE).all()
    assert (blind == OCCUPIED).any(axis=0).all()


def test_a_hole_in_the_floor_is_not_seen():
    _, (seen, blind) = both([], hole=(2.0, 2.6))
    assert not (seen == FREE).any()
    assert (blind == FREE).all()


def test_heights_are_refused_in_one_line():
    grid = make()
    with pytest.raises(ValueError, match="got 'grid2d' for a body that flies, expected a kind"):
        grid.mark_free_sphere(EYE, 0.3, 0)
    look(grid, 2000)
    with pytest.raises(ValueError, match="got 'grid2d' for a window without the floor"):
        Costmap(CostmapConfig(), grid, (0, 0, 0.2), (3, 2, 2), "air", 0.2, 0.2, 0.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"min_obstacle_height": -0.1}, "map.min_obstacle_height: got -0.1, expected 0 to 10 m"),
        (
            {"min_obstacle_height": 0.5, "max_obstacle_height": 0.4},
            "map.max_obstacle_height: got 0.4, expected 0.51 to 100 m",
        ),
    ],
)
def test_a_bad_band_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        MapConfig(**settings)


def test_marks_spare_obstacles_and_the_floor_is_taken_for_granted():
    grid = make()
    look(grid, 2000)
    grid.mark_free((2.4, 1.0, 0.1), (2.8, 1.2, 0.6), 3)
    assert log_odds(grid, 18, 19, 20, 21, 22, 23) == [-12, -24, 27, -12, -12, 0]
    before = grid.version()
    grid.mark_floor((0.0, 0.0), (2.0, 2.0), 4)
    grid.mark_free((0.0, 0.0, -0.3), (2.0, 2.0, -0.1), 5)
    assert grid.version() == before
    assert make(max_obstacle_height=1.0).version() != make().version()


def test_evidence_fades_to_unknown_as_the_voxel_maps_does():
    grid, voxel = make(half_life=1.0), VoxelMap(MapConfig(half_life=1.0))
    for map_ in (grid, voxel):
        look(map_, 2000, time_ns=100)
    for k in range(1, 12):
        grid.advance(k * SECOND)
        voxel.advance(k * SECOND)
        assert log_odds(grid, 0, 10, 20) == log_odds(voxel, 0, 10, 20)
