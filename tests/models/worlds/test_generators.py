"""Every generator over many seeds: nothing crashes, nothing is shut, each is what it says."""

from dataclasses import replace
from math import hypot
from pathlib import Path

import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from wayproof.models.worlds import WORLDS, Box, Cylinder, is_solvable
from wayproof.models.worlds.layout import slabs_around, with_groups
from wayproof.models.worlds.solvability import (
    AIR_BANDS,
    GROUND_BAND,
    passage_radius,
    shortest_path_length,
)

DENSE = ("office", "forest", "construction", "maze", "cylinders")


@pytest.mark.parametrize("name", DENSE)
def test_the_reference_bodies_pass_and_the_way_is_of_an_episodes_length(name):
    for seed, difficulty in enumerate((0.5, 1.0)):
        world = drawn(name, seed, difficulty)
        radius, ends = passage_radius(difficulty), (world.start, world.goal)
        assert is_solvable(world, radius, GROUND_BAND, *ends)
        assert any(is_solvable(world, radius, band, *ends) for band in AIR_BANDS)
        length = shortest_path_length(world, 0.45, GROUND_BAND, *ends)
        assert hypot(*np.subtract(world.goal, world.start)[:2]) <= length + 1e-9
        assert 5.0 <= length <= 24.0


@pytest.mark.parametrize("name", DENSE)
def test_difficulty_adds_solids(name):
    easy, hard = ([len(drawn(name, s, d).solids) for s in range(2)] for d in (0.0, 1.0))
    assert np.mean(easy) < np.mean(hard)


def test_passages_narrow_beyond_the_middle_alone():
    radii = [passage_radius(d) for d in (0.0, 0.5, 0.75, 1.0)]
    assert radii == pytest.approx([0.75, 0.75, 0.675, 0.6])


@pytest.mark.parametrize("difficulty", [-0.1, 1.5, float("nan")])
def test_a_difficulty_outside_0_to_1_is_refused(difficulty):
    with pytest.raises(ValueError, match="difficulty: got"):
        WORLDS["maze"](0, difficulty)


def test_a_maze_without_loops_has_one_way():
    """Of the four sides of the goal's cell just one lets the way in."""
    world = WORLDS["maze"](2, 1.0)
    ends, pitch, origin = (world.start, world.goal), 2.1, 0.2 - 0.075
    x0, y0 = (origin + int((end - origin) / pitch) * pitch for end in world.goal[:2])
    x1, y1 = x0 + pitch, y0 + pitch
    sides = [((x0, y0), (x0, y1)), ((x1, y0), (x1, y1)), ((x0, y0), (x1, y0)), ((x0, y1), (x1, y1))]
    shutting = 0
    for (a, b), (c, d) in sides:
        door = Box.between((a - 0.05, b - 0.05, 0.0), (c + 0.05, d + 0.05, 3.0), "wall")
        shut = replace(world, solids=(*world.solids, door))
        shutting += not is_solvable(shut, 0.3, GROUND_BAND, *ends)
    assert shutting == 1


def test_offices_hide_boards_and_legs_from_a_grid_at_one_height():
    world = drawn("office", 1, 1.0)
    pieces = [solid for solid in world.solids if solid.kind == "furniture"]
    legs = [solid for solid in pieces if isinstance(solid, Cylinder)]
    boards = [solid for solid in pieces if solid.bottom > GROUND_BAND[1]]
    assert len(legs) >= 8
    assert boards
    assert all(leg.radius < 0.03 for leg in legs)


def test_a_site_has_holes_with_barriers_up_to_the_middle_and_without_at_the_end():
    for difficulty, guarded in ((0.5, True), (1.0, False)):
        for seed in range(2):
            world = drawn("construction", seed, difficulty)
            posts = [s for s in world.solids if s.kind == "barrier" and isinstance(s, Cylinder)]
            assert bool(posts) == guarded
            assert len(world.floor) > 1
            bare = replace(world, floor=None)
            assert is_solvable(bare, 0.45, GROUND_BAND, world.start, world.goal)


def test_slabs_leave_the_holes_and_nothing_else():
    holes = [((2.0, 1.0), (3.0, 2.5)), ((2.5, 4.0), (5.0, 5.0))]
    slabs = slabs_around((10.0, 6.0), holes)
    for slab in slabs:
        assert (slab.bottom, slab.top) == pytest.approx((-0.3, 0.0))
    area = sum(4 * slab.half_extents[0] * slab.half_extents[1] for slab in slabs)
    assert area == pytest.approx(60.0 - 1.5 - 2.5)
    points = [(2.5, 2.0), (3.0, 4.5), (2.5, 3.0), (1.0, 1.0)]
    apart = np.min([slab.distance_in_plane(points, (-1.0, 1.0)) for slab in slabs], axis=0)
    assert (apart > 0.0).tolist() == [True, True, False, False]


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_the_page_of_worlds_shows_every_one(name):
    docs = Path(__file__).parents[3] / "docs"
    page = (docs / "worlds.md").read_text()
    assert f"| `{name}` |" in page
    assert f"![{name}](world-{name}.png)" in page
    assert (docs / f"world-{name}.png").is_file()


def test_a_draft_that_nothing_can_cross_is_not_furnished():
    room = WORLDS["empty"](0)
    crate = Box.between((5.0, 5.0, 0.0), (5.5, 5.5, 0.5), "crate")
    west, east = sorted((room.start[0], room.goal[0]))
    middle = (west + east) / 2.0
    wall = Box.between((middle - 0.1, 0.0, 0.0), (middle + 0.1, 12.0, 3.0), "wall")
    closed = replace(room, solids=(*room.solids, wall))
    taken = []

    def groups():
        for group in ((crate,),):
            taken.append(group)
            yield [group]

    assert with_groups(closed, groups()) == closed
    assert not taken
    assert len(with_groups(room, groups()).solids) == len(room.solids) + 1
