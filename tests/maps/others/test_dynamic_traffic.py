"""What moves: a room of 12 m with a box of 0.5 m at 1 m/s, and a lidar in it; and a long way."""

import functools

import numpy as np
import pytest

from tests.maps.cells import occupied_centres
from tests.maps.sweeps import scan
from wayproof.maps import (
    MAPS,
    Costmap,
    CostmapConfig,
    DynamicConfig,
    DynamicMap,
    MapConfig,
)
from wayproof.maps.columns import Window
from wayproof.maps.costmap.projection import Airspace
from wayproof.maps.others.tracking import POINTS

TENTH = 100_000_000  # ns
BOX = (-12.8, -12.8, -0.875), (12.8, 12.8, 5.5)

SENSOR = np.array([0.03, 0.02, 0.45])
HALF, TALL = 0.25, 1.2
ROOM = [
    ((-6.0, -6.0, -1.0), (6.0, 6.0, 0.0)),
    ((-6.0, -6.0, 0.0), (-5.5, 6.0, 2.0)),
    ((5.5, -6.0, 0.0), (6.0, 6.0, 2.0)),
    ((-6.0, -6.0, 0.0), (6.0, -5.5, 2.0)),
    ((-6.0, 5.5, 0.0), (6.0, 6.0, 2.0)),
]
WAYS = {
    "across": lambda t: np.array([t - 4.0, 2.0]),
    "toward": lambda t: np.array([5.5 - t, 0.6]),
    "away": lambda t: np.array([t - 0.3, 0.6]),
    "obliquely": lambda t: np.array([0.7 * t - 3.55, 0.7 * t - 0.05]),
}
ENTERS, WATCHED, ENDS = 1.5, 2.5, 4.0  # s


def lidar(rows=32, columns=625):
    around = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    return scan(np.deg2rad(np.linspace(-45.0, 20.0, rows)), around)


def cast(origin, directions, boxes):
    """Ranges of beams to boxes, mm."""
    nearest = np.full(len(directions), np.inf)
    for low, high in boxes:
        first, second = (low - origin) / directions, (high - origin) / directions
        entry = np.minimum(first, second).max(axis=1)
        met = (entry > 0.0) & (entry <= np.maximum(first, second).min(axis=1))
        nearest[met] = np.minimum(nearest[met], entry[met])
    return np.where(nearest <= 12.0, np.rint(1000 * np.minimum(nearest, 20.0)), 65535)


def box_at(place):
    return (*(place - HALF), 0.0), (*(place + HALF), TALL)


@functools.cache
def sweeps(way):
    """Directions of a lidar's beams, and their ranges in each sweep, mm; a box goes its way."""
    # Off the axes, so that no beam runs within a face.
    directions = lidar() @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    ranges_mm = []
    for k in range(round(10 * ENDS)):
        moving = way is not None and k >= 10 * ENTERS
        boxes = [*ROOM, box_at(way(0.1 * k))] if moving else ROOM
        ranges_mm.append(cast(SENSOR, directions, boxes).astype(np.uint16))
    return directions, ranges_mm


def drive(kind, way, each=lambda *_: None, **settings):
    """Watch the room, in which a box goes its way if there is one."""
    config = MapConfig(kind=kind, memory_mib=64, **settings)
    voxel_map = MAPS[kind](config)
    directions, in_each_mm = sweeps(way)
    for k, ranges_mm in enumerate(in_each_mm):
        voxel_map.integrate(SENSOR, directions, ranges_mm, 12.0, k * TENTH)
        each(voxel_map, k)
    return voxel_map


class Judge:
    """Compares what a costmap blocks with where the box is, and will be 0.2 s later."""

    def __init__(self, way):
        self.way, self.costmap, self.rows = way, None, []

    def __call__(self, voxel_map, k):
        if self.costmap is None:
            low, high = (-5.4, -5.4, -0.3), (5.4, 5.4, 2.0)
            self.costmap = Costmap(CostmapConfig(), voxel_map, low, high, "ground", 0.3, 0.5, 0.15)
        self.costmap.update(0.1)
        if k < 10 * WATCHED:
            return
        costmap, now, later = self.costmap, self.way(0.1 * k), self.way(0.1 * k + 0.2)
        blocked = costmap.obstacle_clearance[:, :, 0] <= costmap.collision_distance_sq
        reach = costmap.radius + costmap.margin
        true = self.near(later, reach)
        # A cell's diagonal is what a map on a grid may be off.
        live = np.zeros_like(true)
        for share in np.linspace(0.0, 1.0, 5):
            live |= self.near(now + share * (later - now), costmap.inflation_radius + 0.14)
        room = self.near(np.zeros(2), 4.4)  # whose walls do not count
        ghosts = blocked & ~live & room
        self.rows.append(
            (blocked[self.near(later, 0.0)].mean(), blocked[true & room].mean(), ghosts.sum())
        )

    def near(self, place, reach):
        nx, ny, _ = self.costmap.shape
        x = self.costmap.origin[0] + 0.1 * (np.arange(nx)[:, None] + 0.5)
        y = self.costmap.origin[1] + 0.1 * (np.arange(ny) + 0.5)
        apart = [np.maximum(np.abs(a - c) - HALF, 0.0) for a, c in zip((x, y), place, strict=True)]
        return apart[0] ** 2 + apart[1] ** 2 <= reach * reach


@pytest.mark.few(1)
@pytest.mark.parametrize("name", WAYS)
def test_rows_of_true_future_cells_and_ghosts(name):
    """Prints the table of docs/evidence.md when run with -s."""
    rows = []
    for label, kind, settings in (
        ("voxel", "voxel", {}),
        ("dynamic, no look-ahead", "dynamic", {"dynamic": DynamicConfig(prediction_horizon=0.0)}),
        ("dynamic", "dynamic", {}),
    ):
        judge = Judge(WAYS[name])
        drive(kind, WAYS[name], each=judge, **settings)
        rows.append(np.mean(judge.rows, axis=0))
        print(f"| {name} | {label} |", "{:.2f} | {:.2f} | {:.0f} |".format(*rows[-1]))
    voxel, no_look_ahead, dynamic = rows
    assert dynamic[0] > voxel[0] + 0.1
    assert dynamic[1] > voxel[1] + 0.2
    assert dynamic[1] > no_look_ahead[1]
    if name in ("across", "away"):  # nothing of what they leave lies in their shadow
        assert dynamic[2] < 0.6 * voxel[2]


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["across", "obliquely"])
def test_it_predicts_where_one_return_makes_a_free_cell_occupied_too(name):
    """Such evidence takes a cell out of the free space with the hit that shows the motion."""
    figures = []
    for kind in ("voxel", "dynamic"):
        judge = Judge(WAYS[name])
        drive(kind, WAYS[name], each=judge, prob_min=0.3)
        figures.append(np.mean(judge.rows, axis=0))
    voxel, dynamic = figures
    assert voxel[0] == dynamic[0] == 1.0
    assert dynamic[1] > voxel[1] + 0.05
    assert dynamic[2] < 0.9 * voxel[2]


def test_with_nothing_moving_it_ends_as_a_voxel_map():
    one, other = drive("voxel", None), drive("dynamic", None)
    assert len(other.dynamic_centres()) == 0
    window = ((-64, -64, -8), (128, 128, 1))
    for mine, theirs in zip(one.columns(*window), other.columns(*window), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert one.counts() == other.counts()


def test_what_two_time_scales_do_not_explain_is_as_in_a_voxel_map():
    """With a box that passes: cells differ only where the box was or is predicted to be."""
    one, other = drive("voxel", WAYS["across"]), drive("dynamic", WAYS["across"])
    window = ((-64, -64, -8), (128, 128, 1))
    differ = np.zeros((128, 128), np.uint64)
    for mine, theirs in zip(one.columns(*window), other.columns(*window), strict=True):
        differ |= (mine ^ theirs)[..., 0]
    x, y = np.argwhere(differ).T - 64
    assert len(x) > 10
    assert y.min() >= 16
    assert y.max() <= 24
    assert x.min() >= 10 * (WAYS["across"](ENTERS)[0] - HALF) - 1
    assert x.max() <= 10 * (WAYS["across"](ENDS)[0] + HALF + 0.2)


def test_a_wall_seen_at_grazing_angles_does_not_flicker():
    """A sensor that moves along a wall, within 0.4 m of it and seeing 6 m of it, for 25 sweeps."""
    rows, columns = np.linspace(-20.0, 20.0, 41), np.linspace(3.5, 40.0, 300)
    directions = scan(np.deg2rad(rows), np.deg2rad(columns))
    one, other = (MAPS[kind](MapConfig(kind=kind, memory_mib=16)) for kind in ("voxel", "dynamic"))
    seen, turned, count = set(), 0, 0
    for k in range(25):
        origin = np.array([0.02 * k, 0.133, 1.05])
        ranges_mm = np.rint(0.4 / directions[:, 1] * 1000)  # the wall y = 0.533
        ranges_mm = np.where(ranges_mm <= 6000, ranges_mm, 65535).astype(np.uint16)
        for voxel_map in (one, other):
            voxel_map.integrate(origin, directions, ranges_mm, 6.0, k * TENTH)
        now = occupied_centres(other, *BOX)
        np.testing.assert_array_equal(occupied_centres(one, *BOX), now)
        cells = set(map(tuple, now.tolist()))
        turned, count, seen = turned + len(seen - cells), count + len(cells), cells
    assert len(seen) > 1000
    assert turned < 0.001 * count  # cells met once, 6 m away
    assert len(other.dynamic_centres()) == 0
    assert other._ever_free.contains(np.array([[20, 3, 10]]))[0]  # the space before the wall


def test_every_change_is_logged_and_reaches_both_kinds_of_body():
    window = ((-64, -64, -8), (128, 128, 1))
    airspace = Airspace(Window(0.1, (-64, -64, -8), (128, 128, 64)), -np.inf, np.inf)
    last = {"now": 0, "columns": np.zeros((2, 128, 128, 1), np.uint64), "moved": 0}
    followed = np.zeros((2, 128, 128, 1), np.uint64)

    def check(voxel_map, k):
        boxes, last["now"] = voxel_map.changed(last["now"])
        columns = np.array(voxel_map.columns(*window))
        differ = np.argwhere((columns ^ last["columns"]).any(axis=(0, 3))) - 64
        inside = (differ[:, None] >= boxes[:, :2]) & (differ[:, None] < boxes[:, 3:5])
        assert inside.all(axis=2).any(axis=1).all()
        airspace.read(voxel_map)
        np.testing.assert_array_equal((airspace.occupied, airspace.free), columns)
        voxel_map.rewrite_columns(window[0], boxes, *followed)
        np.testing.assert_array_equal(followed, columns)
        last["columns"] = columns
        last["moved"] += len(differ) if k > 20 else 0

    voxel_map = drive("dynamic", WAYS["across"], each=check)
    assert last["moved"] > 100
    assert len(voxel_map.changed(last["now"])[0]) == 0
    assert len(voxel_map.changed(0)[0]) > 50


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("across", 0.45),  # m/s; while it passes one of its sides comes into view, one goes
        ("toward", 0.2),
        ("away", 0.2),
        ("obliquely", 0.2),
    ],
)
def test_velocities_are_near_the_true_ones(name, error):
    voxel_map = drive("dynamic", WAYS[name])
    largest = max(voxel_map._traffic.tracks, key=lambda track: sum(map(abs, track.shift(TENTH))))
    velocity = np.array(largest.shift(10 * TENTH)) / POINTS * 0.1  # m/s
    true = WAYS[name](1.0) - WAYS[name](0.0)
    assert np.linalg.norm(velocity[:2] - true) < error


def along_a_long_way():
    directions = lidar(8, 100)
    ranges_mm = np.full(len(directions), 1500, np.uint16)
    voxel_map, now = DynamicMap(MapConfig(kind="dynamic", memory_mib=1, half_life=0.0)), 0
    everywhere = 0
    for k in range(60):
        voxel_map.integrate((2.0 * k, 0.0, 0.5), directions, ranges_mm, 3.0, 3 * k * TENTH)
        boxes, now = voxel_map.changed(now)
        everywhere += int((boxes[:, 3] - boxes[:, 0] > 16).any())
    return voxel_map, everywhere


def test_a_map_whose_change_log_overflows_learns_the_same(monkeypatch):
    logged, none = along_a_long_way()
    monkeypatch.setattr("wayproof.maps.slot_pool.MAX_LOGGED", 1)
    overflown, everywhere = along_a_long_way()
    assert none == 0 < everywhere
    assert logged.version() == overflown.version()


def test_memory_stays_bounded_along_a_long_way():
    voxel_map, _ = along_a_long_way()
    held = len(voxel_map._bricks.live())
    assert held < 60
    assert len(voxel_map._ever_free.keys()) <= 2 * held
