"""Which pieces of a recorded way are legs, and what a turn at its end says."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.harness.shadow.conftest import BODY, shadowed, verdict_on, written
from wayproof.harness.shadow.legs import Leg, Piece, legs_of
from wayproof.harness.shadow.summary import Summary

LONG = (-0.2, 0.2)
"""Offsets of the discs of a long body, m."""

ROUND_BODY = BODY.replace("radius = 0.25", "radius = 0.2")
LONG_BODY = BODY.replace(
    "radius = 0.25", "radius = 0.6\ndiscs = [[-0.4, 0.2], [0.0, 0.2], [0.4, 0.2]]"
)


def piece(number: int, *poses: tuple[float, float], why: str = "") -> Piece:
    """Return the way of a second through poses (x, heading)."""
    begin = number * 10**9
    rows = np.array([[x, 0.0, 0.3, heading] for x, heading in poses])
    return Piece(number, begin, begin + 10**9, rows, not why, why, ())


DRIVE = piece(0, (0.0, 0.0), (0.1, 0.0))
REFUSED = piece(1, (0.1, 0.0), (0.1, 1.6), (0.1, 3.1), why="occupied")


def states_of(legs: list[Leg]) -> list[tuple[int, str, float]]:
    return [(leg.sequence, leg.why, round(leg.length_m, 6)) for leg in legs]


def test_a_turn_of_a_long_body_at_the_end_belongs_to_the_last_leg() -> None:
    assert states_of(legs_of([DRIVE, REFUSED], LONG)) == [(1, "occupied", 0.1)]
    free = replace(REFUSED, admitted=True, why="")
    assert states_of(legs_of([DRIVE, free], LONG)) == [(0, "", 0.1)]


def test_a_turn_in_small_pieces_is_a_turn() -> None:
    headings = np.linspace(0.0, 0.3, 5)  # 0.2 m x 0.26 rad is a step
    turns = [
        piece(1 + k, (0.1, a), (0.1, b), why="occupied" if k == 1 else "")
        for k, (a, b) in enumerate(itertools.pairwise(headings))
    ]
    assert states_of(legs_of([DRIVE, *turns], LONG)) == [(2, "occupied", 0.1)]
    assert states_of(legs_of([DRIVE, *turns[:3]], LONG)) == [(0, "", 0.1)]


def test_a_round_body_at_rest_has_no_leg_however_it_turns() -> None:
    assert states_of(legs_of([DRIVE, REFUSED])) == states_of(legs_of([DRIVE, REFUSED], (0.0,)))
    assert states_of(legs_of([DRIVE, REFUSED])) == [(0, "", 0.1)]


def test_what_comes_near_a_body_at_rest_is_no_way_of_it() -> None:
    rest = piece(2, (0.1, 3.1), (0.12, 3.1), why="occupied")
    assert states_of(legs_of([DRIVE, replace(rest, sequence=1)], LONG)) == [(0, "", 0.1)]
    turn = replace(REFUSED, admitted=True, why="")
    assert states_of(legs_of([DRIVE, turn, rest], LONG)) == [(0, "", 0.1)]


def test_a_turn_alone_shows_nothing() -> None:
    assert legs_of([REFUSED], LONG) == []


@pytest.mark.parametrize(
    ("body", "verdict"), [(LONG_BODY, "not admitted"), (ROUND_BODY, "admitted")]
)
def test_a_long_body_that_turns_across_a_corridor_at_the_end_is_not_admitted(
    body: str, verdict: str, tmp_path: Path
) -> None:
    """The corridor is 1 m wide: a round body turns in it, one of 1.2 m does not."""
    (tmp_path / "body.toml").write_text(body)
    poses = [(0.1 * k, 0.0, 0.0) for k in range(20)]
    turned = [(1.9, 0.0, heading) for heading in np.linspace(0.1, 1.5, 8)]

    def judged(name: str, driven: list[tuple[float, float, float]]) -> Summary:
        recording = written(tmp_path / f"{name}.clf", driven, half_width=0.5)
        log = shadowed(recording, tmp_path / "body.toml", tmp_path / f"{name}.mcap")
        summary: Summary = verdict_on(log)
        return summary

    straight, turning = judged("straight", poses), judged("turning", poses + turned)
    assert straight.verdict == "admitted"
    assert turning.verdict == verdict
    assert turning.driven_m == pytest.approx(straight.driven_m)
    assert turning.admitted_share == (
        1.0 if verdict == "admitted" else pytest.approx(0.95, abs=0.02)
    )
