"""A bag recorded from the topics of a run, stepped through as a recording."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.filters import NAMES
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.replay.replay import replay
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.body import find_body
from wayproof.harness.shadow.prepare import prepare
from wayproof.harness.shadow.runner import run_recording
from wayproof.harness.shadow.summary import summarize

HERE = Path(__file__).parent
DOMAIN = 1 + os.getpid() % 100


def run_process(*words):
    return subprocess.Popen([sys.executable, *map(str, words)], stdout=subprocess.PIPE)


POINTS = ("/tf", "/tf_static", "/odom", "/points", "/scan", "/cmd_vel")
"""What a recorder of any robot's topics takes."""

ALL = (*POINTS, "/task", "/points/ranges")


class Recorded:
    """An episode of lockstep or of a timer, and the bag that a recorder of its topics made."""

    def __init__(
        self, folder, topics, pace="lockstep", client="Repeats", settings=(), robot="quadruped"
    ):
        self.bag, stack = folder / "bag", f"stack.name=ros2:domain={DOMAIN},pace={pace}"
        filtered = f"map.filters={','.join(NAMES)}"  # as the built-in stack's map has them
        running = ["episode.time_limit=1", "plugins.wall_s=30", stack, filtered]
        scenario = build(override(Config("empty", robot, 1), [*running, *settings]))
        words = HERE / "recorder.py", DOMAIN, self.bag, "MCAP", *topics
        with run_process(*words) as recorder, recorder.stdout as output:
            assert output.readline() == b"subscribed\n"
            with run_process(HERE / "client.py", DOMAIN, client) as node, node.stdout:
                self.log = Path(run_episode(scenario, folder / "a.mcap").log)
                node.kill()
            recorder.terminate()
            assert recorder.wait(20) == 0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """All topics; the first sweep comes twice."""
    return Recorded(tmp_path_factory.mktemp("recorded"), ALL)


def shadow(recording, log, robot="quadruped", off=None, **options):
    recording = open_recording(recording, options=RecordingOptions(**options))
    prepared = prepare(recording, find_body(robot), [], seed=0, perturbation=off)
    return run_recording(recording, prepared, log), recording


def ranges_in(log):
    inputs = next(open_log(log).records()).inputs
    return set(np.unique(inputs.sweeps[0].ranges_mm).tolist())


def versions(log):
    return [record.decision.map_version for record in open_log(log).records()]


def test_a_bag_of_the_topics_gives_the_maps_that_the_referee_had(recorded, tmp_path):
    of_bag, _ = shadow(recorded.bag, tmp_path / "b.mcap", sensors=("/points",))
    assert len(versions(of_bag)) == 11
    assert versions(of_bag) == versions(recorded.log)
    assert replay(of_bag).identical
    assert summarize(assess(of_bag)).admitted_share == 1.0


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["calibration", "rate"])
def test_what_a_perturbation_leaves_alone_stays_exact(recorded, tmp_path, kind):
    perturbation = type(perturbation_from(f"{kind}:5"))(severity=5, window=(0.5, 10.0))
    of_bag, _ = shadow(recorded.bag, tmp_path / "b.mcap", sensors=("/points",), off=perturbation)
    alike = [a == b for a, b in zip(versions(of_bag), versions(recorded.log), strict=True)]
    assert alike[:5] == [True] * 5
    assert not all(alike)
    assert replay(of_bag).identical


def test_a_shorter_range_and_silence_that_says_nothing_count(recorded, tmp_path):
    options = {"sensors": ("/points/ranges",), "range_max": 3.0}
    short, recording = shadow(recorded.bag, tmp_path / "short.mcap", **options)
    assert recording.sensors[0].range_max == 3.0
    assert {0, 65535} & ranges_in(short) == {65535}
    assert 2000 < max(ranges_in(short) - {65535}) <= 3000
    unsure, _ = shadow(recorded.bag, tmp_path / "u.mcap", no_return_is_free=False, **options)
    assert ranges_in(unsure) == ranges_in(short) - {65535} | {0}


@pytest.mark.large
@pytest.mark.parametrize(
    ("pace", "client", "settings"),
    [
        ("auto", "SlowTimer", ()),  # a node was waited for
        ("lockstep", "Repeats", ["sensors.lidar=velodyne-vlp16"]),  # a rolling shutter
    ],
)
def test_so_it_does_at_another_pace_and_of_another_sensor(tmp_path, pace, client, settings):
    made = Recorded(tmp_path, ALL, pace, client, settings)
    of_bag, _ = shadow(made.bag, tmp_path / "b.mcap", sensors=("/points",))
    assert versions(of_bag) == versions(made.log)


def test_so_it_does_of_the_three_sensors_of_a_drone(tmp_path):
    sensors = "/points/ranges", "/depth/image/ranges", "/altimeter/ranges"
    drone = Recorded(tmp_path, ("/tf", "/tf_static", "/task", *sensors), robot="drone")
    of_bag, _ = shadow(drone.bag, tmp_path / "b.mcap", "drone", sensors=sensors)
    assert versions(of_bag) == versions(drone.log)


def test_a_bag_of_points_gives_the_maps_of_the_log_without_silent_beams(tmp_path):
    recorded = Recorded(tmp_path, POINTS)
    of_log, _ = shadow(recorded.log, tmp_path / "of-log.mcap", no_return_is_free=False)
    options = {"sensors": ("/points",), "range_max": 12.0}
    of_bag, recording = shadow(recorded.bag, tmp_path / "of-bag.mcap", **options)
    assert len(versions(of_bag)) == 11
    assert versions(of_bag) == versions(of_log)
    assert len(set(versions(of_bag))) == 11
    assert recording.body_height == pytest.approx(0.3, abs=0.02)
    summary = summarize(assess(of_bag))
    assert summary.driven_m > 0.05
    assert summary.admitted_share == 1.0
