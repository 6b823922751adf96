"""Charts of an episode's page: where lines, areas and blocks lie, by hand."""

import math
import re

import numpy as np
import pytest

from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.report.charts import (
    COLOURS,
    WIDTH,
    Curve,
    Line,
    Mark,
    bars_chart,
    limits_of,
    line_chart,
    nice_ticks,
    stairs,
    strip,
)
from wayproof.harness.study.report.top_view import Tracks, top_view


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [(0.0, 1.0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]), (0.0, 7.0, [0, 2, 4, 6]), (3.0, 3.0, [3.0])],
)
def test_ticks_are_round(low, high, ticks):
    assert nice_ticks(low, high) == pytest.approx(ticks)


def points(svg, shape="polyline"):
    found = re.findall(rf'<{shape} points="([^"]*)"', svg)
    return [[tuple(map(float, one.split(","))) for one in text.split()] for text in found]


def test_a_line_breaks_where_nothing_is_known():
    values = np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    svg = line_chart(np.arange(5.0), [Line("a", "#000", values)])
    assert points(svg) == [[(42, 130), (134.5, 8)], [(319.5, 8), (412, 130)]]


def test_what_exceeds_the_top_is_cut_off():
    svg = line_chart(np.arange(3.0), [Line("a", "#000", np.array([0.0, 100.0, 1.0]))], top=1.0)
    assert points(svg) == [[(42, 130), (227, 8), (412, 8)]]


def test_areas_lie_on_top_of_each_other():
    lines = [Line("a", "#00f", np.array([1.0, 1.0])), Line("b", "#f00", np.array([1.0, 0.0]))]
    svg = line_chart(np.array([0.0, 1.0]), lines, stacked=True)
    above, below = points(svg, "polygon")  # the last one first, so that the others cover it
    assert above == [(42, 130), (42, 8), (412, 69), (412, 130)]
    assert below == [(42, 130), (42, 69), (412, 69), (412, 130)]


def test_marks_and_names_are_text_and_not_markup():
    svg = line_chart(np.arange(2.0), [Line("a", "#000", np.ones(2))], [Mark("<b>", "#f00", 0.5)])
    assert "<title>&lt;b&gt;</title>" in svg
    svg = strip(np.arange(3.0), ["follow", "follow", "<i>"], ["none"] * 3, [False] * 3)
    assert "<i>" not in svg


def test_a_strip_has_a_block_for_each_run_and_a_bar_for_each_label():
    actions = ["follow", "follow", "slow", "follow"]
    labels = ["none", "no_path", "no_path", "none"]
    svg = strip(np.arange(4.0), actions, labels, [False, True, False, False])
    titles = re.findall(r"<title>(.*?)</title>", svg)
    assert titles == [
        "follow, decisions 0 to 1",
        "slow, decisions 2 to 2",
        "follow, decisions 3 to 3",
        "no_path, decisions 1 to 2",
    ]
    assert svg.count("<line") == 1  # the late one


def test_from_above_y_is_up_and_the_end_of_a_failure_is_marked():
    track = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    square = np.array([[0.0, 2.0], [1.0, 2.0], [1.0, 3.0], [0.0, 3.0]])
    svg = top_view(
        [square], Tracks(track, track + np.array([0.0, 0.1]), ((2.0, 1.0),), failed=True)
    )
    believed, true = points(svg)
    (wall,) = points(svg, "polygon")
    assert believed[2][1] < believed[0][1]
    assert max(y for _, y in wall) < min(y for _, y in believed)
    assert true[0][1] < believed[0][1]
    assert "<title>end</title>" in svg
    assert "last chance" not in svg
    fine = top_view(
        [],
        Tracks(track, np.zeros((0, 2)), ((2.0, 1.0), (0.0, 0.0)), failed=False, chance=(2.0, 0.0)),
    )
    assert len(points(fine)) == 1
    assert "last chance" in fine
    assert "<title>goal</title>" in svg
    assert re.findall(r"<title>(goal .*?)</title>", fine) == ["goal 1", "goal 2"]
    low = max(y for some in points(fine) for _, y in some)
    scale = re.search(r'<path d="M8 ([0-9.]+)h', fine)
    assert float(scale[1]) > low + 5.0  # below all that is drawn


def test_the_label_of_the_last_time_stays_within_a_chart():
    svg = strip(np.arange(0.0, 60.1, 0.1), ["follow"] * 601, ["none"] * 601, [False] * 601)
    assert f'<text x="{WIDTH}" y="42" text-anchor="end">60 s</text>' in svg


DOSES = [(0.0, 0.0), (3.0, 0.02), (5.0, 0.09)]


def arrows(*means, top=None):
    """Ends of the axis, and the number of intervals that go on beyond it."""
    curves = [Curve("", DOSES, means)]
    return limits_of(curves, top), len(re.findall(r"l4 -?5l4", bars_chart(curves, "x", "y", top)))


def test_a_wide_interval_does_not_press_the_means_together():
    (low, high), count = arrows(
        Interval(0.5, 0.45, 0.55), Interval(0.48, 0.2, 13.5), Interval(0.3, 0.25, 0.35)
    )
    assert low <= 0.0
    assert 0.55 < high < 2.0
    assert count == 1


@pytest.mark.parametrize("ends", [(-math.inf, 11.0), (9.0, math.inf)])
def test_an_end_that_is_unknown_is_an_arrow_and_no_short_bar(ends):
    (low, high), count = arrows(Interval(10.0, *ends), None, None)
    assert count == 1
    assert math.isfinite(low)
    assert math.isfinite(high)


def test_narrow_intervals_are_whole_and_without_arrows():
    (low, high), count = arrows(*[Interval(x, x - 0.1, x + 0.1) for x in (1.0, 2.0, 3.0)])
    assert count == 0
    assert low <= 0.9
    assert high >= 3.1


def test_rates_have_the_axis_of_rates():
    assert arrows(Interval(0.0, 0.0, 0.5), None, None, top=1.0)[0] == (0.0, 1.0)
    assert arrows(None, None, None)[0] == (0.0, 1.0)


def test_the_share_that_bears_a_severity_falls_at_each_threshold():
    way = re.search(r'<path d="([^"]*)"', stairs([1.0, math.inf], 5.0, "severity"))[1]
    assert way == "M42 8.0H116.0V69.0H412"


def test_curves_of_stacks_stand_in_one_plot():
    rate, names = Interval(0.5, 0.2, 0.8), ("builtin", "gap", "a/mine.py:Mine")
    curves = [Curve(name, DOSES, [rate, None, rate]) for name in names]
    picture = bars_chart(curves, label="pose_drift, %", ylabel="success", top=1.0)
    for name, colour in zip(names, COLOURS, strict=False):
        assert f">{name}</text>" in picture
        assert colour in picture
    alone = bars_chart([Curve("", DOSES, [rate] * 3)], label="x", ylabel="success", top=1.0)
    assert COLOURS[0] in alone
    assert COLOURS[1] not in alone
