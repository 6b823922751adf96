"""Parameters of the generated worlds: bounds, and what each changes."""

import dataclasses

import numpy as np
import pytest

from wayproof.models.world_parameters import WorldParameters, intervals_of
from wayproof.models.worlds import WORLDS, with_traffic

KINDS = {entry.name: entry.default_factory for entry in dataclasses.fields(WorldParameters)}


def made(world, seed=3, difficulty=0.5, **parameters):
    return WORLDS[world](seed, difficulty, KINDS[world](**parameters))


def sizes(world, kind):
    """Full extents of the solids of a kind, m."""
    return np.array([np.subtract(one.high, one.low) for one in world.solids if one.kind == kind])


def test_every_world_has_parameters():
    assert list(KINDS) == list(WORLDS)


@pytest.mark.parametrize("world", sorted(WORLDS))
def test_every_number_has_bounds_that_are_checked(world):
    kind = KINDS[world]
    intervals = intervals_of(kind)
    assert set(intervals) == {entry.name for entry in dataclasses.fields(kind)}
    for name, (low, high, unit) in intervals.items():
        for value in (low - 1e-3, high + 1e-3, float("nan")):
            with pytest.raises(
                ValueError, match=f"world.{world}.{name}: got .*, expected .*{unit}"
            ):
                kind(**{name: value})


@pytest.mark.parametrize("world", sorted(WORLDS))
def test_the_defaults_are_the_world_without_parameters(world):
    assert made(world) == WORLDS[world](3, 0.5)


@pytest.mark.parametrize(
    ("world", "parameters"),
    [
        ("office", {"hallway_width": 2.4 + 0.5 * (2.0 - 2.4), "door_width": 1.75, "furniture": 12}),
        ("forest", {"trees": 28, "bushes": 5, "branch_share": 0.2 + 0.5 * 0.5}),
        ("construction", {"pieces": 11, "unguarded_share": 0.0}),
        ("maze", {"pitch": 2.35, "loop_share": 0.2}),
        ("cylinders", {"filled_share": 0.22}),
        ("crossing", {"movers": 5}),
        ("ghosts", {"panels": 7}),
    ],
)
def test_what_the_difficulty_sets_may_be_set_to_the_same(world, parameters):
    ours, theirs = made(world, **parameters), made(world)
    assert ours.mjcf() == theirs.mjcf()
    assert ours.movers == theirs.movers


def test_one_parameter_leaves_the_draws_of_others_alone():
    wide, narrow = (
        made("warehouse", crates=0, door_width=width, passage_radius=0.5) for width in (1.7, 1.2)
    )
    assert wide.start == narrow.start
    assert [one for one in wide.solids if one.kind == "shelf"] == [
        one for one in narrow.solids if one.kind == "shelf"
    ]
    assert sizes(narrow, "lintel")[:, 1] == pytest.approx(1.2, abs=1e-3)


@pytest.mark.parametrize("world", ["warehouse", "empty", "office", "forest", "cylinders", "ghosts"])
def test_length_and_width_are_those_of_the_world(world):
    larger = made(world, length=24.0, width=16.0)
    assert larger.high[:2] == (24.0, 16.0)
    assert larger.goal[0] < 24.0


def test_the_aisles_of_a_warehouse_are_at_least_as_wide():
    for aisle in (1.6, 2.4):
        world = made("warehouse", aisle_width=aisle, crates=0)
        beams = sizes(world, "overhang")[:, :2]
        assert (beams.max(axis=1) >= aisle - 1e-6).all()  # each reaches across its aisle


def test_counts_are_greatest_numbers():
    assert sizes(made("warehouse", crates=0), "crate").size == 0
    assert len(made("corridor", crates=6, seed=4).solids) > 6
    assert made("crossing", movers=0).movers == ()
    assert len(made("ghosts", panels=20).movers) == 20
    assert len(sizes(made("office", rooms=2), "door")) == 4
    assert made("construction", holes=0).floor is not None
    assert len(made("construction", holes=0).floor) == 1


def test_bends_and_speeds_are_as_given():
    one, two = (len(sizes(made("corridor", bends=n), "partition")) for n in (1, 2))
    assert (one, two) == (1, 2)
    assert {mover.speed for mover in made("crossing", speed=0.9).movers} == {0.9}
    stays = [one.vanishes - one.appears for one in made("ghosts", longest_stay=4.0).movers]
    assert all(3.0 - 0.1 <= stay <= 4.0 + 0.1 for stay in stays)


def test_narrow_passages_need_a_smaller_disc():
    with pytest.raises(RuntimeError, match=r"none of 100 drafts lets a disc of 0.75 m"):
        made("corridor", width=1.2, crates=0)
    narrow = made("corridor", width=1.2, passage_radius=0.4)
    with pytest.raises(RuntimeError, match=r"lets a disc of 0.7 m through"):
        made("corridor", width=1.2, crates=0, passage_radius=0.7)
    assert with_traffic(narrow, 1, 1.0, 0).name == "corridor"  # by the way of the smaller disc


def test_parameters_that_contradict_each_other_are_refused():
    with pytest.raises(ValueError, match=r"office.rooms: got 6 on 16 m, expected at most 4"):
        made("office", rooms=6)
    with pytest.raises(ValueError, match="shortest_stay: got 20, expected at most 12 s"):
        made("ghosts", shortest_stay=20.0)


def test_traffic_added_twice_has_names_of_its_own():
    world = with_traffic(with_traffic(made("empty"), 2, 1.0, 0), 2, 1.0, 1)
    assert [mover.name for mover in world.movers] == [f"passer_by_{n}" for n in range(4)]
