"""Words of pictures."""

import numpy as np
import pytest
from PIL import Image

from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.caption import captioned, head, scene_size
from wayproof.harness.viewer.moments import moments


@pytest.fixture(scope="module")
def moment(log):
    opened = open_log(log)
    return next(one for one in moments(opened) if one.decision.sequence == 25)


def test_the_words_are_those_of_the_decision(moment):
    first, figures, reason = head(moment, cost_range=0.6, axes=3)
    assert first == f"2.5 s   decision 25   {moment.decision.action}"
    assert moment.truth.clearance_m == 2.0  # as far as it is measured
    least = moment.decision.least_clearance_m
    assert figures.startswith(f"clearance >= 2.00 m, in the map along the path {least:.2f} m;")
    assert "pose error 0.0" in figures
    assert reason == moment.decision.reason


def test_the_error_of_a_walker_leaves_its_height_out(moment):
    off = np.subtract(moment.record.inputs.pose.position, moment.truth.position)
    assert head(moment, 0.6, axes=2)[1].endswith(f"pose error {np.hypot(*off[:2]):.2f} m")


@pytest.mark.parametrize("size", [(960, 640), (720, 480)])
def test_words_frame_the_scene_and_leave_it_as_it_is(moment, size):
    scene = Image.new("RGB", scene_size(size), (10, 200, 30))
    picture = captioned(scene, moment, cost_range=0.6, axes=3)
    assert picture.size == size
    pixels = np.asarray(picture)
    green = (pixels == (10, 200, 30)).all(axis=2)
    rows = np.flatnonzero(green.all(axis=1))
    assert len(rows) == scene.height == rows[-1] - rows[0] + 1
    above, below = pixels[: rows[0]], pixels[rows[-1] + 1 :]
    for band in (above, below):
        assert (band[:, -2:] == 255).all()  # no word is cut at the edge
        assert (band < 100).any()


def test_a_long_reason_is_shortened(moment):
    scene = Image.new("RGB", scene_size((720, 480)))
    moment.decision.reason, kept = "a word and another " * 20, moment.decision.reason
    try:
        band = np.asarray(captioned(scene, moment, cost_range=0.6, axes=3))[:60]
    finally:
        moment.decision.reason = kept
    assert (band[:, -4:] == 255).all()
