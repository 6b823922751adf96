"""TOML that is nested deeper than anything of ours is no TOML."""

import tomllib

import pytest

from wayproof.models.toml_text import parse_toml


@pytest.mark.parametrize(
    "text",
    [
        "a." * 20_000 + "a = 1",
        "a = " + "[" * 20_000 + "]" * 20_000,
        "a = " + "{b = " * 50 + "}" * 50,
    ],
)
def test_what_is_nested_deeply_is_refused(text):
    with pytest.raises(tomllib.TOMLDecodeError):
        parse_toml(text)


def test_a_point_in_a_list_in_a_table_is_not_deep():
    assert parse_toml("[a.b]\nc = [[1, 2], [3, 4]]") == {"a": {"b": {"c": [[1, 2], [3, 4]]}}}
