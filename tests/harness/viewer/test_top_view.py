"""Pictures of single decisions from above."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from wayproof.harness.cli.main import main
from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.colours import COMMITTED, TRUE
from wayproof.harness.viewer.layer import COLOURS, FRONTIER, INFLATED
from wayproof.harness.viewer.moments import moments
from wayproof.harness.viewer.top_view import Mark, TopView
from wayproof.harness.viewer.words import head
from wayproof.maps import FREE, OCCUPIED, UNKNOWN


def pixels_of(picture):
    with Image.open(picture) as image:
        return np.asarray(image.convert("RGB"))


def share(image, colour):
    """Share of the pixels that have a colour."""
    return (image == colour).all(axis=2).mean()


@pytest.fixture(scope="module")
def moment(log):
    return next(one for one in moments(open_log(log)) if one.decision.sequence == 25)


def test_a_picture_shows_the_map_the_truth_and_the_plan(tmp_path, log):
    out = tmp_path / "x.png"
    assert main(["view", str(log), "--decision", "25", "--png", str(out)]) == 0
    image = pixels_of(out)
    assert image.shape == (840, 700, 3)
    assert share(image, COLOURS[FREE]) > 0.1
    for kind in (UNKNOWN, OCCUPIED, INFLATED):
        assert share(image, COLOURS[kind]) > 0.005
    for colour in (COLOURS[FRONTIER], TRUE, COMMITTED):  # at least in the legend
        assert share(image, colour) > 1e-4


def test_a_decision_that_is_not_there(tmp_path, capsys, failed):
    out = tmp_path / "x.png"
    assert main(["view", str(failed), "--decision", "999", "--png", str(out)]) == 2
    assert "no decision 999, expected 0 to" in capsys.readouterr().err
    assert not out.exists()


def test_a_log_without_decisions_has_no_picture(tmp_path, capsys, recorded):
    stack = tmp_path / "mute.py"
    stack.write_text(
        "class Mute:\n"
        "    def start(self, task): pass\n"
        "    def step(self, observation): return 'no command'\n"
        "    def close(self): pass\n"
    )
    log = recorded("empty", "quadruped", 1, f"stack.name={stack}:Mute").log
    for name in (["--decision", "0", "--png", "x.png"], ["--movie", "x.gif"]):
        out = tmp_path / name[-1]
        assert main(["view", log, *name[:-1], str(out), "--allow-plugins"]) == 2
        assert capsys.readouterr().err == f"wayproof: log '{log}': no decisions in it\n"
        assert not out.exists()


def test_beyond_the_map_a_picture_is_unknown_and_its_legend_covers_nothing(log, moment):
    view = TopView(open_log(log))
    view.follow(moment)
    figure = view.figure(moment, None, [Mark((8.0, 8.0), "contact", "*")])
    FigureCanvasAgg(figure).draw()
    [axes] = figure.axes
    assert np.allclose(axes.get_facecolor()[:3], np.array(COLOURS[UNKNOWN]) / 255.0)
    [legend] = figure.legends
    assert not legend.get_window_extent().overlaps(axes.get_tightbbox())
    [words] = figure.texts
    assert not words.get_window_extent().overlaps(axes.get_tightbbox())
    named = {text.get_text() for text in legend.get_texts()}
    body = {"robot, where it was (solid circle)", "committed trajectory", "goal", "contact"}
    assert body | {"free", "unknown, or outside the map", "occupied"} <= named
    assert words.get_text().startswith("decision 25, 2.5 s: ")


def test_the_words_are_those_of_the_decision(moment):
    first, figures, reason = head(moment, cost_range=0.6, axes=3)
    assert first == f"decision 25, 2.5 s: {moment.decision.action}"
    true, least = moment.truth.clearance_m, moment.decision.least_clearance_m
    assert 0.5 < true < 2.0  # of the floor
    assert figures.startswith(f"clearance {true:.2f} m, in the map along the path {least:.2f} m;")
    assert "pose error 0.0" in figures
    assert reason == moment.decision.reason


def test_a_picture_is_the_same_again(log, moment):
    view = TopView(open_log(log))
    view.follow(moment)
    assert view.draw(moment) == view.draw(moment)
