"""Pictures of single decisions."""

from pathlib import Path

import numpy as np
from PIL import Image

from tests.harness.viewer.drawn import drawn


def test_a_picture_shows_the_map(tmp_path, log):
    out = tmp_path / "x.png"
    assert drawn(["picture", str(log), "25", "--out", str(out)]) == (0, "")
    image = np.asarray(Image.open(out).convert("RGB"), int)
    assert image.shape == (640, 960, 3)
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    assert (blue - red > 30).mean() > 0.05  # occupied cells
    assert (red - blue > 30).mean() > 0.02  # inflation and trail
    assert ((green - red > 30) & (green - blue > 30)).any()  # the trajectory


def test_a_decision_that_is_not_there(tmp_path, failed):
    out = tmp_path / "x.png"
    code, error = drawn(["picture", str(failed), "999", "--out", str(out)])
    assert code == 2
    assert "no decision 999, expected 0 to" in error
    assert not out.exists()


def test_a_log_without_decisions_has_no_picture(tmp_path, recorded):
    stack = Path(__file__).parents[1] / "interface" / "stacks_on_trial.py"
    log = recorded("empty", "quadruped", 1, f"stack.name={stack}:Nothing").log
    out = tmp_path / "x.png"
    code, error = drawn(["picture", log, "0", "--out", str(out), "--allow-plugins"])
    assert (code, error) == (2, f"wayproof: log '{log}': no decisions in it\n")
    assert not out.exists()
