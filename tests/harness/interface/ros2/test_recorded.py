"""A bag recorded from the topics of a run, stepped through as a recording."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.recording import RecordingOptions
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.shadow.summary import summarize

HERE = Path(__file__).parent
DOMAIN = 1 + os.getpid() % 100


def run_process(*words):
    return subprocess.Popen([sys.executable, *map(str, words)])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Log of an episode, and the bag that a recorder of all its topics made."""
    folder = tmp_path_factory.mktemp("recorded")
    bag, stack = folder / "bag", f"stack.name=ros2:domain={DOMAIN},pace=lockstep"
    recorder = run_process(HERE / "recorder.py", DOMAIN, bag, "MCAP")
    client = run_process(HERE / "client.py", DOMAIN, "Repeats")  # so the first sweep comes twice
    try:
        settings = ["episode.time_limit=1.5", "plugins.wall_s=30", stack]
        run = run_episode(build(override(Config("empty", "quadruped", 1), settings)), folder / "a")
    finally:
        client.kill()
        recorder.terminate()
        assert recorder.wait(20) == 0
        client.wait()
    return Path(run.log), bag


def shadow(recording, log, **options):
    recording = open_recording(recording, options=RecordingOptions(**options))
    prepared = prepare(recording, find_body("quadruped"), [], seed=0)
    return run_recording(recording, prepared, log), recording


def versions(log):
    return [record.decision.map_version for record in open_log(log).records()]


def test_a_bag_of_the_topics_gives_the_maps_of_the_log(recorded, tmp_path):
    log, bag = recorded
    of_log, _ = shadow(log, tmp_path / "of-log.mcap", missing_returns_free=False)
    of_bag, recording = shadow(bag, tmp_path / "of-bag.mcap", sensors=("/points",), range_max=12.0)
    assert len(versions(of_bag)) == 16
    assert versions(of_bag) == versions(of_log)
    assert len(set(versions(of_bag))) == 16
    assert recording.body_height == pytest.approx(0.3, abs=0.02)
    summary = summarize(assess(of_bag))
    assert summary.driven_m > 0.1
    assert summary.admitted_share == 1.0
