"""The completion network: exact sums, its inputs cell by cell, and what it says nothing of."""

import numpy as np
import pytest

from wayproof.harness.prediction import PREDICTORS, Completion, View
from wayproof.harness.prediction.completion import (
    BLOCKS,
    HALF,
    REACH,
    STRIDE,
    Layer,
    check_exact,
    evaluated,
    features_at,
    places_of,
    read_weights,
)
from wayproof.harness.prediction.predictor import NO_OPINION


def view(seed=0, shape=(60, 50)):
    """A strip of columns that were measured, beside some that were not."""
    rng = np.random.default_rng(seed)
    states = rng.choice(3, shape, p=(0.2, 0.6, 0.2))
    states[30:] = 0
    return View(states == 2, states == 1, 0.1)


def naive_features(seen, place):
    """Counts of cells, block by block."""
    parts = []
    for block in BLOCKS:
        for cells in (seen.occupied, seen.free):
            for i in range(-HALF, HALF + 1):
                for j in range(-HALF, HALF + 1):
                    x, y = place[0] + i * block, place[1] + j * block
                    h = block // 2
                    low, high = (
                        (max(x - h, 0), max(y - h, 0)),
                        (max(x + h + 1, 0), max(y + h + 1, 0)),
                    )
                    count = cells[low[0] : high[0], low[1] : high[1]].sum()
                    parts.append(count * (81 // block**2))
    return parts


def test_inputs_count_the_cells_around_a_column():
    seen = view()
    places = np.array([[30, 0], [31, 24], [45, 49], [59, 10]])
    found = features_at(seen, places)
    for row, place in zip(found, places, strict=True):
        np.testing.assert_array_equal(row, naive_features(seen, place))


def test_no_order_of_summation_changes_a_bit():
    layers = read_weights()
    inputs = features_at(view(), places_of(view()))
    order = np.random.default_rng(0).permutation(inputs.shape[1])
    first = Layer(layers[0].weights[order], layers[0].biases)
    expected = evaluated(layers, inputs)
    np.testing.assert_array_equal(evaluated([first, *layers[1:]], inputs[:, order]), expected)
    one_by_one = np.concatenate([evaluated(layers, row[None]) for row in inputs])
    np.testing.assert_array_equal(one_by_one, expected)


def test_weights_whose_sums_do_not_stay_exact_are_refused():
    check_exact(read_weights())
    with pytest.raises(ValueError, match=r"below 2\^53"):
        check_exact([Layer(np.full((4, 1), 2.0**46), np.zeros(1))])


def test_it_says_something_near_what_was_measured_and_nothing_of_it():
    seen = view()
    odds = Completion().log_odds(seen)
    assert odds.shape == seen.occupied.shape
    assert (odds[30:48] != NO_OPINION).all()
    assert (odds[30 + REACH + STRIDE :] == NO_OPINION).all()


def test_nothing_measured_is_nothing_predicted():
    none = np.zeros((20, 20), bool)
    assert (Completion().log_odds(View(none, none, 0.1)) == NO_OPINION).all()


def test_other_cells_are_refused():
    none = np.zeros((20, 20), bool)
    with pytest.raises(ValueError, match=r"for cells of 0\.1 m"):
        PREDICTORS["completion"]().log_odds(View(none, none, 0.05))


def test_a_wall_goes_on_behind_its_end_and_the_middle_of_a_hall_is_free():
    """What it learned: a straight wall that was seen in part."""
    occupied, free = np.zeros((120, 80), bool), np.zeros((120, 80), bool)
    free[10:60, 20:60] = True
    occupied[10:60, 60:62] = occupied[10:60, 18:20] = True
    odds = Completion().log_odds(View(occupied, free, 0.1))
    assert odds[62:66, 60].min() > odds[62:66, 40].max()
