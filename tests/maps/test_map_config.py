import math

import pytest

from wayproof.maps import MAPS, MapConfig


def test_the_default_is_valid_and_registered():
    assert MapConfig().kind in MAPS


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("resolution", -0.1),
        ("resolution", math.nan),
        ("hit", 0.0),
        ("miss", 11.0),
        ("clamp_low", 0.5),
        ("clamp_high", 1.0),
        ("half_life", -1.0),
        ("decay_period", 0.0),
        ("minimum_range", -0.1),
        ("inflation_margin", math.inf),
        ("cost_scaling_factor", 0.0),
        ("cost_range", -0.1),
        ("unknown_policy", "ignore"),
    ],
)
def test_a_bad_value_names_its_field(field, value):
    with pytest.raises(ValueError, match=rf"^map\.{field}: got .*, expected .*$"):
        MapConfig(**{field: value})


def test_the_message_is_one_clear_line():
    with pytest.raises(ValueError, match=r"^map\.resolution: got -0\.1, expected 0\.01 to 0\.5 m$"):
        MapConfig(resolution=-0.1)


def test_what_cannot_hold_says_so():
    assert MapConfig(kind="dynamic", hold_under_body=0.5).hold_under_body == 0.5
    with pytest.raises(ValueError, match=r"^map\.hold_under_body: got 0\.5 with kind 'tsdf', "):
        MapConfig(kind="tsdf", hold_under_body=0.5)
