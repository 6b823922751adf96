"""Parameters of the generated worlds: bounds, and what each changes."""

import dataclasses
from typing import get_type_hints

import numpy as np
import pytest

from tests.models.drawn_worlds import drawn
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds import WORLDS, with_traffic

KINDS = {"world": WorldParameters} | {
    f"world.{entry.name}": entry.default_factory
    for entry in dataclasses.fields(WorldParameters)
    if entry.name in WORLDS
}


def made(world, seed=3, difficulty=0.5, passage_radius=None, **own):
    section = {world: KINDS[f"world.{world}"](**own)} if own else {}
    return WORLDS[world](seed, difficulty, WorldParameters(passage_radius, **section))


def sizes(world, kind):
    """Full extents of the solids of a kind, m."""
    return np.array([np.subtract(one.high, one.low) for one in world.solids if one.kind == kind])


@pytest.mark.parametrize("section", sorted(KINDS))
def test_every_number_has_bounds_that_are_checked(section):
    kind = KINDS[section]
    hints = get_type_hints(kind, include_extras=True)
    intervals = {name: hint.__metadata__[0] for name, hint in hints.items() if name not in WORLDS}
    assert {entry.name for entry in dataclasses.fields(kind)} - set(WORLDS) == set(intervals)
    for name, (low, high, unit) in intervals.items():
        for value in (low - 1e-3, high + 1e-3, float("nan")):
            with pytest.raises(ValueError, match=f"{section}.{name}: got .*, expected .*{unit}"):
                kind(**{name: value})


@pytest.mark.parametrize("world", sorted(WORLDS))
def test_a_world_follows_from_its_seed_and_the_defaults_are_no_parameters(world):
    once, again, other = made(world), drawn(world, 3), drawn(world, 1)
    assert once == again
    assert once.mjcf() == again.mjcf()
    assert once != dataclasses.replace(other, seed=3)


def test_one_parameter_leaves_the_draws_of_others_alone():
    given = [made("warehouse", crates=count).mjcf() for count in range(6, 13)]
    assert made("warehouse").mjcf() in given


def test_length_and_width_are_those_of_the_world():
    larger = made("empty", length=24.0, width=16.0)
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


def test_narrow_passages_need_a_smaller_disc():
    with pytest.raises(RuntimeError, match=r"none of 100 drafts lets a disc of 0.75 m"):
        made("corridor", width=1.2, crates=0)
    narrow = made("corridor", width=1.2, passage_radius=0.4)
    assert with_traffic(narrow, 1, 1.0, 0).name == "corridor"  # by the way of the smaller disc


def test_traffic_added_twice_has_names_of_its_own():
    world = with_traffic(with_traffic(made("empty"), 2, 1.0, 0), 2, 1.0, 1)
    assert [mover.name for mover in world.movers] == [f"passer_by_{n}" for n in range(4)]
