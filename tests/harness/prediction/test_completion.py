"""The completion network: exact sums, inputs cell by cell; predictions as the log holds them."""

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.interface.predictors.live import box_about
from wayproof.harness.prediction import Completion, View
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
from wayproof.harness.prediction.predicted_box import (
    blank_message,
    in_steps,
    prediction_message,
    read_prediction,
)
from wayproof.harness.prediction.predictor import NO_OPINION, MapBox
from wayproof.maps.columns import Window


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


def test_a_wall_goes_on_behind_its_end_and_the_middle_of_a_hall_is_free():
    """What it learned: a straight wall that was seen in part."""
    occupied, free = np.zeros((120, 80), bool), np.zeros((120, 80), bool)
    free[10:60, 20:60] = True
    occupied[10:60, 60:62] = occupied[10:60, 18:20] = True
    odds = Completion().log_odds(View(occupied, free, 0.1))
    assert odds[62:66, 60].min() > odds[62:66, 40].max()


AREA = Window(0.1, (-50, -40, -1), (100, 80, 30))


def box(states):
    window = Window(0.1, (10, 20, -1), states.shape)
    return MapBox(0, 4, window, states, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def test_log_odds_become_sixteenths_of_what_was_not_measured():
    states = np.zeros((4, 5, 6), np.uint8)
    states[1, 1, 1] = 2
    answer = np.zeros((4, 5, 6))
    answer[1, 1, 1] = answer[1, 1, 2] = 1.0
    answer[3, 2, 4], answer[2, 2, 2] = -100.0, 0.03
    asked = box(states)
    message = prediction_message(blank_message(4, 7, "p"), asked, in_steps(answer, asked))
    found = read_prediction(message)
    assert found.first == (11, 21, 1)
    assert found.log_odds.shape == (3, 2, 3)
    held = {tuple(cell): int(found.log_odds[tuple(cell)]) for cell in np.argwhere(found.log_odds)}
    assert held == {(0, 0, 0): 16, (2, 1, 2): -127}


def test_columns_and_nothing_at_all():
    asked = box(np.zeros((4, 5, 6), np.uint8))
    columns = np.zeros((4, 5), np.float32)
    columns[2, 3] = 2.0
    found = read_prediction(
        prediction_message(blank_message(4, 7, "p"), asked, in_steps(columns, asked))
    )
    assert (found.first[:2], found.log_odds.tolist()) == ((12, 23), [[32]])
    nothing = prediction_message(blank_message(4, 7, "p"), asked, np.zeros((4, 5, 6), np.int8))
    assert nothing == blank_message(4, 7, "p")
    assert read_prediction(nothing) is None


@pytest.mark.parametrize(
    "change",
    [
        {"shape": [3, 2]}, {"shape": [3]}, {"shape": [1 << 20, 1 << 20, 1]}, {"first": [1, 2]},
        {"first": [1 << 40, 0, 0]}, {"log_odds": b"none"}, {"log_odds": b""},
    ],
)  # fmt: skip
def test_a_damaged_prediction_is_refused(change):
    asked = box(np.zeros((4, 5, 6), np.uint8))
    message = prediction_message(blank_message(4, 7, "p"), asked, np.full((4, 5, 6), 8, np.int8))
    for name, value in change.items():
        message.ClearField(name)
        if isinstance(value, bytes):
            setattr(message, name, value)
        else:
            getattr(message, name).extend(value)
    with pytest.raises(InputError, match="prediction of decision 4"):
        read_prediction(message)


def test_the_box_is_about_the_robot_and_ends_with_the_area():
    middle = box_about(np.array([0.05, 0.05, 1.0]), AREA, 20, (None, None, None))
    assert (middle.first, middle.shape) == ((-20, -20, -1), (40, 40, 30))
    corner = box_about(np.array([4.95, 3.95, 1.0]), AREA, 20, (None, None, None))
    assert (corner.first, corner.shape) == ((29, 19, -1), (21, 21, 30))
    outside = box_about(np.array([90.0, -90.0, 1.0]), AREA, 20, (None, None, None))
    assert min(outside.shape) >= 1
    fixed = box_about(np.array([4.95, 3.95, 1.0]), AREA, 20, (10, 12, 16))
    assert (fixed.first, fixed.shape) == ((44, 33, -1), (10, 12, 16))
