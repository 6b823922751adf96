"""Predictions as the log holds them."""

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.interface.predictors.live import box_about
from wayproof.harness.prediction.predicted_box import (
    blank_message,
    in_steps,
    prediction_message,
    read_prediction,
)
from wayproof.harness.prediction.predictor import MapBox
from wayproof.maps.columns import Window

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
