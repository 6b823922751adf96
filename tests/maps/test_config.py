import math

import pytest

from wayproof.maps import MAPS, CostmapConfig, MapConfig


def test_the_default_is_valid_and_registered():
    assert MapConfig().kind in MAPS


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("resolution", -0.1),
        ("resolution", math.nan),
        ("log_odds_hit", 0.0),
        ("log_odds_miss", 11.0),
        ("prob_min", 0.5),
        ("prob_max", 1.0),
        ("half_life", -1.0),
        ("decay_period", 0.0),
        ("minimum_range", -0.1),
        ("no_return", "lost"),
    ],
)
def test_a_bad_value_names_its_field(field, value):
    with pytest.raises(ValueError, match=rf"^map\.{field}: got .*, expected .*$"):
        MapConfig(**{field: value})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("localization_margin", math.inf),
        ("cost_scaling_factor", 0.0),
        ("cost_range", -0.1),
        ("unknown_policy", "ignore"),
        ("max_slope", math.nan),
    ],
)
def test_a_bad_value_of_a_costmap_names_its_field(field, value):
    with pytest.raises(ValueError, match=rf"^costmap\.{field}: got .*, expected .*$"):
        CostmapConfig(**{field: value})


def test_the_message_is_one_clear_line():
    with pytest.raises(ValueError, match=r"^map\.resolution: got -0\.1, expected 0\.01 to 0\.5 m$"):
        MapConfig(resolution=-0.1)
