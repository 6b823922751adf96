"""Goals by name, and legs that no body can pass."""

from dataclasses import replace

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.scenario.places import goals_of, refuse_no_way
from wayproof.harness.scenario.scenario import build
from wayproof.models.robots import ROBOTS
from wayproof.models.world_parameters import PLACES
from wayproof.models.worlds import WORLDS, Box, World, is_solvable
from wayproof.models.worlds.solvability import GROUND_BAND

ROOM = World("room", 0, (0, 0, -0.5), (10, 10, 3), (), (1, 1, 0), 0.0, (9, 9, 0))


@pytest.mark.parametrize("name", PLACES)
def test_every_place_has_points(name):
    config = override(Config("warehouse", "drone", 1), [f"goal={name}"])
    assert len(goals_of(config, WORLDS["warehouse"](1))) == (3 if name == "aisle" else 1)


def test_places_resolve_in_order():
    config = override(
        Config("empty", "drone", 1), ['waypoints=["world",[2,3]]', "goal=home", "start=[5,6,1]"]
    )
    world = WORLDS["empty"](1)
    assert goals_of(config, world) == (world.goal[:2], (2.0, 3.0), (5.0, 6.0, 1.0))


@pytest.mark.parametrize("world", ["warehouse", "office"])
@pytest.mark.parametrize("seed", range(2))
def test_an_aisle_can_be_reached_and_driven_along(world, seed):
    made = WORLDS[world](seed)
    config = override(Config(world, "quadruped", seed), ['waypoints=["aisle"]', "goal=home"])
    first, middle, last, home = goals_of(config, made)
    assert home == made.start[:2]
    for begin, end in ((made.start, first), (first, middle), (middle, last), (last, home)):
        assert is_solvable(made, 0.6, GROUND_BAND, begin, end)
    (x0, y0), (x1, y1) = first, last
    assert abs(x1 - x0) + abs(y1 - y0) > 4.0
    for robot in ("quadruped", "drone"):
        resolved = build(replace(config, robot=robot))
        assert len(resolved.mission.goals) == 4
        assert resolved.route_length() > 8.0


def test_a_leg_behind_a_wall_is_refused_for_a_robot_on_the_ground():
    wall = Box.between((4.9, 0.0, 0.0), (5.1, 10.0, 3.0), "wall")
    divided = replace(ROOM, solids=(wall,))
    spec = ROBOTS["quadruped"].spec
    start, near, far = (1.0, 1.0, 0.3), (4.0, 4.0, 0.3), (8.0, 8.0, 0.3)
    refuse_no_way(ROOM, spec, start, (near, far))
    refuse_no_way(divided, spec, start, (near, start))
    with pytest.raises(InputError, match=r"goal 2 of 2: got \(8, 8\), which nothing as wide"):
        refuse_no_way(divided, spec, start, (near, far))
    refuse_no_way(divided, spec, start, (far,))  # of one goal the cause of the failure says so
    refuse_no_way(divided, ROBOTS["drone"].spec, start, (near, far))
