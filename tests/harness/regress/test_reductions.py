"""Delta debugging over numbers: what is left fails, and nothing of it can be taken away alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from wayproof.harness.regress.reductions import fewest, first
from wayproof.harness.study.new import toml_of
from wayproof.models.toml_text import parse_toml


def settled(steps, fails) -> Any:
    """What a reduction returns if `fails` says of each thing that it asks for whether it fails."""
    try:
        asked = next(steps)
        while True:
            asked = steps.send([fails(one) for one in asked])
    except StopIteration as stop:
        return stop.value


def kept(case: object, numbers: Sequence[int]) -> Any:
    return frozenset(numbers)


@given(st.integers(0, 40), st.data())
def test_what_is_needed_is_found(count, data):
    needed = data.draw(st.frozensets(st.integers(0, count - 1)) if count else st.just(frozenset()))
    assert settled(fewest(None, count, kept), lambda one: needed <= one) == needed


@given(st.integers(2, 40), st.data())
def test_one_of_two_that_stand_in_for_each_other_is_left(count, data):
    numbers = st.integers(0, count - 1)
    a, b = data.draw(st.lists(numbers, min_size=2, max_size=2, unique=True))
    left = settled(fewest(None, count, kept), lambda one: a in one or b in one)
    assert left in (frozenset({a}), frozenset({b}))


@given(st.lists(st.booleans(), max_size=6))
def test_the_first_that_fails_is_taken(fails):
    numbered = list(enumerate(fails))
    taken = settled(first("given", numbered), lambda one: one[1])
    assert taken == next((one for one in numbered if one[1]), "given")


VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False,
    allow_infinity=False) | st.text(st.characters(codec="utf-8", exclude_characters="\x7f")),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@given(VALUES)
def test_a_value_reads_back_from_toml(value):
    assert parse_toml(f"value = {toml_of(value)}\n")["value"] == value
