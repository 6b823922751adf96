"""Shortest ways in truth, in small worlds and in large ones."""

from dataclasses import replace

import pytest

from wayproof.harness.scenario import places
from wayproof.harness.scenario.places import known_route, route_between
from wayproof.models.worlds import WORLDS, Box, World
from wayproof.models.worlds.layout import room_walls
from wayproof.models.worlds.solvability import AIR_BANDS, GROUND_BAND

WIDE = (1, 3)


@pytest.mark.parametrize(
    ("name", "band"),
    [("warehouse", GROUND_BAND), ("forest", AIR_BANDS[0]), ("office", GROUND_BAND)],
)
def test_a_star_finds_ways_as_short_as_dijkstra(name, band, monkeypatch):
    world = WORLDS[name](3)
    by_dijkstra = route_between(world, 0.45, band, world.start, world.goal)
    monkeypatch.setattr(places, "MOST_CELLS", 0)
    for wide in WIDE:
        extent = (world.high[0] - world.low[0]) * (world.high[1] - world.low[1]) / 0.05**2
        monkeypatch.setattr(places, "MOST_SEARCHED", extent / wide**2 + 1)
        found = route_between(world, 0.45, band, world.start, world.goal)
        assert 0.97 < found / by_dijkstra < 1.03


def test_a_large_hall_has_a_way_until_a_wall_closes_it():
    """Of 120 x 120 m, with a crate on every 64 m^2."""
    low, high = (0.0, 0.0, -0.5), (120.0, 120.0, 3.0)
    start, goal = (2.0, 30.0, 0.0), (118.0, 90.0, 0.0)
    corners = [(x, y + 0.3 * x % 4.0) for x in range(8, 112, 8) for y in range(8, 112, 8)]
    crates = [Box.between((x, y, 0.0), (x + 1.0, y + 1.5, 1.0), "crate") for x, y in corners]
    solids = *room_walls(low, high), *crates
    hall = World("hall", 0, low, high, solids, start=start, start_heading=0.0, goal=goal)
    straight = 130.0  # m: 116 along x, 60 along y
    found = route_between(hall, 0.45, GROUND_BAND, start, goal)
    assert straight < found < 1.05 * straight
    wall = Box.between((60.0, 0.0, 0.0), (60.2, 120.0, 3.0), "wall")
    closed = replace(hall, solids=(*hall.solids, wall))
    assert route_between(closed, 0.45, GROUND_BAND, start, goal) is None


def test_a_route_is_measured_once_for_a_world_and_a_body():
    world = WORLDS["corridor"](3)
    ends = world.start, world.goal
    known = known_route(world, 0.3, GROUND_BAND, *ends)
    assert known == route_between(world, 0.3, GROUND_BAND, *ends)
    assert (
        known_route(WORLDS["corridor"](3), 0.3, GROUND_BAND, *ends) is known
    )  # another, equal one
    wall = Box.between((world.low[0], *world.goal[1:]), (*world.high[:2], 3.0), "wall")
    closed = replace(world, solids=(*world.solids, wall))
    assert known_route(closed, 0.3, GROUND_BAND, *ends) is None
    for other in ((0.35, GROUND_BAND), (0.3, AIR_BANDS[1])):
        assert known_route(world, *other, *ends) == route_between(world, *other, *ends)
