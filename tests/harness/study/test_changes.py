"""Graded harm: what is surely worse comes first, and an unchanged build shows nothing."""

import numpy as np
import pytest

from tests.harness.study.test_gates import ARM, row
from wayproof.harness.study.analysis import Sample
from wayproof.harness.study.changes import changes_of
from wayproof.harness.study.default_gates import DEFAULT_GATES
from wayproof.harness.study.gate import read_gate
from wayproof.harness.study.gates import gate_in_words, judge
from wayproof.harness.study.lost import lost_in_words, lost_of

BEFORE = (0.441, 0.449, 0.372, 0.401, 0.373, 0.356, 0.404, 0.416)
AFTER = (0.050, 0.323, 0.047, 0.009, 0.004, 0.044, 0.039, 0.070)
"""Least clearances of a stack in eight worlds, and of one whose margin was cut, m."""


def sample(pairs):
    return Sample(ARM, [second for _, second in pairs], pairs, compared=True)


def scraped():
    both = enumerate(zip(BEFORE, AFTER, strict=True))
    return sample([(row(n, least_clearance=a), row(n, least_clearance=b)) for n, (a, b) in both])


def test_scraping_comes_first_and_is_decided_by_eight_worlds():
    first, *others = changes_of([scraped()], 60.0)
    assert (first.metric, first.side, first.worse, first.worlds) == ("least_clearance", "bad", 8, 8)
    assert first.before - first.after == pytest.approx(np.mean(BEFORE) - np.mean(AFTER))
    assert not any(one.side for one in others)
    assert "worse in 8 of 8 worlds" in first.in_words()
    gates = judge([scraped()], [read_gate(text) for text in DEFAULT_GATES], 60.0)
    assert gates[2].verdict == "failed", gate_in_words(gates[2])


def test_an_estimate_beyond_the_bound_says_how_many_worlds_would_show_it_broken():
    some = sample(scraped().pairs[:4])
    [gate] = judge([some], [read_gate("least_clearance.drop <= 0.1")], 60.0)
    assert gate.verdict == "inconclusive"
    assert "worlds would show it failed if the estimate stayed" in gate_in_words(gate)


def test_two_pairs_show_no_side():
    two = sample([(row(n, ate=0.0), row(n, ate=9.0)) for n in range(2)])
    assert {one.metric: one.side for one in changes_of([two], 60.0)}["ate"] == ""


def test_a_difference_too_small_to_matter_has_no_side():
    pairs = [(row(n, ate=0.1), row(n, ate=0.1001 + 1e-6 * n)) for n in range(20)]
    [change] = [one for one in changes_of([sample(pairs)], 60.0) if one.metric == "ate"]
    assert change.p_value < 0.01
    assert change.side == ""


def test_a_metric_of_neither_build_is_left_out():
    changes = changes_of([sample([(row(n), row(n)) for n in range(6)])], 60.0)
    assert {one.metric for one in changes} == {"success", "collisions"}
    assert {one.p_value for one in changes} == {1.0}


def test_unchanged_builds_seldom_show_a_difference():
    generator = np.random.default_rng(3)
    false = 0
    for _ in range(200):
        values = generator.normal(0.4, 0.1, (8, 2, 3))
        pairs = [
            tuple(row(n, least_clearance=own[0], jerk=own[1], time_to_goal=own[2]) for own in both)
            for n, both in enumerate(values)
        ]
        false += any(one.side for one in changes_of([sample(pairs)], 60.0))
    assert false <= 16  # 5 % of 200, and two deviations


def test_what_was_won_before_is_lost_first_with_its_command():
    rows = [row(1, outcome="timeout"), row(2, outcome="collision"), row(3)]
    pairs = [(row(1, outcome="timeout"), rows[0]), (row(2), rows[1])]
    lost = lost_of(rows, pairs)
    assert [(one.seed, one.won_before) for one in lost] == [(2, True), (1, False)]
    assert lost_in_words(lost)[0].startswith(
        "lost (won before): warehouse drone, seed 2: collision"
    )
