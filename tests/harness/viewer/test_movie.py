"""Animations of episodes."""

import sys

import pytest
from PIL import Image

from wayproof.harness.cli.main import main

RUN = ["run", "empty", "--robot", "drone", "--seed", "1", "--set", "episode.time_limit=1"]


def test_an_animation_plays_in_simulated_time(tmp_path, failed):
    out = tmp_path / "x.gif"
    words = ["view", str(failed), "--movie", str(out), "--period", "0.5"]
    assert main(words) == 0
    with Image.open(out) as animation:
        assert animation.n_frames == 3
        assert animation.info["duration"] == 500


@pytest.mark.large
def test_an_mp4_is_an_episode_in_simulated_time(tmp_path):
    av = pytest.importorskip("av")
    out = tmp_path / "films" / "x.mp4"
    assert main([*RUN, "--log", str(tmp_path / "x.mcap")]) == 1  # too short to arrive
    assert main(["view", str(tmp_path / "x.mcap"), "--movie", str(out)]) == 0
    with av.open(str(out)) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert stream.average_rate == 5
    assert len(frames) == 6
    assert frames[0].shape == (840, 700, 3)
    assert frames[0].std() > 20
    assert not list(out.parent.glob("*.partial"))


def test_a_missing_encoder_is_an_error_of_one_line(capsys, monkeypatch, tmp_path, failed):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(failed), "--movie", "x.mp4"]) == 2
    assert "pip install av (the extra 'video'), or name a .gif" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
