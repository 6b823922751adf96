import numpy as np
import pytest

from tests.maps.costmap.test_costmap import StateArray
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig
from wayproof.maps.columns import pack
from wayproof.maps.costmap import global_costmap
from wayproof.maps.costmap.global_costmap import BLOCKED, PASSABLE, UNSEEN, GlobalCostmap, holds_run

SIZE = (170, 90, 15)  # cells
LOW, HIGH = (0.0, 0.0, -0.375), (17.0, 9.0, 1.125)
FLOOR = 3
MOTIONS = ("ground", "air")


def crates(rng, states, count, kind=OCCUPIED):
    for low in rng.integers((0, 0, FLOOR + 1), (160, 80, 12), (count, 3)):
        high = low + rng.integers(1, 14, 3)
        states[tuple(map(slice, low, high))] = kind


def room(rng):
    """A room seen in part: floor, crates, and a corner where all is unknown."""
    states = np.full(SIZE, FREE, np.uint8)
    states[:, :, FLOOR] = OCCUPIED
    states[:, :, :FLOOR] = UNKNOWN
    crates(rng, states, 40)
    crates(rng, states, 10, UNKNOWN)
    states[100:, 50:] = UNKNOWN
    return StateArray(states)


def costmap_of(states, motion):
    margins = CostmapConfig(localization_margin=0.05)
    return Costmap(margins, states, LOW, HIGH, motion, 0.2, 0.4, 0.08, floor=0.05, ceiling=1.1)


def global_of(states, costmap):
    threshold = costmap.collision_distance_sq
    return GlobalCostmap(states, LOW, HIGH, costmap.project, threshold, 2 * costmap.radius)


def reduced(places, cells):
    """Whether any of the cells of each coarse one is set, (nx, ny)."""
    padded = np.pad(places, [(0, -n % cells) for n in places.shape])
    nx, ny = padded.shape
    return padded.reshape(nx // cells, cells, ny // cells, cells).any(axis=(1, 3))


def cells_of(coarse):
    return round(coarse.size / 0.1)


def test_on_the_ground_a_coarse_cell_has_room_where_a_cell_of_the_whole_costmap_has():
    states = room(np.random.default_rng(1))
    costmap = costmap_of(states, "ground")
    coarse = global_of(states, costmap)
    coarse.update()
    passable = costmap.obstacle_clearance[:, :, 0] > costmap.collision_distance_sq
    free = passable & (costmap.state[:, :, 0] == FREE)
    expected = reduced(passable, cells_of(coarse)).astype(int) + reduced(free, cells_of(coarse))
    np.testing.assert_array_equal(coarse.states, expected)
    assert {BLOCKED, UNSEEN, PASSABLE} == set(np.unique(coarse.states).tolist())


def test_in_the_air_no_cell_is_blocked_that_has_room_for_the_ball():
    states = room(np.random.default_rng(2))
    costmap = costmap_of(states, "air")
    coarse = global_of(states, costmap)
    coarse.update()
    passable = (costmap.obstacle_clearance > costmap.collision_distance_sq).any(axis=2)
    room_for_ball = reduced(passable, cells_of(coarse))
    assert (coarse.states[room_for_ball] != BLOCKED).all()
    assert (coarse.states == BLOCKED).sum() > 0.5 * (~room_for_ball).sum()


@pytest.mark.parametrize("motion", MOTIONS)
def test_updates_leave_what_a_new_one_finds(motion, monkeypatch):
    monkeypatch.setattr(global_costmap, "TILE", 16)
    rng = np.random.default_rng(3)
    states = room(rng)
    costmap = costmap_of(states, motion)
    kept = global_of(states, costmap)
    for _ in range(12):
        kept.update()
        fresh = global_of(states, costmap)
        fresh.update()
        np.testing.assert_array_equal(kept.states, fresh.states)
        low = rng.integers(0, (150, 70, 10))
        part = tuple(map(slice, low, low + rng.integers(1, 20, 3)))
        states.set(part, rng.choice([FREE, OCCUPIED, UNKNOWN]))


def turned(angle):
    """Cells (nx, ny) of a wall one cell thick across the room at an angle, rad."""
    x, y = np.meshgrid(np.arange(SIZE[0]) - 85.0, np.arange(SIZE[1]) - 45.0, indexing="ij")
    return np.abs(np.cos(angle) * x + np.sin(angle) * y) <= 0.5 * np.sqrt(2.0)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("angle", np.linspace(0.0, 0.5 * np.pi, 7).tolist()[:-2])
def test_no_way_leads_through_a_wall_one_cell_thick(motion, angle):
    from scipy import ndimage

    states = np.full(SIZE, UNKNOWN, np.uint8)
    states[turned(angle)] = OCCUPIED
    source = StateArray(states)
    coarse = global_of(source, costmap_of(source, motion))
    coarse.update()
    # A move to a diagonal neighbour needs both cells beside it, so it opens no other way.
    areas, count = ndimage.label(coarse.states != BLOCKED)
    assert count >= 2
    assert areas[2, 2] != areas[-3, -3]


@pytest.mark.parametrize("length", [1, 2, 3, 7, 64, 65, 130])
def test_runs_of_bits_are_found_across_words(length):
    rng = np.random.default_rng(length)
    cells = np.zeros((40, 5, 192), np.bool_)
    for column in cells.reshape(-1, 192):
        begin = rng.integers(0, 192)
        column[begin : begin + length - rng.integers(0, 2)] = True
    runs = np.lib.stride_tricks.sliding_window_view(cells, length, axis=2).all(axis=3)
    found = holds_run(pack(cells), length)
    np.testing.assert_array_equal(found, runs.any(axis=2))
    assert 0 < found.sum() < found.size
