"""Plots of means over severity."""

import math

import pytest
from matplotlib.figure import Figure

from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.report.plots import DOWN, UP, Curve, _draw_curve, _limits

DOSES = [(0.0, 0.0), (3.0, 0.02), (5.0, 0.09)]


def drawn(*means, top=None):
    curve = Curve("", DOSES, means)
    limits = _limits([curve], top)
    axes = Figure().add_subplot()
    _draw_curve(axes, curve, 0.0, 0, limits)
    axes.set_ylim(*limits)
    arrows = {
        (line.get_marker(), *line.get_xdata())
        for line in axes.lines
        if line.get_marker() in (UP, DOWN)
    }
    return limits, arrows


def test_a_wide_interval_does_not_press_the_means_together():
    (low, high), arrows = drawn(
        Interval(0.5, 0.45, 0.55), Interval(0.48, 0.2, 13.5), Interval(0.3, 0.25, 0.35)
    )
    assert low <= 0.0
    assert 0.55 < high < 2.0
    assert arrows == {(UP, 3.0)}


@pytest.mark.parametrize(("end", "arrow"), [("low", DOWN), ("high", UP)])
def test_an_end_that_is_unknown_is_an_arrow_and_no_short_bar(end, arrow):
    ends = {"low": 9.0, "high": 11.0, end: -math.inf if end == "low" else math.inf}
    (low, high), arrows = drawn(Interval(10.0, ends["low"], ends["high"]), None, None)
    assert arrows == {(arrow, 0.0)}
    assert math.isfinite(low)
    assert math.isfinite(high)


def test_narrow_intervals_are_whole_and_without_arrows():
    (low, high), arrows = drawn(*[Interval(x, x - 0.1, x + 0.1) for x in (1.0, 2.0, 3.0)])
    assert not arrows
    assert low <= 0.9
    assert high >= 3.1


def test_rates_have_the_axis_of_rates():
    assert drawn(Interval(0.0, 0.0, 0.5), None, None, top=1.0)[0] == (-0.03, 1.03)
    assert drawn(None, None, None)[0] == (0.0, 1.0)
