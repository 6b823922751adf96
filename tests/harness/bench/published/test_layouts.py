"""Recordings in the layouts of public datasets, from a short episode, through the whole chain."""

import pytest

from wayproof.harness.bench.published import layout_trial as trial
from wayproof.harness.bench.published.layouts import DEPTH_LAYOUTS, write_kitti
from wayproof.harness.log.reader import open_log
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay

CAMERA = trial.camera_of(48, 36)
SECONDS = 1.5


@pytest.fixture(scope="module")
def depth_episode(tmp_path_factory):
    with trial.registered(CAMERA):
        folder = tmp_path_factory.mktemp("depth")
        yield trial.episode_of(folder, "depth", trial.NAME, SECONDS)


@pytest.fixture(scope="module")
def lidar_episode(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lidar")
    return trial.episode_of(folder, "lidar", "ideal-lidar-floor", SECONDS)


@pytest.mark.parametrize("layout", [*DEPTH_LAYOUTS, "kitti"])
def test_the_maps_are_those_of_the_episode(layout, request, tmp_path):
    kind = "lidar" if layout == "kitti" else "depth"
    episode = request.getfixturevalue(f"{kind}_episode")
    own = open_recording(episode)
    write = DEPTH_LAYOUTS.get(layout)
    path = write_kitti(own, tmp_path) if write is None else write(own, CAMERA, tmp_path)
    options = trial.options_for(layout, own, CAMERA)
    log = trial.step_through(path, options, own.body_height, tmp_path / "log.mcap")
    assert open_log(log).config.recording.format == {"tum": "tum", "kitti": "kitti"}.get(
        layout, "frames"
    )
    alike = trial.compare_maps(episode, log, every=4)
    assert alike.maps >= 3
    assert alike.cells > 2000
    assert alike.share >= 0.999
    assert replay(log).identical
    assert audit(log).violations == ()
