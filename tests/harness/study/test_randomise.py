"""Settings drawn for each seed."""

import pytest

from wayproof.harness.config_document import value_of
from wayproof.harness.errors import InputError
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.randomise import drawn

AISLE, CRATES = "world.warehouse.aisle_width", "world.warehouse.crates"


def study(**fields):
    given = {"name": "s", "worlds": ["warehouse"], "robots": ["drone"], "seeds": 30, **fields}
    return StudyFile(**given)


def test_values_are_in_range_of_their_type_and_the_same_in_every_arm():
    ranges = {AISLE: [1.6, 2.4], CRATES: [3, 5]}
    planned = plan_episodes(study(randomise=ranges, perturbations={"pose_drift": [2]}))
    by_seed = {}
    for one in planned:
        values = value_of(one.config, AISLE), value_of(one.config, CRATES)
        assert by_seed.setdefault(one.seed, values) == values
    aisles, crates = zip(*by_seed.values(), strict=True)
    assert 1.6 <= min(aisles) < 1.8 < 2.2 < max(aisles) <= 2.4
    assert len(set(aisles)) == 30
    assert set(crates) == {3, 4, 5}
    assert all(isinstance(one, int) for one in crates)


def test_a_range_that_is_added_leaves_the_others_alone():
    assert drawn({CRATES: [3, 5], AISLE: [1.6, 2.4]}, 7)[1:] == drawn({AISLE: [1.6, 2.4]}, 7)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"randomise": {"world.warehouse.isle": [1, 2]}}, "unknown setting in"),
        ({"randomise": {AISLE: [2.4, 1.6]}}, "expected .least, greatest. value"),
        ({"randomise": {AISLE: [1.6]}}, "expected .least, greatest. value"),
        ({"randomise": {AISLE: [1.6, 9.0]}}, "aisle_width: got .*, expected 0.8 to 2.6 m"),
        ({"randomise": {AISLE: [1.6, 2.4]}, "settings": {AISLE: 2.0}}, "set elsewhere"),
        ({"randomise": {"seed": [1, 2]}}, "seed: set elsewhere"),
        (
            {"randomise": {CRATES: [0, 2]}, "worlds": [], "recordings": ["x.clf"]},
            "draws for worlds, and it has recordings",
        ),
        ({"randomise": {CRATES: [0.5, 2.5]}}, "crates: expected `int"),
    ],
)
def test_a_wrong_range_is_refused_before_anything_runs(fields, message):
    with pytest.raises(InputError, match=message):
        plan_episodes(study(**fields))
