"""Prior maps of another day and out of place."""

import math

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override, with_perturbation
from wayproof.harness.errors import InputError
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.prior.cells import unpacked
from wayproof.harness.scenario.prior_maps import with_prior
from wayproof.harness.scenario.worlds import find_world
from wayproof.maps import OCCUPIED
from wayproof.models.worlds.shifted import MOVABLE, movable_groups


def world_of(name, seed=4):
    return find_world(Config(name, "drone", seed))


def shown(name, text, seed=4):
    return perturbation_from(text).change_prior(world_of(name, seed), seed)


def prior(name, text=None, *settings):
    config = override(Config(name, "drone", 4), ["prior.source=truth", *settings])
    if text is not None:
        config = with_perturbation(config, perturbation_from(text))
    return unpacked(with_prior(config, find_world(config)).prior_map)


@pytest.mark.parametrize("name", ["warehouse", "office"])
def test_each_thing_stands_elsewhere_as_a_whole(name):
    world, other = world_of(name), shown(name, "stale_prior:4")
    moved = 0
    for group in movable_groups(world.solids):
        offsets = {
            tuple(np.round(np.subtract(other.solids[k].low, world.solids[k].low), 6)) for k in group
        }
        assert len(offsets) == 1
        x, y, z = offsets.pop()
        assert (math.hypot(x, y), z) == pytest.approx((0.7, 0.0), abs=1e-5)
        moved += len(group)
    same = [a == b for a, b in zip(world.solids, other.solids, strict=True)]
    assert same.count(False) == moved
    assert {s.kind for s, kept in zip(world.solids, same, strict=True) if not kept} <= set(MOVABLE)


def test_an_aisle_is_shifted_across_the_way_by_all_things_together():
    world, other = world_of("warehouse"), shown("warehouse", "stale_prior:3:aisle")
    offsets = {
        tuple(np.round(np.subtract(b.low, a.low), 6))
        for a, b in zip(world.solids, other.solids, strict=True)
        if a != b
    }
    assert len(offsets) == 1
    offset = np.array(offsets.pop())
    way = np.subtract(world.goal, world.start)
    assert np.linalg.norm(offset) == pytest.approx(0.4, abs=1e-5)
    assert offset @ way == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(("severity", "share"), [(1, 0.1), (3, 0.4), (5, 1.0)])
def test_doorways_are_closed_down_to_the_floor(severity, share):
    world, other = world_of("office"), shown("office", f"stale_prior:{severity}:doors")
    doors = [k for k, solid in enumerate(world.solids) if solid.kind == "lintel"]
    closed = [k for k in doors if other.solids[k].low[2] == 0.0]
    assert len(closed) == max(round(share * len(doors)), 1)
    for k in closed:
        assert other.solids[k].high == pytest.approx(world.solids[k].high)
        assert other.solids[k].low[:2] == pytest.approx(world.solids[k].low[:2])


@pytest.mark.parametrize("name", ["warehouse", "maze"])
def test_a_share_of_the_things_is_missing(name):
    world, other = world_of(name), shown(name, "stale_prior:3:gone")
    groups = movable_groups(world.solids)
    gone = [solid for solid in world.solids if solid not in other.solids]
    whole = [group for group in groups if all(world.solids[k] in gone for k in group)]
    assert len(whole) == max(round(0.4 * len(groups)), 1)
    assert len(gone) == sum(map(len, whole))


def test_a_shifted_map_is_the_same_map_elsewhere():
    seed_shift = perturbation_from("stale_prior:5:shift").misplacement(4)
    assert math.hypot(seed_shift.x, seed_shift.y) == pytest.approx(1.0)
    plain = prior("warehouse", None, f"prior.x={seed_shift.x!r}", f"prior.y={seed_shift.y!r}")
    moved = prior("warehouse", "stale_prior:5:shift")
    assert moved.first == plain.first
    np.testing.assert_array_equal(moved.states, plain.states)


def test_a_turned_map_is_off_by_the_amount_at_ten_metres():
    turned = perturbation_from("stale_prior:4:turn").misplacement(4)
    assert (turned.x, turned.y, abs(turned.turn)) == (0.0, 0.0, pytest.approx(0.07))
    truth, moved = prior("warehouse"), prior("warehouse", "stale_prior:4:turn")
    assert np.count_nonzero(moved.states == OCCUPIED) == pytest.approx(
        np.count_nonzero(truth.states == OCCUPIED), rel=0.25
    )
    assert moved.states.shape != truth.states.shape or (moved.states != truth.states).any()


def test_the_same_seed_gives_the_same_map_and_another_one_another():
    a, b, c = (shown("warehouse", "stale_prior:2", seed) for seed in (4, 4, 5))
    assert a == b
    assert a.solids != c.solids


def test_what_has_no_door_and_what_is_a_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no doorway to close"):
        prior("maze", "stale_prior:3:doors")
    with pytest.raises(InputError, match="nothing can be moved in the map of a file"):
        prior("warehouse", "stale_prior:3", "prior.source=some.map")
